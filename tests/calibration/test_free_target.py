"""A target that sits anywhere, measured from anywhere; what poses can't determine of it is fixed by convention, and said."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pinocchio as pin
import pytest
from quick_first import quick_first

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.calibration.checks.before_fit import check_moved
from gtpin.data import Dataset, InstrumentSection
from gtpin.effects import OperatingPoints
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import DatasetError, GtpinWarning
from gtpin.instruments.frame_and_target import frame_and_target
from gtpin.kinematics.poses import Poses
from gtpin.output.shown import present
from gtpin.robot.chain import moving_links
from gtpin.robot.description import RobotDescription

ROBOT = gtpin.load_robot("ur5")
FOLDED = np.array([0.0, -1.5, 1.5, -1.5, -1.5, 0.0])
NOISE = 2e-5


def measured_elsewhere(seed: int, count: int = 60) -> tuple[Poses, Poses, pin.SE3]:
    """Nominal poses, those of a target X in a frame F by Pinocchio's own products, some with gross errors, and X."""
    rng = np.random.default_rng(seed)
    q = FOLDED + rng.uniform(-0.8, 0.8, (count, 6))
    plain = gtpin.Model(gtpin.Geometry.nominal(ROBOT)).predict(q)
    X = pin.SE3(pin.exp3(rng.standard_normal(3)), 0.1 * rng.standard_normal(3))
    F = pin.SE3(pin.exp3(rng.standard_normal(3)), 3.0 * rng.standard_normal(3))
    seen = [F * pin.SE3(R, T) * X for T, R in zip(plain.T, plain.R, strict=True)]
    T = np.array([M.translation for M in seen]) + NOISE * rng.standard_normal((count, 3))
    T[:3] += 0.5
    return plain, Poses(T, np.array([M.rotation for M in seen])), X


@pytest.mark.parametrize("seed", quick_first(range(5)))
@pytest.mark.parametrize("orientations", [True, False])
def test_the_target_is_found_to_the_noise_of_the_mean_in_spite_of_gross_errors(seed: int, orientations: bool) -> None:
    plain, seen, X = measured_elsewhere(seed)
    found = frame_and_target(plain, seen.T, seen.R if orientations else None)
    assert np.linalg.norm(found.at - X.translation) < 3.0 * NOISE
    assert found.unseen.shape == (0, 3)
    if orientations:
        assert np.linalg.norm(pin.log3(found.mount.T @ X.rotation)) < 1e-9


