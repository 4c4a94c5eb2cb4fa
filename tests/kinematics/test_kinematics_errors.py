"""What can't be closed is said, in one line that tells how far it got."""

from xml.etree import ElementTree

import numpy as np
import pytest
from closures import Closures

import gtpin
from gtpin.errors import AssemblyModeError, ClosureError, ModelError, SingularityError, UnreachableError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.robot.description import RobotDescription


def one_line(error: Exception) -> str:
    said = str(error)
    assert said
    assert "\n" not in said
    return said


@pytest.mark.parametrize("q", [(0, 0, 1e6), (50, 0, 0), (-3, 3, 0)])
def test_commands_where_the_rods_do_not_reach_raise(at_home: gtpin.ClosedPosture, q: tuple[float, ...]) -> None:
    with pytest.raises(ClosureError) as caught:
        at_home.moved_to(q)
    assert "gantry_tau" in one_line(caught.value)


@pytest.mark.parametrize("q", [(0, 0), (0, 0, 0, 0), (0, 0, np.nan), (np.inf, 0, 0), ((0, 0, 0),), 0.0])
def test_commands_that_are_no_three_numbers_raise(at_home: gtpin.ClosedPosture, q: object) -> None:
    with pytest.raises(UnreachableError, match="3 finite numbers") as caught:
        at_home.moved_to(q)  # type: ignore[arg-type]
    one_line(caught.value)


def test_loops_open_at_a_singularity_and_the_error_says_so(at_home: gtpin.ClosedPosture) -> None:
    closed, opened = 2.5, 3.5  # cart 3, far outside its range
    posture, said = at_home.moved_to((0, 0, closed)), set()
    for _ in range(30):
        middle = (closed + opened) / 2.0
        try:
            posture, closed = posture.moved_to((0, 0, middle)), middle
        except ClosureError as error:
            said.add(type(error))
            one_line(error)
            opened = middle
    assert np.linalg.norm(posture.passive_inverse) > 10.0 * np.linalg.norm(at_home.passive_inverse)
    assert SingularityError in said
    assert said <= {SingularityError, AssemblyModeError}


def test_a_batch_is_nan_exactly_where_it_can_not_be_closed(arrays: Kinematics, robot: gtpin.Robot) -> None:
    rng = np.random.default_rng(1)
    q = rng.uniform(robot.lower, robot.upper, (200, 3))
    whole = arrays.forward(q)
    lost = rng.choice(200, 40, replace=False)
    spoilt = q.copy()
    spoilt[lost[:20], rng.integers(0, 3, 20)] = 40.0
    spoilt[lost[20:35], rng.integers(0, 3, 15)] = np.nan
    spoilt[lost[35:], rng.integers(0, 3, 5)] = -np.inf
    with np.errstate(invalid="ignore"):
        poses = arrays.forward(spoilt)
    right = np.setdiff1d(np.arange(200), lost)
    assert np.isnan(poses.T[lost]).all()
    assert np.isnan(poses.R[lost]).all()
    np.testing.assert_array_equal(np.flatnonzero(poses.reached), right)
    np.testing.assert_allclose(poses.T[right], whole.T[right], rtol=0, atol=1e-13)
    np.testing.assert_allclose(poses.R[right], whole.R[right], rtol=0, atol=1e-13)
    assert np.isnan(poses.quaternions[lost]).all()
    assert np.isfinite(poses.quaternions[right]).all()
    difference = poses.minus(whole)
    assert np.isnan(difference[lost]).all()
    assert np.abs(difference[right]).max() <= 1e-13


@pytest.mark.parametrize("machine", ["gantry_tau", "stewart"], indirect=True)
@pytest.mark.parametrize("spoilt", [0.0, np.nan, 1.0])
def test_one_singular_pose_in_a_batch_spoils_no_other(machine: Closures, closures: Kinematics, spoilt: float) -> None:
    """A derivative of the closures that is zero, unknown, or of equal columns: of rank 1."""
    loops, q = closures.loops, machine.commands(4, seed=10)
    here = loops.at(closures.forward(q).configuration, closures.placed)
    dq = np.full(q.shape, 0.01)
    steps, inverses = loops.step(here, dq), here.inverse
    spoiled = here.take(np.arange(4))
    del vars(spoiled)["inverse"]
    spoiled.equations.D[1:3] = spoilt
    found, inverse = loops.step(spoiled, dq), spoiled.inverse
    np.testing.assert_allclose(found[[0, 3]], steps[[0, 3]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(inverse[[0, 3]], inverses[[0, 3]], rtol=1e-9, atol=1e-12)
    assert (loops.amplification(spoiled.equations.D[1:3]) > 1e12).all()
    assert not np.isfinite(found[1:3]).all(axis=1).any()


@pytest.mark.parametrize("shape", [(3,), (2, 2), (2, 4), (1, 2, 3)])
def test_commands_of_another_shape_are_refused_in_arrays(arrays: Kinematics, shape: tuple[int, ...]) -> None:
    with pytest.raises(ModelError, match=r"\(N, 3\)"):
        arrays.forward(np.zeros(shape))


def test_no_commands_give_no_poses(arrays: Kinematics) -> None:
    poses = arrays.forward(np.zeros((0, 3)))
    assert len(poses) == 0
    assert poses.quaternions.shape == (0, 4)
    assert arrays.geometry_jacobian(np.zeros((0, 3)), poses).shape == (0, 6, 48)


@pytest.mark.slow
def test_a_home_that_does_not_close_raises(gantry: Closures) -> None:
    short = gantry.urdf.replace('xyz="0 0 2.04422"', 'xyz="0 0 0.4"')
    assert short != gantry.urdf
    with pytest.raises(UnreachableError, match="home") as caught:
        gtpin.home(gtpin.Robot(RobotDescription.parse(short)))
    one_line(caught.value)


def test_a_geometry_of_another_robot_is_refused(
    robot: gtpin.Robot, at_home: gtpin.ClosedPosture, gantry: Closures
) -> None:
    nominal = gtpin.Geometry.nominal(robot)
    with pytest.raises(ModelError):
        gtpin.geometry_jacobian(at_home, nominal.with_values(nominal.values + 1e-4))
    longer = gtpin.Robot(RobotDescription.parse(gantry.urdf.replace("2.04422", "2.04522")))
    with pytest.raises(ModelError):
        gtpin.geometry_jacobian(at_home, gtpin.Geometry.nominal(longer))


def test_a_machine_whose_rods_are_not_told_moves_as_with_them(gantry: Closures) -> None:
    root = ElementTree.fromstring(gantry.urdf)
    own = root.find("gtpin")
    assert own is not None
    for rod in own.findall("rod"):
        own.remove(rod)
    bare = gtpin.Robot(RobotDescription.parse(ElementTree.tostring(root, encoding="unicode")))
    assert bare.rods == ()
    q = gantry.commands(20, seed=11)
    T, R = gantry.follow(q)
    poses = Kinematics(gtpin.Geometry.nominal(bare)).forward(q)
    np.testing.assert_allclose(poses.T, T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(poses.R, R, rtol=0, atol=1e-12)
    np.testing.assert_allclose(gtpin.home(bare).moved_to(q[0]).T, T[0], rtol=0, atol=1e-12)
