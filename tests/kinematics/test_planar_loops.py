"""LoopClosure that are no rods: five-bar and parallelogram, from simulation to an exported URDF."""

from pathlib import Path

import numpy as np
import pytest
from urdfs import joint, loop, own, robot_of

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription


def hinge(name: str, parent: str, child: str, xyz: str, axis: str, yaw: float = 0.0, kind: str = "revolute") -> str:
    return joint(name, parent, child, xyz, axis, kind=kind, rpy=f"0 0 {yaw}", limit=0.6)


def five_bar() -> gtpin.Robot:
    return robot_of(
        "five_bar",
        hinge("drive1", "base", "left", "-0.1 0 0", "0 0 1", 2.2),
        hinge("elbow1", "left", "left_far", "0.2 0 0", "0 0 1", -1.44),
        hinge("drive2", "base", "right", "0.1 0 0", "0 0 1", 0.94),
        hinge("elbow2", "right", "right_far", "0.2 0 0", "0 0 1", 1.44),
        loop("left_far", "0.3 0 0", "right_far", "0.3 0 0"),
        own(["drive1", "drive2"], "left_far"),
    )


def parallelogram() -> gtpin.Robot:
    """A column that turns; on it a parallelogram that keeps its plate level; on the plate an elbow."""
    return robot_of(
        "parallelogram",
        hinge("waist", "base", "column", "0 0 0", "0 0 1"),
        hinge("shoulder", "column", "crank", "0.1 0 0.3", "0 1 0"),
        hinge("follow", "column", "rocker", "-0.1 0 0.3", "0 1 0"),
        hinge("top", "crank", "plate", "0 0 0.5", "0 1 0"),
        hinge("elbow", "plate", "wrist", "0.1 0 0.1", "0 1 0"),
        joint("flange", "wrist", "tool0", "0.4 0 0", kind="fixed"),
        loop("plate", "-0.2 0 0", "rocker", "0 0 0.5"),
        own(["waist", "shoulder", "elbow"]),
    )


ROBOTS = {"five_bar": five_bar, "parallelogram": parallelogram}


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> gtpin.Robot:
    return ROBOTS[request.param]()


def test_the_plate_of_a_parallelogram_stays_level() -> None:
    for q in np.random.default_rng(1).uniform(-0.5, 0.5, (5, 3)):
        waist, shoulder, elbow = q
        at = gtpin.home(parallelogram()).moved_to(q)
        out = 0.1 + 0.5 * np.sin(shoulder) + 0.1 + 0.4 * np.cos(elbow)
        up = 0.3 + 0.5 * np.cos(shoulder) + 0.1 - 0.4 * np.sin(elbow)
        np.testing.assert_allclose(at.T, [out * np.cos(waist), out * np.sin(waist), up], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_it_is_simulated_calibrated_and_its_urdf_read_again(robot: gtpin.Robot, tmp_path: Path) -> None:
    """Chi-square of some 400 freedoms lies within 30 % of 1 but for 1 in 10,000 draws (sd sqrt(2 / 400) = 7 %)."""
    made = simulate(robot, robot.name, poses=70, seed=4)
    found = gtpin.calibrate(made.dataset, robot)
    assert 0.7 < found.chi2_per_dof < 1.3
    truth = found.model.predict(made.commands.q).minus(made.truth)[:, :3]
    assert np.sqrt((truth**2).mean()) < 1.5e-5  # less than one measurement's noise, by 70 of them
    gtpin.write_model(found.model, tmp_path)
    again = gtpin.read_model(tmp_path / "robot.urdf")
    assert np.abs(again.predict(made.commands.q).minus(found.model.predict(made.commands.q))).max() < 1e-9


@pytest.mark.parametrize(
    "plane", ['loop="other" normal="0 0 1"', 'loop="pin" normal="0 0 0"', 'loop="pin"', 'normal="0 0 1"']
)
def test_a_plane_of_no_loop_or_no_direction_is_refused(plane: str) -> None:
    text = five_bar().description.xml.replace("<gtpin>", f"<gtpin><plane {plane}/>")
    with pytest.raises(RobotError) as caught:
        RobotDescription.parse(text)
    assert caught.value.hint
