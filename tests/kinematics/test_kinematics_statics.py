"""Static forces: balanced by hand, and the gradient of the potential energy."""

import numpy as np
import pinocchio as pin
import pytest
from closures import Closures
from loaded_machines import drawn

import gtpin
from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.model.model_folder import calibrated_urdf
from gtpin.robot.description import RobotDescription

Floats = np.ndarray
FORCE, MOMENT, PAYLOAD = np.array([120.0, -80.0, 45.0]), np.array([4.0, 7.0, -5.0]), 6.5


def potential(posture: gtpin.ClosedPosture, payload: float = 0.0) -> float:
    """Energy of all masses in the field of gravity, J, by their centres."""
    model, data = posture.robot.model, posture.robot.data
    pin.forwardKinematics(model, data, posture.configuration)
    g = np.array(model.gravity.linear)
    bodies = zip(model.inertias[1:], list(data.oMi)[1:], strict=True)
    energy = -sum(inertia.mass * g @ place.act(inertia.lever) for inertia, place in bodies)
    return float(energy - payload * g @ posture.T)


def gradient(posture: gtpin.ClosedPosture, payload: float) -> Floats:
    """Derivative of the energy by the commands, by central differences of fourth order."""
    result = np.zeros(len(posture.q))
    for k in range(len(result)):
        for factor, weight in ((1.0, 4.0 / 3.0), (2.0, -1.0 / 3.0)):
            h = np.zeros(len(result))
            h[k] = factor * 1e-3
            rise = potential(posture.moved_to(posture.q + h), payload) - potential(
                posture.moved_to(posture.q - h), payload
            )
            result[k] += weight * rise / (2e-3 * factor)
    return result


def test_actuators_hold_the_gradient_of_the_potential_energy(machine: Closures, loaded: gtpin.Robot) -> None:
    for q in machine.commands(3, seed=1):
        posture = gtpin.home(loaded).moved_to(q)
        forces = gtpin.static_forces(posture, payload=PAYLOAD).actuators
        np.testing.assert_allclose(forces, gradient(posture, PAYLOAD), rtol=0, atol=1e-7 * np.abs(forces).max())


def test_a_load_on_the_tool_is_held_by_virtual_work(machine: Closures, loaded: gtpin.Robot) -> None:
    for q in machine.commands(3, seed=2):
        posture = gtpin.home(loaded).moved_to(q)
        added = gtpin.static_forces(posture, FORCE, MOMENT).actuators - gtpin.static_forces(posture).actuators
        # What the actuators do is what is done against the load.
        work = -posture.jacobian.T @ np.concatenate([FORCE, MOMENT])
        np.testing.assert_allclose(added, work, rtol=0, atol=1e-9 * np.abs(work).max())


def test_forces_and_moments_on_the_plate_and_the_rods_are_in_balance(machine: Closures, loaded: gtpin.Robot) -> None:
    g = np.array(loaded.model.gravity.linear)
    plate = loaded.model.inertias[loaded.tcp_joint]
    for q in machine.commands(5, seed=3):
        posture = gtpin.home(loaded).moved_to(q)
        forces = gtpin.static_forces(posture, FORCE, MOMENT, PAYLOAD)
        place = posture.placement(loaded.tcp_joint)
        C = machine.C(q[None])[0]
        # Plate and rods as one body: gravity, the load, and what the carriers do to the rods' ends.
        total, about_tcp = FORCE + PAYLOAD * g + plate.mass * g, MOMENT.copy()
        about_tcp += np.cross(place.act(plate.lever) - posture.T, plate.mass * g)
        for i, rod in enumerate(loaded.rods):
            on_rod = forces.loops[i] if rod.rod_end == 0 else -forces.loops[i]
            total += on_rod
            about_tcp += np.cross(C[i] - posture.T, on_rod)
        pin.forwardKinematics(loaded.model, loaded.data, posture.configuration)
        for joint in range(1, loaded.model.njoints):
            in_rod = loaded.tcp_joint in loaded.model.supports[joint] and joint != loaded.tcp_joint
            if in_rod:
                mass, at = (
                    loaded.model.inertias[joint].mass,
                    loaded.data.oMi[joint].act(loaded.model.inertias[joint].lever),
                )
                total += mass * g
                about_tcp += np.cross(at - posture.T, mass * g)
        scale = np.abs(forces.loops).max()
        np.testing.assert_allclose(total, 0.0, atol=1e-10 * scale)
        np.testing.assert_allclose(about_tcp, 0.0, atol=1e-10 * scale)


def test_rods_forces_in_arrays_are_pinocchios(machine: Closures, loaded: gtpin.Robot, closures: Kinematics) -> None:
    rng = np.random.default_rng(4)
    q = machine.commands(40, seed=5)
    force, payload = rng.normal(0.0, 100.0, (40, 3)), rng.uniform(0.0, 10.0, 40)
    arrays = gtpin.rod_forces(closures, q, closures.forward(q), force, payload)
    for i, row in enumerate(q):
        one = gtpin.static_forces(gtpin.home(loaded).moved_to(row), force[i], payload=float(payload[i])).rods
        np.testing.assert_allclose(arrays[i], one, rtol=0, atol=1e-9 * np.abs(one).max())


