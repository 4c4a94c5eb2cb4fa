"""Four parallel machines through one code: batches, single postures and the tests' own closures agree."""

import numpy as np
import pytest
from closures import Closures
from loaded_machines import differences, load
from machines import MAKERS
from single_postures import Single

import gtpin
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.rotations import log

Floats = np.ndarray


def test_home_closes_to_rounding_where_the_urdf_says(machine: Closures, loaded: gtpin.Robot) -> None:
    posture = gtpin.home(loaded)
    gap = machine.residual(machine.q[None], posture.T[None], posture.R[None])
    assert np.abs(gap).max() <= 1e-14 * loaded.size
    np.testing.assert_allclose(posture.q, machine.q, rtol=0, atol=1e-15)
    np.testing.assert_allclose(posture.T, machine.T, rtol=0, atol=1e-13)
    np.testing.assert_allclose(posture.R, machine.R, rtol=0, atol=1e-13)


def test_rods_are_found_by_their_own_ends_whatever_the_frames(machine: Closures, loaded: gtpin.Robot) -> None:
    zero = np.zeros((1, loaded.n_actuators))
    np.testing.assert_allclose([rod.P for rod in loaded.rods], machine.P, rtol=0, atol=1e-13)
    np.testing.assert_allclose([rod.C for rod in loaded.rods], machine.C(zero)[0], rtol=0, atol=1e-13)
    np.testing.assert_allclose([rod.L for rod in loaded.rods], machine.L(zero)[0], rtol=0, atol=1e-13)


def test_forward_kinematics_follows_the_closures_from_home(machine: Closures, closures: Kinematics) -> None:
    q = machine.commands(300, seed=2)
    T, R = machine.follow(q)
    poses = closures.forward(q)
    assert np.abs(poses.T - T).max() <= 1e-12
    assert np.abs(log(poses.R @ np.swapaxes(R, 1, 2))).max() <= 1e-12


def test_commands_arrive_where_they_were_sent(machine: Closures, loaded: gtpin.Robot) -> None:
    posture = gtpin.home(loaded)
    for row in machine.commands(20, seed=3):
        np.testing.assert_allclose(posture.moved_to(row).q, row, rtol=0, atol=1e-15)


def one_pose(posture: gtpin.ClosedPosture) -> gtpin.Poses:
    return gtpin.Poses(posture.T[None], posture.R[None])


def test_command_jacobian_is_the_derivative_of_pinocchios_solution(
    machine: Closures, loaded: gtpin.Robot, closures: Kinematics
) -> None:
    q = machine.commands(4, seed=4)
    jacobians = closures.command_jacobian(q, closures.forward(q))
    for row, jacobian in zip(q, jacobians, strict=True):
        posture = gtpin.home(loaded).moved_to(row)
        scale = np.abs(jacobian).max()
        numeric = differences(lambda x, posture=posture: one_pose(posture.moved_to(x)), row, 1e-4)
        np.testing.assert_allclose(posture.jacobian, jacobian, rtol=0, atol=1e-11 * scale)
        np.testing.assert_allclose(jacobian, numeric[0], rtol=0, atol=1e-8 * scale)


def test_geometry_jacobian_of_a_batch_is_pinocchios_of_single_postures(
    machine: Closures, loaded: gtpin.Robot, closures: Kinematics
) -> None:
    geometry, q = closures.geometry, machine.commands(10, seed=5)
    for row, jacobian in zip(q, closures.geometry_jacobian(q, closures.forward(q)), strict=True):
        by_pinocchio = Single.at(loaded, row).by_parameters(geometry)
        np.testing.assert_allclose(jacobian, by_pinocchio, rtol=0, atol=1e-11 * np.abs(jacobian).max())
    own = gtpin.geometry_jacobian(gtpin.home(loaded).moved_to(row), geometry)
    np.testing.assert_allclose(own, by_pinocchio, rtol=0, atol=1e-11 * np.abs(own).max())


@pytest.mark.slow
@pytest.mark.parametrize("away", [0.0, 1.0])
def test_geometry_jacobian_is_the_derivative_of_the_poses(machine: Closures, loaded: gtpin.Robot, away: float) -> None:
    nominal = gtpin.Geometry.nominal(loaded, scale="actuator")
    rng = np.random.default_rng(6)
    values = nominal.values + away * nominal.tolerance * rng.standard_normal(len(nominal.values))
    q = machine.commands(2, seed=7)

    def predicted(values: Floats) -> gtpin.Poses:
        return Kinematics(nominal.with_values(values)).forward(q)

    here = Kinematics(nominal.with_values(values))
    analytic = here.geometry_jacobian(q, here.forward(q))
    numeric = differences(predicted, values, 2e-4)
    np.testing.assert_allclose(analytic, numeric, rtol=0, atol=1e-8 * np.abs(analytic).max())


def test_parameters_of_other_machines_have_the_names_of_what_they_are() -> None:
    names = {name: gtpin.Geometry.nominal(load(make()), scale="actuator").names for name, make in MAKERS.items()}
    assert {"base_joint[3].x", "length[6]", "platform_joint[1].z", "scale[leg4]"} <= set(names["stewart"])
    assert not any("direction" in name for name in names["stewart"])
    assert {"cart_joint[3].x", "track_direction[cart2].b", "scale[cart3]"} <= set(names["linear_delta"])
    assert {"arm_joint[3].x", "arm_axis[cart2].a", "scale[cart1]"} <= set(names["rotary_tau"])
    assert [len(n) for n in names.values()] == [42 + 6, 42 + 6 + 3, 42 + 6 + 3]


@pytest.mark.parametrize("machine", ["linear_delta"], indirect=True)
def test_a_linear_delta_only_translates(closures: Kinematics, machine: Closures) -> None:
    q = machine.commands(100, seed=9)
    np.testing.assert_allclose(closures.forward(q).R, np.tile(np.eye(3), (100, 1, 1)), rtol=0, atol=1e-12)
    # All carts up by the same travel lift the platform by just that.
    lifted = closures.forward(q + 0.05)
    np.testing.assert_allclose(lifted.T - closures.forward(q).T, np.tile([0, 0, 0.05], (100, 1)), rtol=0, atol=1e-12)


def test_tolerances_of_the_urdf_override_the_defaults_and_only_those(machine: Closures, loaded: gtpin.Robot) -> None:
    tolerance = dict(zip((g := gtpin.Geometry.nominal(loaded)).names, g.tolerance, strict=True))
    assert tolerance[f"length[{loaded.rods[0].name}]"] == (1e-3 if machine.name == "gantry_tau" else 5e-4)
    assert tolerance[f"platform_joint[{loaded.rods[0].name}].x"] == 1e-3
