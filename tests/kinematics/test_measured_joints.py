"""Coordinates of joints that follow, in loops and where rods hang on a platform: they close, and have derivatives; so have
the rotations of all links."""

import pickle
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from loaded_machines import drawn
from single_postures import written
from test_planar_loops import five_bar, hinge, parallelogram
from urdfs import joint, loop, own, robot_of

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.displacement import Displacement
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import RobotError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.posture import ClosedPosture
from gtpin.kinematics.rotations import log
from gtpin.robot.chain import measured_joint

Floats = np.ndarray

STEP = 1e-6


def four_bar() -> gtpin.Robot:
    return robot_of(
        "four_bar",
        hinge("crank", "base", "arm", "0 0 0", "0 0 1", 1.0),
        hinge("coupler", "arm", "bar", "0.1 0 0", "0 0 1", -1.0, "continuous"),
        hinge("rocker", "base", "back", "0.25 0 0", "0 0 1", 1.3),
        loop("bar", "0.26 0 0", "back", "0.18 0 0"),
        own(["crank"], "bar"),
    )


def slider() -> gtpin.Robot:
    """A crank that moves a slider: its coordinate is a length."""
    return robot_of(
        "slider",
        hinge("crank", "base", "arm", "0 0 0", "0 0 1", 1.0),
        hinge("coupler", "arm", "bar", "0.1 0 0", "0 0 1", -1.0),
        hinge("slide", "base", "block", "0.4 0 0", "1 0 0", 0.0, "prismatic"),
        loop("bar", "0.3 0 0", "block", "0 0 0"),
        own(["crank"], "bar"),
    )


def spatial_loop() -> gtpin.Robot:
    """A crank, a coupler that hangs on it by a universal joint, and a rocker to which a ball joint leads: RUSR."""
    return robot_of(
        "rusr",
        joint("crank_joint", "base", "crank", kind="continuous"),
        joint("cross_joint", "crank", "cross", "0.2 0 0", kind="continuous", rpy="0 0 1.0"),
        joint("coupler_joint", "cross", "coupler", axis="0 1 0", kind="continuous"),
        joint("rocker_joint", "base", "rocker", "0.6 0 0", kind="continuous", rpy="0.3 0 1.9"),
        loop("coupler", "0.5 0 0", "rocker", "0.45 0 0"),
        own(["crank_joint"], "rocker"),
    )


ROBOTS: dict[str, tuple[Callable[[], gtpin.Robot], tuple[str, ...]]] = {
    "four_bar": (four_bar, ("coupler", "rocker")),
    "five_bar": (five_bar, ("elbow2", "elbow1")),
    "slider": (slider, ("slide", "coupler")),
    "parallelogram": (parallelogram, ("follow", "top")),
    "rusr": (spatial_loop, ("rocker_joint", "coupler_joint", "cross_joint")),
}
RODS = ("gantry_tau", "gantry_tau_6dof", "linear_delta", "stewart")


@pytest.fixture(params=(*ROBOTS, *RODS), scope="module")
def robot(request: pytest.FixtureRequest) -> gtpin.Robot:
    """With all joints measured that can be, two of each rod, and all links."""
    if request.param in RODS:
        plain = gtpin.load_robot(request.param)
        assert len(plain.readable) == 12
        return plain.measuring(plain.readable, plain.links)
    made, joints = ROBOTS[request.param]
    plain = made()
    return plain.measuring(joints, plain.links)


looped, of_rods = (pytest.mark.parametrize("robot", names, indirect=True) for names in (tuple(ROBOTS), RODS))


def commands(robot: gtpin.Robot) -> Floats:
    way = np.random.default_rng(3).uniform(-0.15, 0.15, (4, robot.n_actuators))
    ends = (np.where(np.isfinite(end), end, side) for end, side in ((robot.upper, 1.0), (robot.lower, -1.0)))
    return np.asarray(robot.home_q + way * np.subtract(*ends))


def coordinates(poses: gtpin.Poses) -> Floats:
    """(N, k)."""
    return np.stack(list(poses.joints.values()), axis=1)


