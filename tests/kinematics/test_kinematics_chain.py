"""Open chains: how the TCP answers to displaced joints, and what joints carry, against finite differences of Pinocchio."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import gtpin
from gtpin.kinematics.bodies import bodies
from gtpin.kinematics.statics import joint_loads
from gtpin.robot.chain import joint_axis

ARM = gtpin.load_robot(Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf")
Q = np.random.default_rng(0).uniform(-1.2, 1.2, (4, 6))
STEP = 1e-6


def tcp(model: pin.Model, q: np.ndarray, tool: pin.SE3) -> pin.SE3:
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return data.oMi[ARM.tcp_joint] * tool


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
