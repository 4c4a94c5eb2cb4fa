"""A robot from a ``pinocchio.Model`` and its constraint models, without a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.errors import GtpinError

NEAR, FAR, HALF, TOOL = 0.3, 0.4, 0.1, 0.45
"""Links, half the distance of the drives, and the tool on the left far link of a five-bar, m."""
START = np.array([2.2, np.pi - 2.2])


def five_bar(q: np.ndarray) -> np.ndarray:
    """(N, 3) the tool in closed form, with the elbows outside."""
    angle = START + q
    elbows = [[-HALF, 0.0], [HALF, 0.0]] + NEAR * np.stack([np.cos(angle), np.sin(angle)], axis=2)
    way = elbows[:, 1] - elbows[:, 0]
    apart = np.linalg.norm(way, axis=1, keepdims=True)
    up = np.stack([-way[:, 1], way[:, 0]], axis=1) / apart
    link = (way / 2.0 + np.sqrt(FAR**2 - apart**2 / 4.0) * up) / FAR
    at = elbows[:, 0] + TOOL * link
    return np.stack([at[:, 0], np.zeros(len(q)), at[:, 1]], axis=1)


def built(*, below: bool = False) -> tuple[pin.Model, pin.RigidConstraintModel]:
    """The five-bar in the plane x z, and its closure; ``below``: its reference configuration is of the other assembly."""
    model, joints, angles = pin.Model(), [], []
    model.name = "five_bar"
    axis = np.array([0.0, -1.0, 0.0])  # positive angles turn x to z
    for side, x in (("left", -HALF), ("right", HALF)):
        base = pin.SE3(pin.exp3(START[len(angles)] * axis), np.array([x, 0.0, 0.0]))
        near = model.addJoint(0, pin.JointModelRevoluteUnaligned(*axis), base, f"{side}_drive")
        far = model.addJoint(near, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([NEAR, 0.0, 0.0])), f"{side}_elbow")
        model.addFrame(pin.Frame(f"{side}_arm", near, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        model.appendBodyToJoint(near, pin.Inertia(1.0, np.array([0.1, 0.0, 0.0]), 0.01 * np.eye(3)), pin.SE3.Identity())
        joints.append(far)
        elbow = np.array([x, 0.0]) + NEAR * np.array([np.cos(START[len(angles)]), np.sin(START[len(angles)])])
        way = np.array([0.0, np.sqrt(FAR**2 - elbow[0] ** 2) * (-1.0 if below else 1.0)]) - [elbow[0], 0.0]
        angles.append(START[len(angles)] - np.arctan2(way[1], way[0]))  # RY turns the other way
    model.addFrame(
        pin.Frame("tool", joints[0], 0, pin.SE3(np.eye(3), np.array([TOOL, 0.0, 0.0])), pin.FrameType.OP_FRAME)
    )
    model.referenceConfigurations["up"] = np.array([0.0, angles[0], 0.0, angles[1]])
    end = pin.SE3(np.eye(3), np.array([FAR, 0.0, 0.0]))
    return model, pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, joints[0], end, joints[1], end)


def loaded(*, below: bool = False) -> gtpin.Robot:
    model, closure = built(below=below)
    drives = ["left_drive", "right_drive"]
    return gtpin.load_robot(model, tcp="tool", actuators=drives, home="up", constraints=[closure])


def test_a_model_built_by_hand_moves_as_its_closed_form() -> None:
    q, robot = np.random.default_rng(0).uniform(-0.5, 0.5, (50, 2)), loaded()
    np.testing.assert_allclose(robot.forward(q).T, five_bar(q), rtol=0, atol=1e-12)
    assert robot.name == "five_bar"
    assert robot.sites == ("left_drive", "right_drive")
    assert np.isinf(robot.upper).all()


def test_a_reference_configuration_chooses_the_assembly() -> None:
    at = five_bar(np.zeros((1, 2)))[0]
    found = loaded(below=True).forward(np.zeros((1, 2))).T[0]
    elbow = np.array([-HALF, 0.0]) + NEAR * np.array([np.cos(START[0]), np.sin(START[0])])
    for one in (at, found):
        assert np.linalg.norm(one[[0, 2]] - elbow) == pytest.approx(TOOL)
    assert found[2] < elbow[1] < at[2]


def test_it_calibrates_and_is_read_again_from_disk(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    q = rng.uniform(-0.5, 0.5, (60, 2))
    shifted = q + np.array([2e-3, -1e-3])  # zeros of the drives
    measured = five_bar(shifted) + 2e-5 * rng.standard_normal((60, 3))
    dataset = gtpin.Dataset("five_bar", np.arange(60), q, measured, instrument={"position_sigma": 2e-5})
    found = gtpin.calibrate(dataset, loaded(), zeros=True)
    new = rng.uniform(-0.5, 0.5, (100, 2))
    off = found.model.predict(new).T - five_bar(new + np.array([2e-3, -1e-3]))
    assert np.sqrt((off**2).sum(axis=1).mean()) < 2e-5
    gtpin.write_model(found.model, tmp_path / "model")
    assert np.abs(gtpin.read_model(tmp_path / "model").predict(new).T - found.model.predict(new).T).max() == 0.0


@pytest.mark.parametrize("name", ["gantry_tau", "linear_delta", "ur5"])
def test_the_model_of_a_file_is_the_robot_of_this_file(name: str) -> None:
    robot = gtpin.load_robot(name)
    drives = [actuator.joint for actuator in robot.actuators]
    again = gtpin.load_robot(
        robot.model, tcp=robot.tcp_frame, actuators=drives, constraints=list(robot.constraint_models)
    )
    q = robot.home_q + np.random.default_rng(0).uniform(-0.1, 0.1, (10, robot.n_actuators))
    assert np.abs(again.forward(q).minus(robot.forward(q))).max() < 1e-12
    zero = np.zeros_like(q)
    held = [one.inverse_dynamics(q, zero, zero) for one in (robot, again)]
    np.testing.assert_allclose(held[0], held[1], rtol=0, atol=1e-9)
    assert (again.lower == robot.lower).all()


def spherical() -> pin.Model:
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    return model


def test_what_is_not_supported_is_said() -> None:
    model, closure = built()
    with pytest.raises(
        GtpinError, match=r"ball is a JointModelSpherical, which is not supported; joints of one degree"
    ):
        gtpin.load_robot(spherical())
    limit = pin.JointLimitConstraintModel(model, [1])
    with pytest.raises(GtpinError, match="constraint 2 is a JointLimitConstraintModel, which is not supported"):
        gtpin.load_robot(model, actuators=["left_drive", "right_drive"], constraints=[closure, limit])
    with pytest.raises(GtpinError, match="no reference configuration 'down'; there are up"):
        gtpin.load_robot(model, actuators=["left_drive", "right_drive"], home="down", constraints=[closure])
    with pytest.raises(GtpinError, match="constraints of a file"):
        gtpin.load_robot("ur5", constraints=[closure])
    with pytest.raises(GtpinError, match="loops but no actuators"):
        gtpin.load_robot(model, constraints=[closure])