def motion(one: gtpin.Poses, other: gtpin.Poses) -> Floats:
    """(N, 6 + 3 l + k) by what poses, rotations of links and coordinates differ."""
    links = [log(R @ np.swapaxes(other.links[name], 1, 2)) for name, R in one.links.items()]
    return np.hstack([one.minus(other), *links, coordinates(one) - coordinates(other)])


def test_the_joints_that_can_be_read_are_those_that_the_loops_move() -> None:
    for made, joints in ROBOTS.values():
        assert set(made().readable) == set(joints)


@looped
def test_coordinates_close_the_loops(robot: gtpin.Robot) -> None:
    """Pinocchio's own forward kinematics at the coordinates leaves no gap of the nominal loops."""
    geometry, q = gtpin.Geometry.nominal(robot), commands(robot)
    found = Kinematics(geometry).forward(q)
    assert tuple(found.joints) == tuple(joint.name for joint in robot.measured_joints)
    assert set(robot.readable) == set(found.joints)  # so that they and the commands are all
    for i, row in enumerate(q):
        configuration = pin.neutral(robot.model)
        for name, value in {
            **{a.joint: v for a, v in zip(robot.actuators, row, strict=True)},
            **{name: x[i] for name, x in found.joints.items()},
        }.items():
            joint = robot.model.getJointId(name)
            at = robot.model.idx_qs[joint]
            size = robot.model.nqs[joint]
            configuration[at : at + size] = [value] if size == 1 else [np.cos(value), np.sin(value)]
        pin.forwardKinematics(robot.model, robot.data, configuration)
        for c in robot.constraints:
            one, other = (
                (robot.data.oMi[j] * M).translation
                for j, M in ((c.joint1_id, c.joint1_placement), (c.joint2_id, c.joint2_placement))
            )
            assert np.abs(one - other).max() < 1e-12


@pytest.mark.slow
def test_derivatives_are_those_of_poses_and_coordinates(robot: gtpin.Robot) -> None:
    moved, q = drawn(robot, 2), commands(robot)
    here = Kinematics(moved)
    found, plain = here.geometry_jacobian(q, here.forward(q)), Kinematics(gtpin.Geometry.nominal(robot)).forward(q)
    assert plain.reached.all()
    assert found.shape[1] == robot.motion_size == 6 + 3 * len(robot.links) + len(robot.measured_joints)

    def at(h: Floats) -> gtpin.Poses:
        return Kinematics(moved.with_values(moved.values + h)).forward(q)

    slopes = [motion(at(h), at(-h)) / (2.0 * STEP) for h in STEP * np.eye(len(moved.values))]
    np.testing.assert_allclose(found, np.stack(slopes, axis=2), rtol=0, atol=1e-7)
    steps = STEP * np.eye(robot.n_actuators)
    slopes = [motion(here.forward(q + h), here.forward(q - h)) / (2.0 * STEP) for h in steps]
    found = here.command_jacobian(q, here.forward(q))
    assert np.abs(found[:, 6:]).max() > 0.1
    np.testing.assert_allclose(found, np.stack(slopes, axis=2), rtol=0, atol=1e-7)


class Displaced(Effect):
    """One coefficient displaces a command, the target, and all frames, or the rods' joints on carriers and lengths."""

    id, title = "displaced", "displaced"

    def sites(self, robot: gtpin.Robot) -> tuple[str, ...]:
        return robot.sites

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        rng, k = np.random.default_rng(4), len(at.robot.rods)

        def some(*shape: int) -> Floats:
            return rng.standard_normal((len(at), *shape, 1))

        if k:
            parts = {"carrier_joints": some(k, 3), "length": some(k)}
        else:
            parts = {"placements": tuple((i, some(6)) for i in range(at.robot.model.njoints))}
        return Displacement(np.ones(1), command=(0, some()), twist=some(6), **parts)


