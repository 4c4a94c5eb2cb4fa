"""Every format that gtpin writes and reads comes back as the same robot: poses, loads on the drives, ranges, and masses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from drawn_machines import without_scales
from quick_first import quick_first
from with_effects import OF_GANTRY, active

import gtpin
from gtpin.errors import GtpinWarning
from gtpin.export import export
from gtpin.kinematics.first_guess import halton
from gtpin.robot.description import RobotDescription

LINK = (
    '<link name="{0}"><inertial><origin xyz="0.1 0 0.02"/><mass value="{1}"/>'
    '<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0.001" iyz="0"/></inertial></link>'
)
HINGE = (
    '<joint name="{0}" type="{4}"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}" rpy="0.1 0.2 0.3"/>'
    '<axis xyz="0 1 1"/><limit lower="-0.6" upper="0.5" effort="1" velocity="1"/>{5}</joint>'
)
TREE = (
    '<robot name="tree"><link name="world"/>'
    + "".join(LINK.format(name, 1.0 + i / 7.0) for i, name in enumerate("abcde"))
    + '<link name="eye"/>'
    + HINGE.format("first", "world", "a", "0 0 0.2", "revolute", "")
    + HINGE.format("second", "a", "b", "0.2 0 0", "continuous", "")
    + HINGE.format("side", "world", "d", "0.5 0 0", "prismatic", "")
    + HINGE.format("third", "b", "c", "0.2 0.1 0", "prismatic", "")
    + HINGE.format("follower", "d", "e", "0.2 0.1 0", "revolute", '<mimic joint="third" multiplier="-2" offset="0.1"/>')
    + '<joint name="fixed" type="fixed"><parent link="b"/><child link="eye"/><origin xyz="0 0 0.3" rpy="0 1 0"/></joint>'
    "</robot>"
)
"""A tree whose joints are not in the order of its branches, with a follower on another branch, and two links for a TCP."""
FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"

ROBOTS = (
    "tree",
    "tree by another TCP",
    "five-bar",
    "panda",
    "stewart",
    *sorted({*gtpin.robot_names(), "ur5"} - {"stewart"}),
)
FORMATS = {".urdf": ".urdf", ".xml": ".xml", ".yaml": ".urdf"}
"""Suffix to write, and the suffix of the file that describes the robot."""


@cache
def drawn(name: str) -> gtpin.Model:
    """A robot whose geometry deviates from nominal by half its tolerances; a format has no place for drive scales."""
    if name.startswith("tree"):
        robot = gtpin.Robot(RobotDescription.parse(TREE), "eye" if "TCP" in name else "e")
    elif name == "five-bar":
        robot = gtpin.load_robot(FIVE_BAR)
    elif name == "panda":
        arm = [f"panda_joint{i}" for i in (2, 1, 3, 4, 5, 6, 7)]
        robot = gtpin.load_robot(name, tcp="panda_hand_tcp", actuators=arm)
    else:
        robot = gtpin.load_robot(name)
    geometry = gtpin.Geometry.nominal(robot)
    some = np.random.default_rng(5).uniform(-0.5, 0.5, len(geometry.names)) * geometry.tolerance
    return without_scales(gtpin.Model(geometry.with_values(geometry.values + some)))


def commands(robot: gtpin.Robot, n: int) -> np.ndarray:
    """Commands about home, over a fifth of the ranges."""
    low, high = (np.where(np.isfinite(x), x, y) for x, y in ((robot.lower, -3.0), (robot.upper, 3.0)))
    return robot.home_q + 0.2 * (halton(robot.n_actuators, n) - 0.5) * (high - low)


@pytest.mark.filterwarnings("ignore:.*left out", "ignore:.*does not hold", "ignore:.*does not move with")
@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("name", quick_first(ROBOTS, 5))
def test_what_is_written_and_read_is_the_same_robot(name: str, suffix: str, tmp_path: Path) -> None:
    model = drawn(name)
    if suffix == ".yaml" and not model.robot.constraints:
        pytest.skip("this format is for robots with loops")
    export(model, tmp_path / f"robot{suffix}")
    again = gtpin.read_model(tmp_path / f"robot{FORMATS[suffix]}")  # a TCP that is guessed would warn
    q = commands(model.robot, 8)
    # MJCF has no place for the gap of a loop across its plane, 1e-4 m here: it turns the TCP by some 1e-9 rad.
    most = 1e-8 if (name, suffix) == ("five-bar", ".xml") else 1e-9
    assert np.abs(again.predict(q).minus(model.predict(q))).max() < most
    mass, mass_again = (sum(i.mass for i in one.robot.model.inertias) for one in (model, again))
    assert mass_again == pytest.approx(mass, rel=1e-9)
    np.testing.assert_allclose(again.robot.lower, model.robot.lower, rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.robot.upper, model.robot.upper, rtol=0, atol=1e-9)
    np.testing.assert_allclose(again.robot.description.gravity, model.robot.description.gravity, rtol=0, atol=1e-12)
    there = gtpin.load_robot(written(model, tmp_path), tcp=model.robot.tcp_frame)
    for one in q[:3]:
        held, held_again = (
            gtpin.static_forces(gtpin.home(robot).moved_to(one)).actuators for robot in (there, again.robot)
        )
        np.testing.assert_allclose(held_again, held, rtol=1e-6, atol=1e-6)


def written(model: gtpin.Model, folder: Path) -> Path:
    """The robot with the model's geometry, as a calibration writes it."""
    gtpin.write_model(model, folder / "model")
    return folder / "model" / "robot.urdf"


EFFECTS = [
    ("ur5", "backlash", "elbow_joint", 1e-4),
    ("ur5", "linearity", "elbow_joint", 1e-4),
    ("ur5", "encoder_scale", "elbow_joint", 1e-4),
    ("ur5", "joint_compliance", "elbow_joint", 3e-6),
    ("ur5", "bearing_compliance", "shoulder_pan_joint", 1e-5),
    ("ur5", "link_compliance", "arm", 2e-6),
    *OF_GANTRY,
]
"""Each effect that MJCF holds: robot, effect, site, its first coefficient."""


@pytest.mark.filterwarnings("ignore:.*left out", "ignore:.*to within", "ignore:.*does not hold")
@pytest.mark.parametrize(("name", "effect", "site", "first"), EFFECTS)
def test_a_file_with_effects_is_read_as_its_geometry_and_says_what_it_leaves_out(
    name: str, effect: str, site: str, first: float, tmp_path: Path
) -> None:
    plain = gtpin.read_model(name)
    q = commands(plain.robot, 20)
    came = {f"approach{i + 1}": np.resize([1.0, -1.0, -1.0], len(q)) for i in range(plain.robot.n_actuators)}
    own = active(plain, q, effect, site, covariates=came, drawn=lambda sigma: first * sigma / sigma[0])
    export(replace(plain, effects=(own,)), tmp_path / "robot.xml")
    with pytest.warns(GtpinWarning, match="is read without drive scales and effects: "):
        again = gtpin.read_model(tmp_path / "robot.xml")
    assert np.abs(again.predict(q).minus(plain.predict(q))).max() < 1e-9
    np.testing.assert_allclose(again.robot.lower, plain.robot.lower, rtol=0, atol=1e-12)
    np.testing.assert_allclose(again.robot.upper, plain.robot.upper, rtol=0, atol=1e-12)