def test_without_rods_of_weight_the_plate_hangs_on_forces_along_the_rods(gantry: Closures) -> None:
    """The textbook's case: six axial forces that balance the plate's weight, solved here by hand."""
    light = gtpin.Robot(RobotDescription.parse(gantry.urdf.replace('<mass value="4.1"/>', '<mass value="0"/>')))
    arrays = Kinematics(gtpin.Geometry.nominal(light))
    q = gantry.commands(20, seed=6)
    poses = arrays.forward(q)
    weight, centre = np.array([0.0, 0.0, -22.0 * 9.81]), np.array([-0.09, 0.0, 0.02])
    for i in range(20):
        RP = gantry.P @ poses.R[i].T
        u = gantry.C(q[i : i + 1])[0] - poses.T[i] - RP
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        A = np.vstack([u.T, np.cross(RP, u).T])
        b = -np.concatenate([weight, np.cross(poses.R[i] @ centre, weight)])
        tension = np.linalg.solve(A, b)
        np.testing.assert_allclose(gtpin.rod_forces(arrays, q, poses)[i], tension, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            gtpin.static_forces(gtpin.home(light).moved_to(q[i])).rods, tension, rtol=0, atol=1e-9
        )


def test_a_load_along_a_rod_is_carried_by_that_rod_alone(gantry: Closures, at_home: gtpin.ClosedPosture) -> None:
    """A pull at joint 2a on the plate, away from its cart, tightens rod 2a by just that."""
    posture = at_home.moved_to([0.2, -0.3, 0.1])
    at = posture.R @ gantry.P[1]
    away = posture.T + at - gantry.C(posture.q[None])[0, 1]
    pull = 100.0 * away / np.linalg.norm(away)
    added = gtpin.static_forces(posture, pull, np.cross(at, pull)).rods - gtpin.static_forces(posture).rods
    np.testing.assert_allclose(added, [0, 100, 0, 0, 0, 0], rtol=0, atol=1e-8)


def test_the_middle_of_a_rod_bears_half_its_weight_more_than_its_lower_end(
    gantry: Closures, at_home: gtpin.ClosedPosture
) -> None:
    """The axial force falls from end to end by the rod's weight along it; the middle is half way."""
    posture = at_home.moved_to([-0.1, 0.3, 0.2])
    forces = gtpin.static_forces(posture)
    C = gantry.C(posture.q[None])[0]
    P = posture.T + gantry.P @ posture.R.T
    u = (C - P) / np.linalg.norm(C - P, axis=1, keepdims=True)
    weight = 4.1 * np.array([0.0, 0.0, -9.81])
    at_carrier = np.einsum("ki,ki->k", forces.loops, u)
    at_platform = at_carrier + u @ weight
    np.testing.assert_allclose(forces.rods, (at_carrier + at_platform) / 2.0, rtol=0, atol=1e-9)


def test_rods_forces_follow_the_geometry(robot: gtpin.Robot) -> None:
    geometry = drawn(robot, 7)
    arrays = Kinematics(geometry)
    written = gtpin.Robot(RobotDescription.parse(calibrated_urdf(gtpin.Model(geometry))))
    q = np.random.default_rng(8).uniform(robot.lower, robot.upper, (10, 3))
    forces = gtpin.rod_forces(arrays, q, arrays.forward(q))
    for i in range(10):
        one = gtpin.static_forces(gtpin.home(written).moved_to(q[i])).rods
        np.testing.assert_allclose(forces[i], one, rtol=0, atol=1e-7 * np.abs(one).max())


def test_a_planar_loop_s_drive_holds_the_gradient_of_the_potential_energy_and_no_force_crosses_its_plane(
    four_bar: gtpin.Robot,
) -> None:
    upright = heavy(four_bar.description.xml)
    for q in (0.3, 1.1, 2.0):
        posture = gtpin.home(upright).moved_to([q])
        forces = gtpin.static_forces(posture, FORCE, payload=PAYLOAD)
        against = gradient(posture, PAYLOAD) - posture.jacobian[:3].T @ FORCE
        np.testing.assert_allclose(forces.actuators, against, rtol=0, atol=1e-7 * np.abs(against).max())
        assert np.abs(forces.loops[:, :2]).max() > 1.0
        np.testing.assert_allclose(forces.loops[:, 2], 0.0, atol=1e-12)


def test_redundant_loops_have_no_static_forces(four_bar: gtpin.Robot) -> None:
    """A second pin beside the first holds what the first holds already."""
    pin = four_bar.description.xml.partition("<loop_joint")[2].partition("</loop_joint>")[0]
    second = f"<loop_joint{pin}</loop_joint>".replace('"pin"', '"beside"').replace(' 0"/>', ' 0.01"/>')
    robot = gtpin.Robot(RobotDescription.parse(four_bar.description.xml.replace("<gtpin>", f"{second}<gtpin>")))
    with pytest.raises(ModelError, match="redundant"):
        gtpin.static_forces(gtpin.home(robot))


def heavy(xml: str) -> gtpin.Robot:
    """The four-bar with masses, in a plane in which gravity acts."""
    inertia = '<inertial><origin xyz="0.1 0.02 0"/><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    for name in ("crank", "coupler", "rocker"):
        xml = xml.replace(f'<link name="{name}"/>', f'<link name="{name}">{inertia}</inertial></link>')
    return gtpin.Robot(RobotDescription.parse(xml.replace("<gtpin>", '<gtpin><gravity xyz="0 -9.81 0"/>')))
