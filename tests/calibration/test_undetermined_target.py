"""What poses can't determine of a free frame and a free target is fixed by convention, and a warning says so."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.data import Dataset, Instrument
from gtpin.errors import GtpinWarning
from gtpin.kinematics.frame_and_target import frame_and_target
from gtpin.robot.description import RobotDescription

FIVE_BAR = gtpin.load_robot(Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf")
UR5 = gtpin.load_robot("ur5")
SLIDES = "".join(
    f"""<link name="carriage_{axis}"/><joint name="slide_{axis}" type="prismatic"><parent link="{before}"/>
<child link="carriage_{axis}"/><origin xyz="0.1 0.05 0.2" rpy="0.1 0.2 0.3"/><axis xyz="{way}"/>
<limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>"""
    for before, axis, way in (("base", "x", "1 0 0"), ("carriage_x", "y", "0 1 0"), ("carriage_y", "z", "0 0 1"))
)
GANTRY = gtpin.Robot(RobotDescription.parse(f'<robot name="gantry"><link name="base"/>{SLIDES}</robot>', "gantry"))
COUNT, NOISE, TURNS = 60, 2e-5, 5e-5


def commands(robot: gtpin.Robot, rng: np.random.Generator, still: int = 0) -> np.ndarray:
    """Commands all over a part of the joints' travel; the last ``still`` joints do not move."""
    q = rng.uniform(-0.4, 0.4, (2 * COUNT, robot.n_actuators))
    if robot is UR5:
        q += [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]
    if still:
        q[:, -still:] = q[0, -still:]
    return q


def measured(robot: gtpin.Robot, seed: int, *, at: tuple[float, float, float], still: int = 0) -> Dataset:
    """Poses of a machine with errors, whose target sits at ``at`` turned anyhow, seen from anywhere; half are for a check."""
    rng = np.random.default_rng(seed)
    geometry = gtpin.Geometry.nominal(robot)
    off = np.array([p.kind != "platform" for p in geometry.parameters]) * rng.standard_normal(len(geometry.names))
    machine = gtpin.Model(geometry.with_values(geometry.values + off * geometry.tolerance))
    q = commands(robot, rng, still)
    plain = machine.predict(q)
    X = pin.SE3(pin.exp3(2.0 * rng.standard_normal(3)), np.array(at))
    F = pin.SE3(pin.exp3(2.0 * rng.standard_normal(3)), 3.0 * rng.standard_normal(3))
    noise = [pin.exp6(np.repeat([NOISE, TURNS], 3) * rng.standard_normal(6)) for _ in q]
    seen = [F * pin.SE3(R, T) * X * off for T, R, off in zip(plain.T, plain.R, noise, strict=True)]
    return Dataset(
        robot=robot.name,
        pose=np.arange(len(q)),
        q=q,
        position=np.array([M.translation for M in seen]),
        orientation=np.array([np.roll(pin.Quaternion(M.rotation).coeffs(), 1) for M in seen]),
        instrument=Instrument(position_sigma=NOISE, orientation_sigma=TURNS, frame="free", target="free"),
    )


KINDS = {
    "five-bar": (FIVE_BAR, 0, r"along \(0, -?1, 0\) of the TCP's frame"),
    "gantry": (GANTRY, 0, "where the target sits on the platform, for the robot does not turn it"),
    "wrist still": (UR5, 3, None),
    "all joints": (UR5, 0, None),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("turned", [True, False])
def test_left_out_poses_are_predicted_to_the_noise_and_what_is_assumed_is_said(
    kind: str, seed: int, turned: bool
) -> None:
    robot, still, words = KINDS[kind]
    data = measured(robot, seed, at=(0.06, -0.03, 0.09), still=still)
    if not turned:
        data = replace(data, orientation=None)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        found = gtpin.calibrate(data.take(slice(0, COUNT)), robot)
    said = [str(w.message) for w in heard if "where the target sits" in str(w.message)]
    assert len(said) == (words is not None)
    if words is not None:
        with pytest.warns(GtpinWarning, match=words):
            warnings.warn(said[0], GtpinWarning, stacklevel=1)
        assert said[0] in found.warnings
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
    data = measured(GANTRY, 4, at=(0.06, -0.03, 0.09))
    plain = gtpin.Model(gtpin.Geometry.nominal(GANTRY)).predict(data.q)
    found = frame_and_target(plain, data.position, None)
    assert found.unseen.shape == (3, 3)
    assert np.linalg.norm(found.at) < 1e-3
