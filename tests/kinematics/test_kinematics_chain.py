"""Open chains: how the TCP answers to displaced joints, and what joints carry, against finite differences of Pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.kinematics.bodies import bodies, configurations
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.statics import joint_loads
from gtpin.robot.chain import joint_axis

ARM = gtpin.load_robot(Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf")
Q = np.random.default_rng(0).uniform(-1.2, 1.2, (4, 6))
STEP = 1e-6


def tcp(model: pin.Model, q: np.ndarray, tool: pin.SE3) -> pin.SE3:
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return data.oMi[ARM.tcp_joint] * tool


def motion(one: pin.SE3, other: pin.SE3) -> np.ndarray:
    """(6,) shift and rotation vector, base frame."""
    return np.concatenate([other.translation - one.translation, pin.log3(other.rotation @ one.rotation.T)])


@pytest.mark.parametrize("index", range(ARM.model.njoints))
@pytest.mark.parametrize("way", range(6))
def test_the_response_is_the_derivative_of_pinocchios_placements(index: int, way: int) -> None:
    found = bodies(ARM, Q).response[:, :, index, way]
    step = np.zeros(6)
    step[way] = STEP
    for i, configuration in enumerate(configurations(ARM, Q)):
        ends = []
        for sign in (-1.0, 1.0):
            model, tool = ARM.model.copy(), ARM.tcp_placement
            if index == ARM.model.njoints - 1:
                tool = tool * pin.exp6(sign * step)
            else:
                model.jointPlacements[index + 1] = model.jointPlacements[index + 1] * pin.exp6(sign * step)
            ends.append(tcp(model, configuration, tool))
        np.testing.assert_allclose(found[i], motion(*ends) / (2.0 * STEP), rtol=0, atol=1e-9)


def test_joints_are_where_pinocchio_puts_them() -> None:
    at = bodies(ARM, Q)
    for i, configuration in enumerate(configurations(ARM, Q)):
        there = tcp(ARM.model, configuration, ARM.tcp_placement)
        np.testing.assert_allclose(at.T[i, -1], there.translation, rtol=0, atol=1e-15)
        np.testing.assert_allclose(at.R[i, -1], there.rotation, rtol=0, atol=1e-15)


def energy(q: np.ndarray, payload: float, force: np.ndarray) -> float:
    """Potential energy of links, payload and a constant force, J."""
    data = ARM.model.createData()
    own = pin.computePotentialEnergy(ARM.model, data, q)
    T = tcp(ARM.model, q, ARM.tcp_placement).translation
    return float(own - payload * ARM.model.gravity.linear @ T - force @ T)


def test_what_a_joint_carries_about_its_axis_is_how_the_energy_falls() -> None:
    rng = np.random.default_rng(1)
    payload, force = rng.uniform(0.0, 5.0, len(Q)), 40.0 * rng.standard_normal((len(Q), 3))
    loads = joint_loads(ARM, Q, force, payload)
    for i, q in enumerate(Q):
        for j, actuator in enumerate(ARM.actuators):
            step = np.zeros(6)
            step[j] = 1e-4
            fall = (energy(q - step, payload[i], force[i]) - energy(q + step, payload[i], force[i])) / 2e-4
            carried = loads[i, actuator.joint_id - 1] @ joint_axis(ARM.model, actuator.joint_id)
            np.testing.assert_allclose(carried, fall, rtol=0, atol=1e-5)


def test_the_first_joint_carries_the_whole_weight() -> None:
    loads = joint_loads(ARM, Q, payload=np.full(len(Q), 3.0))
    weight = (sum(inertia.mass for inertia in ARM.model.inertias[1:]) + 3.0) * 9.81
    np.testing.assert_allclose(loads[:, 0, :3], np.tile([0.0, 0.0, -weight], (len(Q), 1)), rtol=0, atol=1e-9)


def test_the_tcp_carries_the_payload_and_the_force_in_its_own_axes() -> None:
    force = np.tile([10.0, -20.0, 5.0], (len(Q), 1))
    found, at = joint_loads(ARM, Q, force, np.full(len(Q), 2.0))[:, -1], bodies(ARM, Q)
    wanted = np.einsum("nji,nj->ni", at.R[:, -1], force + np.array([0.0, 0.0, -2.0 * 9.81]))
    np.testing.assert_allclose(found[:, :3], wanted, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(found[:, 3:], 0.0)


def test_the_jacobian_by_placements_and_tool_is_the_derivative_of_the_pose() -> None:
    nominal = gtpin.Geometry.nominal(ARM)
    rng = np.random.default_rng(2)
    geometry = nominal.with_values(nominal.values + 1e-2 * rng.standard_normal(len(nominal.values)))
    assert {f"platform.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")} <= set(geometry.names)
    kinematics = ChainKinematics(geometry)
    found = kinematics.geometry_jacobian(Q, kinematics.forward(Q))
    for column, name in enumerate(geometry.names):
        ends = []
        for sign in (-1.0, 1.0):
            values = geometry.values.copy()
            values[column] += sign * STEP
            ends.append(ChainKinematics(geometry.with_values(values)).forward(Q))
        slope = ends[1].minus(ends[0]) / (2.0 * STEP)
        np.testing.assert_allclose(found[:, :, column], slope, rtol=0, atol=1e-8, err_msg=name)


def test_commands_of_the_derivative_are_the_joints_own() -> None:
    kinematics = ChainKinematics(gtpin.Geometry.nominal(ARM))
    found = kinematics.command_jacobian(Q, kinematics.forward(Q))
    for j in range(6):
        step = np.zeros(6)
        step[j] = STEP
        slope = kinematics.forward(Q + step).minus(kinematics.forward(Q - step)) / (2.0 * STEP)
        np.testing.assert_allclose(found[:, :, j], slope, rtol=0, atol=1e-9)