@pytest.mark.slow
def test_with_frame_and_target_free_poses_that_were_not_measured_are_predicted_as_if_both_were_known() -> None:
    case = make_case(4, robot="ur5", poses=80, held_out=40)
    rng = np.random.default_rng(0)
    X = pin.SE3(pin.exp3(rng.standard_normal(3)), np.array([0.06, -0.03, 0.09]))
    F = pin.SE3(pin.exp3(rng.standard_normal(3)), np.array([2.0, -1.0, 0.4]))

    def elsewhere(T: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = [F * pin.SE3(r, t) * X for t, r in zip(T, R, strict=True)]
        return np.array([M.translation for M in moved]), np.array([M.rotation for M in moved])

    wxyz = case.dataset.orientation
    assert wxyz is not None
    T, R = elsewhere(case.dataset.position, np.array([pin.Quaternion(*row).matrix() for row in wxyz]))
    quaternions = [pin.Quaternion(rotation) for rotation in R]
    dataset = replace(
        case.dataset,
        position=T,
        orientation=np.array([[Q.w, Q.x, Q.y, Q.z] for Q in quaternions]),
        instrument=InstrumentSection(position_sigma=1.5e-5, orientation_sigma=5e-5, frame="free", target="free"),
    )
    known = gtpin.calibrate(case.dataset).model.predict(case.commands.q).T - case.truth.T
    free = gtpin.calibrate(dataset).model.predict(case.commands.q).T - elsewhere(case.truth.T, case.truth.R)[0]
    # Twelve numbers more, of 80 poses with six readings each.
    assert np.sqrt((free**2).sum(axis=1).mean()) < 1.1 * np.sqrt((known**2).sum(axis=1).mean())


def test_a_free_target_on_rods_is_refused() -> None:
    dataset = make_case(1, poses=40, held_out=1).dataset
    with pytest.raises(DatasetError, match="free target") as refused:
        gtpin.calibrate(replace(dataset, instrument=InstrumentSection(target="free")))
    assert refused.value.hint is not None
    assert '"free"' not in refused.value.hint  # no advice that is refused too


@pytest.mark.parametrize("effect", ["link_compliance", "thermal_links"])
def test_where_the_target_sits_changes_what_is_seen_of_the_last_link_and_not_how_it_moves(effect: str) -> None:
    """The motion of the target is that of the TCP, carried along by the lever between them."""
    site = moving_links(ROBOT)[-1].name
    nominal = gtpin.Geometry.nominal(ROBOT)
    place = pin.SE3(pin.exp3(np.array([0.9, -1.4, 0.6])), np.array([0.08, -0.15, 0.11]))
    twist = pin.log6(place).vector
    values = [twist[p.component] if p.kind == "platform" else 0.0 for p in nominal.parameters]
    q = FOLDED + np.random.default_rng(2).uniform(-0.8, 0.8, (8, 6))
    known = {"payload": np.linspace(0.0, 4.0, 8), "temp_link": np.linspace(20.0, 26.0, 8)}
    seen = []
    for geometry in (nominal, nominal.with_values(np.array(values))):
        kinematics = gtpin.Model(geometry).kinematics
        at = OperatingPoints(kinematics, q, kinematics.forward(q), known)
        seen.append(effects_by_id()[effect].basis(at, site).displacement(at))
    R = gtpin.Model(nominal).predict(q).R
    lever = np.einsum("nij,j->ni", R, place.translation)
    carried = seen[0].copy()
    carried[:, :3] += np.cross(seen[0][:, 3:], lever[:, :, None], axisa=1, axisb=1, axisc=1)
    cores = [0, 1] if effect == "link_compliance" else [0]  # modulations count on the loads' spread at the target
    np.testing.assert_allclose(seen[1][..., cores], carried[..., cores], rtol=0, atol=1e-9 * np.abs(carried).max())
    assert np.abs(carried).max() > 0.0


ORDERS = {"xyzw": [1, 2, 3, 0], "wzyx": [0, 3, 2, 1]}
"""Orders that no frame and target make up for, and the columns w, x, y, z that stand in each."""
TURNER = """<robot name="turner"><link name="base"/><link name="arm"/><joint name="turn" type="revolute">
<parent link="base"/><child link="arm"/><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint><link name="tool0"/><joint name="tool" type="fixed">
<parent link="arm"/><child link="tool0"/><origin xyz="0.4 0 0.1" rpy="0.5 0.1 -0.4"/></joint></robot>"""


TURNING = gtpin.Robot(RobotDescription.parse(TURNER, "turner"))
FIVE_BAR = gtpin.load_robot(Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf")
SLIDES = "".join(
    f"""<link name="carriage_{axis}"/><joint name="slide_{axis}" type="prismatic"><parent link="{before}"/>
<child link="carriage_{axis}"/><origin xyz="0.1 0.05 0.2" rpy="0.1 0.2 0.3"/><axis xyz="{way}"/>
<limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>"""
    for before, axis, way in (("base", "x", "1 0 0"), ("carriage_x", "y", "0 1 0"), ("carriage_y", "z", "0 0 1"))
)
GANTRY = gtpin.Robot(RobotDescription.parse(f'<robot name="gantry"><link name="base"/>{SLIDES}</robot>', "gantry"))
COUNT, TURNS = 60, 5e-5


def measured(
    robot: gtpin.Robot,
    seed: int,
    *,
    at: tuple[float, float, float] = (0.06, -0.03, 0.09),
    still: int = 0,
    off: float = 1.0,
    reach: float = 0.4,
    frame: Literal["robot", "free"] = "free",
) -> Dataset:
    """Poses of a machine that is off by so many tolerances, half for a check, whose target sits at ``at`` turned anyhow.

    The last ``still`` joints do not move. With ``frame="free"`` the instrument stands anywhere.
    """
    rng = np.random.default_rng(seed)
    nominal = gtpin.Geometry.nominal(robot)
    wrong = off * np.array([p.kind != "platform" for p in nominal.parameters]) * rng.standard_normal(len(nominal.names))
    q = rng.uniform(-reach, reach, (2 * COUNT, robot.n_actuators)) + (FOLDED if robot is ROBOT else 0.0)
    if still:
        q[:, -still:] = q[0, -still:]
    plain = gtpin.Model(nominal.with_values(nominal.values + wrong * nominal.tolerance)).predict(q)
    X = pin.SE3(pin.exp3(2.0 * rng.standard_normal(3)), np.array(at))
    F = pin.SE3(pin.exp3(2.0 * rng.standard_normal(3)), 3.0 * rng.standard_normal(3))
    F = F if frame == "free" else pin.SE3.Identity()
    noise = [pin.exp6(np.repeat([NOISE, TURNS], 3) * rng.standard_normal(6)) for _ in q]
    seen = [F * pin.SE3(R, T) * X * off for T, R, off in zip(plain.T, plain.R, noise, strict=True)]
    return Dataset(
        robot=robot.name,
        pose=np.arange(len(q)),
        q=q,
        position=np.array([M.translation for M in seen]),
        orientation=np.array([np.roll(pin.Quaternion(M.rotation).coeffs(), 1) for M in seen]),
        instrument=InstrumentSection(position_sigma=NOISE, orientation_sigma=TURNS, frame=frame, target="free"),
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:these poses do not determine where the target")
@pytest.mark.parametrize("frame", ["robot", "free"])
@pytest.mark.parametrize("robot", [ROBOT, TURNING], ids=["ur5", "one joint"])
@pytest.mark.study
def test_the_order_of_quaternions_is_recognised_with_a_free_target(
    robot: gtpin.Robot, frame: Literal["robot", "free"]
) -> None:
    data = measured(robot, 6, off=0.0, reach=1.5, frame=frame)
    for order, columns in ORDERS.items():
        words = "looks like xyzw quaternions, as if" if order == "xyzw" else "qx qy qz look to be along other axes"
        with pytest.raises(DatasetError, match=words) as refused:
            gtpin.calibrate(replace(data, orientation=data.orientation[:, columns]), robot)
        assert refused.value.column == "qw qx qy qz"
    about_one_axis = frame == "free" and robot is not ROBOT  # then the place along it and around it is not determined
    with pytest.warns(GtpinWarning, match="do not determine where the target") if about_one_axis else nullcontext():
        as_named = gtpin.calibrate(data, robot)
    assert as_named.chi2_per_dof < 2.0


def mirrored(data: Dataset) -> Dataset:
    """Poses in a left-handed frame."""
    return replace(data, position=data.position * [1, -1, 1], orientation=data.orientation * [1, -1, 1, -1])


def in_feet(data: Dataset) -> Dataset:
    return replace(data, position=data.position / 0.3048, orientation=None)


def reversed_commands(data: Dataset) -> Dataset:
    return replace(data, q=-data.q)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (mirrored, "z looks reversed, and qx qy qz look to be so too"),
        (in_feet, "x y z look like feet; multiply x, y and z by 0.3048"),
        (reversed_commands, "q1 q2 q3 q4 q5 q6 look reversed"),
    ],
)
def test_with_frame_and_target_free_a_mistake_is_refused_by_its_name(
    spoil: Callable[[Dataset], Dataset], words: str
) -> None:
    data = measured(ROBOT, 6, reach=1.5)
    assert gtpin.calibrate(data, ROBOT).chi2_per_dof < 2.0
    with pytest.raises(DatasetError) as refused:
        gtpin.calibrate(spoil(data), ROBOT)
    assert words in str(refused.value)


@pytest.mark.parametrize(("far", "refused"), [(0.3, True), (0.02, False)])
def test_a_geometry_is_refused_whose_link_stands_elsewhere_by_a_tenth_of_the_workspace(
    far: float, refused: bool
) -> None:
    data, nominal = measured(ROBOT, 6), gtpin.Geometry.nominal(ROBOT)
    name = "placement[elbow_joint].x"
    moved = nominal.with_values(nominal.values + far * np.array([one == name for one in nominal.names]))
    near = gtpin.Model(nominal).predict(data.q)
    with (
        pytest.raises(DatasetError, match=r"moves placement\[elbow_joint\].x by \+300 mm") if refused else nullcontext()
    ):
        check_moved(data, moved, nominal, near, None)
    check_moved(data, moved, nominal, near, np.ones(len(nominal.names), dtype=bool))  # a free target


@pytest.mark.parametrize("target", ["tcp", "free"])
@pytest.mark.parametrize("joints", [5, 7])
def test_another_number_of_commands_than_of_joints_is_refused_by_name(
    joints: int, target: Literal["tcp", "free"]
) -> None:
    dataset = measured(ROBOT, 6, off=0.0)
    q = np.hstack([dataset.q, dataset.q])[:, :joints]
    instrument = dataset.instrument.model_copy(update={"target": target})
    for run in (gtpin.calibrate, gtpin.diagnose):
        with pytest.raises(DatasetError, match=rf"{joints} commands a pose, but ur5 has 6 actuators"):
            run(replace(dataset, q=q, instrument=instrument), ROBOT)


KINDS = {
    "five-bar": (FIVE_BAR, 0, r"along \(0, -?1, 0\) of the TCP's frame"),
    "gantry": (GANTRY, 0, "where the target sits on the platform, for the robot does not turn it"),
    "wrist still": (ROBOT, 3, None),
    "all joints": (ROBOT, 0, None),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_left_out_poses_are_predicted_to_the_noise_and_what_is_assumed_is_said(
    kind: str, seed: int, turned: bool
) -> None:
    robot, still, words = KINDS[kind]
    data = measured(robot, seed, still=still)
    if not turned:
        data = replace(data, orientation=None)
    found = gtpin.calibrate(data.take(slice(0, COUNT)), robot)
    said = [text for text in found.warnings if "where the target sits" in text]
    assert len(said) == (words is not None)
    assert words is None or re.search(words, said[0])
    off = found.model.predict(data.q[COUNT:]).T - data.position[COUNT:]
    # Sixty poses of three or six readings determine some 20 to 30 numbers.
    assert np.sqrt((off**2).mean()) < 1.6 * NOISE


def test_along_the_common_axis_the_target_stays_at_the_tcp() -> None:
    data = measured(FIVE_BAR, 3, at=(0.06, -0.25, 0.09))
    plain = gtpin.Model(gtpin.Geometry.nominal(FIVE_BAR)).predict(data.q)
    R = np.array([pin.Quaternion(*row).matrix() for row in data.orientation])
    found = frame_and_target(plain, data.position, R)
    np.testing.assert_allclose(np.abs(found.unseen), [[0.0, 1.0, 0.0]], atol=1e-3)
    assert abs(found.at[1]) < 1e-3
    np.testing.assert_allclose(found.at[[0, 2]], [0.06, 0.09], atol=5e-3)
    seen = found.moved(plain)
    assert np.median(np.linalg.norm(seen.T - data.position, axis=1)) < 2e-3


def test_of_a_robot_that_does_not_turn_the_frame_takes_up_the_whole_target() -> None:
    data = measured(GANTRY, 4)
    plain = gtpin.Model(gtpin.Geometry.nominal(GANTRY)).predict(data.q)
    found = frame_and_target(plain, data.position, None)
    assert found.unseen.shape == (3, 3)
    assert np.linalg.norm(found.at) < 1e-3


@pytest.mark.parametrize("target", ["free", "tcp"])
def test_displacements_are_said_to_be_of_the_target_where_its_place_is_free(target: Literal["free", "tcp"]) -> None:
    """They differ from those of the tool: a zero of the last wrist joint moves what sits aside from its axis more."""
    rng = np.random.default_rng(3)
    q, off = FOLDED + rng.uniform(-0.8, 0.8, (60, 6)), np.deg2rad([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    seen = gtpin.Model(gtpin.Geometry.nominal(ROBOT)).predict(q + off)
    turned = [pin.exp3(1e-4 * rng.standard_normal(3)) @ R for R in seen.R]
    wxyz = np.array([pin.Quaternion(R).coeffs()[[3, 0, 1, 2]] for R in turned])
    section = InstrumentSection(position_sigma=NOISE, orientation_sigma=1e-4, frame="free", target=target)
    T = seen.T + NOISE * rng.standard_normal(seen.T.shape)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        found = gtpin.calibrate(Dataset("ur5", [str(i) for i in range(60)], q, T, wxyz, instrument=section))
    lead = present(found).lead
    point = "target" if target == "free" else "TCP"
    assert f"at the {point}" in lead.headline
    assert f"at the {point}, RMS" in lead.content[0].head
    assert ("the frame and the target" in str(lead.numbers)) is (target == "free")
