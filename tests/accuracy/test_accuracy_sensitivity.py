"""Sensitivity: the finite step and the Jacobian, against closures that are solved here."""

import numpy as np
import pytest
from accuracy_machines import LINKS, MODEL, NOMINAL, commands, drawn_measurements, other, stepped
from scipy.spatial.transform import Rotation

from gtpin.accuracy.sensitivity import PARAMETERS, STEP, sensitivity
from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import zyz, zyz_change, zyz_rates

SIGMAS = np.array([2e-4, 1.7e-4, 1.6e-4, 8e-5, 7e-5, 9e-5])


@pytest.mark.parametrize("parameter", PARAMETERS)
def test_exact_sums_are_those_of_machines_with_the_parameter_changed(parameter: str) -> None:
    q = commands(3, seed=1)
    poses = MODEL.predict(q)
    found = sensitivity(MODEL, q).exact
    before = Rotation.from_matrix(poses.R).as_euler("ZYZ")
    for link in (0, 2, 4):
        position = rotation = 0.0
        for sign in (1.0, -1.0):
            T, R = stepped(parameter, link, sign * STEP).close(q, poses.T, poses.R)
            position += np.linalg.norm(T - poses.T, axis=1).sum()
            rotation += np.abs(Rotation.from_matrix(R).as_euler("ZYZ") - before).sum()
        row = PARAMETERS.index(parameter)
        assert found.position[row, link] == pytest.approx(position, rel=1e-6, abs=1e-11)
        assert found.rotation[row, link] == pytest.approx(rotation, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("name", ["gantry_tau", "stewart"])
def test_jacobian_and_finite_step_agree_to_the_second_order_of_the_step(name: str) -> None:
    model = MODEL if name == "gantry_tau" else other(name)
    q = model.robot.home_q + 0.02 * np.random.default_rng(2).uniform(-1, 1, (20, model.robot.n_actuators))
    for step in (5e-5, 5e-6):
        found = sensitivity(model, q, step=step)
        for what in ("position", "rotation"):
            exact, linear = getattr(found.exact, what), getattr(found.linear, what)
            np.testing.assert_allclose(exact, linear, rtol=30.0 * step, atol=20.0 * step**2 * 40)


def test_where_closures_hold_their_costs_are_those_of_the_step_alone() -> None:
    q = commands(12, seed=3)
    poses = MODEL.predict(q)
    found = sensitivity(MODEL, q, sigmas=np.zeros(6))
    for row, parameter in enumerate(PARAMETERS):
        for link in range(6):
            machines = (stepped(parameter, link, sign * STEP) for sign in (1.0, -1.0))
            expected = sum((one.squares(q, poses.T, poses.R)[:, link] ** 2).sum() for one in machines)
            assert found.exact.cost[row, link] == pytest.approx(expected, rel=1e-7)
            assert found.linear.cost[row, link] == pytest.approx(expected, rel=1e-3)


def test_expected_cost_change_is_the_mean_over_drawn_machines() -> None:
    q = commands(10, seed=6)
    found = sensitivity(MODEL, q, sigmas=SIGMAS)
    drawn = [drawn_measurements(MODEL, q, SIGMAS, seed) for seed in range(40)]
    measured = Poses(*(np.concatenate([getattr(one, part) for one in drawn]) for part in "TR"))
    q = np.tile(q, (len(drawn), 1))
    before = NOMINAL.squares(q, measured.T, measured.R) ** 2
    for row, parameter in enumerate(PARAMETERS):
        for link in range(6):
            machines = (stepped(parameter, link, sign * STEP) for sign in (1.0, -1.0))
            changes = [one.squares(q, measured.T, measured.R)[:, link] ** 2 - before[:, link] for one in machines]
            sums = np.abs(changes).sum(axis=0).reshape(len(drawn), -1).sum(axis=1)
            for expected in (found.exact.cost[row, link], found.linear.cost[row, link]):
                assert abs(sums.mean() - expected) < 4.5 * sums.std() / np.sqrt(len(drawn))


def test_without_residuals_the_cost_is_not_known() -> None:
    found = sensitivity(MODEL, commands(3))
    assert found.exact.cost is None
    assert found.to_table()["cost_m4"].isna().all()


def test_the_table_has_the_contracts_columns_in_millimetres() -> None:
    found = sensitivity(MODEL, commands(4), sigmas=SIGMAS)
    table = found.to_table()
    assert list(table) == ["parameter", "link", "position_mm", "rotation_rad", "cost_m4"]
    assert list(table["link"][:6]) == list(LINKS)
    assert list(table["parameter"].unique()) == list(PARAMETERS)
    np.testing.assert_allclose(table["position_mm"], 1e3 * found.exact.position.ravel())


def test_rods_without_a_track_have_no_rows_for_its_direction() -> None:
    model = other("stewart")
    table = sensitivity(model, model.robot.home_q[None]).to_table()
    assert list(table["parameter"].unique()) == ["L", "Px", "Py", "Pz", "Cx", "Cy", "Cz"]
    assert len(table) == 7 * 6


def test_a_lever_of_the_command_makes_the_direction_matter() -> None:
    """A step of v moves the joint on the cart by q times the step: twice the command, twice the change; none at zero."""
    found = sensitivity(MODEL, np.zeros((1, 3))).exact.position
    np.testing.assert_allclose(found[7:], 0.0, atol=1e-14)


def test_euler_rates_are_the_derivative_of_the_angles() -> None:
    R = Rotation.random(20, rng=7).as_matrix()
    rates = zyz_rates(R)
    for axis in range(3):
        vector = 1e-6 * np.eye(3)[axis]
        ahead, back = (Rotation.from_rotvec(s * vector).as_matrix() @ R for s in (1.0, -1.0))
        np.testing.assert_allclose(rates[:, :, axis], zyz_change(ahead, back) / 2e-6, rtol=1e-4, atol=1e-6)
    angles = zyz(R)
    by_hand = [Rotation.from_euler("ZYZ", row).as_matrix() for row in angles]
    np.testing.assert_allclose(by_hand, R, atol=1e-12)


def test_drawn_measurements_leave_the_residuals_that_were_asked_for() -> None:
    q = commands(400, seed=9)
    measured = drawn_measurements(MODEL, q, SIGMAS)
    residual = NOMINAL.squares(q, measured.T, measured.R)
    np.testing.assert_allclose(residual.std(axis=0), SIGMAS, rtol=0.15)
    assert np.abs(np.corrcoef(residual.T) - np.eye(6)).max() < 0.2


def test_what_can_not_be_is_refused() -> None:
    q = commands(3)
    with pytest.raises(ModelError, match="closure sigmas"):
        sensitivity(MODEL, q, sigmas=np.ones(3))
    with pytest.raises(UnreachableError, match="row 1"):
        sensitivity(MODEL, np.array([[0.0, 0.0, 0.0], [5.0, -5.0, 0.0]]))
    with pytest.raises(ModelError, match="no commands"):
        sensitivity(MODEL, np.zeros((0, 3)))