def test_displacements_by_effects_are_those_of_the_exact_solution(robot: gtpin.Robot) -> None:
    here, q = Kinematics(drawn(robot, 2)), commands(robot)
    at = OperatingPoints(here, q, here.forward(q), {})
    first = Displaced().basis(at, robot.sites[0]).displacement(at)[:, :, 0]

    def displaced(size: float) -> gtpin.Poses:
        active = ActiveEffect(Displaced(), robot.sites[0], None, np.array([size]), np.zeros((1, 1)), at.references)
        return with_effects(here, q, {}, [active])

    exact = motion(displaced(STEP), displaced(-STEP)) / (2.0 * STEP)
    assert np.abs(first[:, 6:]).max() > 0.1
    np.testing.assert_allclose(first, exact, rtol=1e-7, atol=1e-7)


def test_a_robot_measures_the_same_after_it_was_sent_elsewhere_and_moved(robot: gtpin.Robot) -> None:
    again = pickle.loads(pickle.dumps(robot))
    assert again.measured_joints == robot.measured_joints
    assert robot.measuring((joint.name for joint in robot.measured_joints), robot.links) is robot
    assert robot.measuring([]).measured_joints == robot.measuring([]).measured_links == ()
    q = commands(robot)
    np.testing.assert_array_equal(
        coordinates(Kinematics(drawn(again, 2)).forward(q)), coordinates(Kinematics(drawn(robot, 2)).forward(q))
    )


def test_poses_do_not_depend_on_what_is_measured(robot: gtpin.Robot) -> None:
    q, plain = commands(robot), robot.measuring([])
    one, other = (Kinematics(drawn(r, 2)) for r in (robot, plain))
    here, there = one.forward(q), other.forward(q)
    np.testing.assert_allclose(here.T, there.T, rtol=0, atol=1e-14 * robot.size)
    found, plain_found = one.geometry_jacobian(q, here)[:, :6], other.geometry_jacobian(q, there)
    np.testing.assert_allclose(found, plain_found, rtol=0, atol=1e-11 * np.abs(plain_found).max())
    assert not there.joints


def turned(one: Floats, other: Floats) -> Floats:
    """Differences of angles, rad."""
    return np.abs(np.angle(np.exp(1j * (one - other))))


def postures(geometry: gtpin.Geometry, q: Floats) -> list[ClosedPosture]:
    """As Pinocchio closes the URDF of a geometry, pose by pose."""
    plain = gtpin.Geometry(geometry.robot.measuring([]), geometry.parameters, geometry.values)
    start = gtpin.home(written(plain))
    return [start.moved_to(row) for row in q]


@of_rods
def test_coordinates_are_pinocchio_s_of_the_machine_s_own_urdf(robot: gtpin.Robot) -> None:
    """No parameter turns the rods' joints on the platform, so that this URDF has them as the nominal one does."""
    moved, q = drawn(robot, 2), commands(robot)
    found = Kinematics(moved).forward(q)
    for i, posture in enumerate(postures(moved, q)):
        for name, x in found.joints.items():
            there = measured_joint(posture.robot, name).coordinates(posture.configuration[None])
            assert turned(x[[i]], there) < 1e-9, name
        for name, R in found.links.items():
            assert np.abs(R[i] - posture.robot.forward(q[i], name).R).max() < 1e-9, name


@of_rods
def test_poses_that_are_not_reached_have_no_coordinates(robot: gtpin.Robot) -> None:
    q = np.vstack([robot.home_q, robot.home_q + 50.0 * np.eye(robot.n_actuators)[0]])
    found = Kinematics(gtpin.Geometry.nominal(robot)).forward(q)
    assert found.reached.tolist() == [True, False]
    assert np.isfinite(coordinates(found)).all(axis=1).tolist() == [True, False]


def test_a_platform_s_pose_has_several_coordinates_and_a_cart_is_driven() -> None:
    robot = gtpin.load_robot("gantry_tau")
    for name, what in (("platform_pose", "6 coordinates"), ("track1", "driven by q1")):
        with pytest.raises(RobotError, match=what) as caught:
            robot.measuring([name])
        assert "link1_pitch" in caught.value.hint
