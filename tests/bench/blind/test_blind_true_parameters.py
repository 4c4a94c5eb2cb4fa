"""The true values of parameters against their definition: a fit of effect and geometry together to noise-free data."""

import numpy as np
import pytest

from gtpin import load_robot
from gtpin.bench.blind.difficulty import Difficulty, true_parameters
from gtpin.bench.simulator.case import make_case
from gtpin.effects.catalogue import effects_by_id
from gtpin.robot.geometry import Geometry

SIGMA = np.array([1.5e-5] * 3 + [5e-5] * 3)


@pytest.fixture(scope="module")
def difficulty() -> Difficulty:
    dataset = make_case(3, effects=[], poses=80, held_out=2, background=False).dataset
    return Difficulty.of(dataset, SIGMA, Geometry.nominal(load_robot("gantry_tau")))


def of(difficulty: Difficulty, name: str, displacement: np.ndarray) -> dict[str, float]:
    return true_parameters(difficulty, difficulty.left(displacement)[name], displacement)


def bent(difficulty: Difficulty) -> np.ndarray:
    """Track 2 is bent upwards by 50 um at its ends, to the second order."""
    at = difficulty.situation
    basis = effects_by_id()["straightness"].basis(at, "cart2")
    return basis.displacement(at)[:, :, 1] * 5e-5


def test_parameters_are_those_of_the_textbook_form(difficulty: Difficulty) -> None:
    at = difficulty.situation
    scale = effects_by_id()["encoder_scale"].basis(at, "cart1").displacement(at)[:, :, 0] * 1e-3
    assert of(difficulty, "encoder_scale@cart1", scale)["scale"] == pytest.approx(1e-3, rel=0.01)


@pytest.mark.parametrize("near", [0.06, 0.08, 0.13])
def test_a_period_between_those_of_a_scan_is_found(difficulty: Difficulty, near: float) -> None:
    at, effect = difficulty.situation, effects_by_id()["rack_periodic"]
    tried = np.array(effect.nonlinear_values(at, "cart3"))
    place = int(np.argmin(np.abs(tried - near)))
    period = float(tried[place : place + 2].mean())
    displacement = effect.basis(at, "cart3", period).displacement(at)[:, :, :2] @ [3e-5, 4e-5]
    found = of(difficulty, "rack_periodic@cart3", displacement)
    assert found["period"] == pytest.approx(period, rel=2e-4)
    assert found["amplitude"] == pytest.approx(5e-5, rel=0.01)
    assert found["phase"] == pytest.approx(np.arctan2(4.0, 3.0), abs=0.02)


def test_coefficients_are_those_of_least_squares_with_the_geometry_and_all_priors(difficulty: Difficulty) -> None:
    at, displacement = difficulty.situation, bent(difficulty)
    best = difficulty.left(displacement)["linearity@cart2"]
    effect = effects_by_id()["linearity"]
    basis = effect.basis(at, "cart2")
    tolerance = at.kinematics.geometry.tolerance
    B = (at.kinematics.geometry_jacobian(at.q, at.poses) * tolerance / SIGMA[:, None]).reshape(6 * len(at), -1)
    X = (basis.displacement(at) * basis.sigma / SIGMA[:, None]).reshape(6 * len(at), -1)
    p, m = B.shape[1], X.shape[1]
    rows = np.vstack([np.hstack([B, X]), np.eye(p + m) / np.repeat([1.0, best.scale], [p, m])[:, None]])
    right = np.concatenate([(displacement / SIGMA).ravel(), np.zeros(p + m)])
    c = np.linalg.lstsq(rows, right, rcond=None)[0][p:] * basis.sigma
    wanted = {n: v for n, (v, _) in effect.parameters_of(at.robot, "cart2", c, ()).items()}
    assert true_parameters(difficulty, best, displacement) == pytest.approx(wanted, rel=1e-6)


def test_what_calibration_absorbs_changes_no_parameter(difficulty: Difficulty) -> None:
    at, displacement = difficulty.situation, bent(difficulty)
    geometry = at.kinematics.geometry
    turn = geometry.names.index("track_direction[cart2].a")
    rate = at.kinematics.geometry_jacobian(at.q, at.poses)[:, :, turn]
    turned = displacement + rate * 0.3 * geometry.tolerance[turn]
    assert np.abs(turned - displacement).max() > 5e-5  # as large as what is not straight
    best = difficulty.left(displacement)["straightness@cart2"]
    plain, after = (true_parameters(difficulty, best, d) for d in (displacement, turned))
    assert after == pytest.approx(plain, rel=0.02, abs=5e-7)
