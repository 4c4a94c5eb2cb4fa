"""E, D and true parameters against their definitions."""

import numpy as np
import pytest
from handmade import left_by_definition

from gtpin import Geometry, load_robot
from gtpin.bench.blind.difficulty import Difficulty, true_parameters
from gtpin.bench.simulator.case import Case, make_case
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.result import Calibration
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import OperatingPoints

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # poses set aside

SIGMA = np.array([1.5e-5] * 3 + [5e-5] * 3)


def made(effect: str, site: str) -> Case:
    conditions = SimulatedConditions(payloads=(0.0, 10.0, 20.0))
    return make_case(
        3,
        effects=[(effect, site)],
        noncentrality=1000.0,
        poses=80,
        held_out=40,
        conditions=conditions,
        background=False,
    )


@pytest.fixture(scope="module")
def linearity() -> tuple[Case, Calibration]:
    case = made("linearity", "cart2")
    return case, calibrate(case.dataset)


@pytest.fixture(scope="module")
def difficulty(linearity: tuple[Case, Calibration]) -> Difficulty:
    case, baseline = linearity
    return Difficulty.of(case.dataset, SIGMA, baseline.model.geometry)


def whitened(at: OperatingPoints, basis: Displacement) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by the geometry in tolerances, and by an effect in typical sizes, in units of the noise."""
    B = at.kinematics.geometry_jacobian(at.q, at.poses) * at.kinematics.geometry.tolerance / SIGMA[:, None]
    X = basis.displacement(at) * basis.sigma / SIGMA[:, None]
    return B.reshape(6 * len(at), -1), X.reshape(6 * len(at), -1)


def test_energy_is_the_plants(linearity: tuple[Case, Calibration], difficulty: Difficulty) -> None:
    (effect,) = linearity[0].effects
    assert difficulty.noncentrality(effect.displacement) == pytest.approx(effect.noncentrality, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["backlash@cart1", "link_compliance@arm", "straightness@cart2"])
def test_what_an_effect_leaves_is_by_the_definition(
    linearity: tuple[Case, Calibration], difficulty: Difficulty, name: str
) -> None:
    (true,) = linearity[0].effects
    at = difficulty.operating_points
    effect, _, site = name.partition("@")
    basis = effects_by_id()[effect].basis(at, site)
    B, X = whitened(at, basis)
    scale, left = left_by_definition(B, X, (true.displacement / SIGMA).ravel())
    found = difficulty.left(true.displacement)[name]
    assert found.scale == scale
    assert found.left == pytest.approx(left, rel=1e-6)


def test_an_effect_leaves_next_to_nothing_of_its_own_textbook_form(difficulty: Difficulty) -> None:
    at = difficulty.operating_points
    for effect, site, shape_parameter in (("backlash", "cart1", None), ("rack_periodic", "cart3", 0.08)):
        form = effects_by_id()[effect].basis(at, site, shape_parameter)
        displacement = 5.0 * (form.displacement(at) * form.sigma)[:, :, 0]
        found = difficulty.left(displacement)[f"{effect}@{site}"]
        assert found.left < 0.01 * difficulty.noncentrality(displacement)
        assert shape_parameter is None or found.shape_parameter == pytest.approx(shape_parameter, rel=0.05)


# A fit of effect and geometry together to noise-free data.


@pytest.fixture(scope="module")
def plain() -> Difficulty:
    dataset = make_case(3, effects=[], poses=80, held_out=2, background=False).dataset
    return Difficulty.of(dataset, SIGMA, Geometry.nominal(load_robot("gantry_tau")))


def of(plain: Difficulty, name: str, displacement: np.ndarray) -> dict[str, float]:
    return true_parameters(plain, plain.left(displacement)[name], displacement)


def bent(plain: Difficulty) -> np.ndarray:
    """Track 2 is bent upwards by 50 um at its ends, to the second order."""
    at = plain.operating_points
    basis = effects_by_id()["straightness"].basis(at, "cart2")
    return basis.displacement(at)[:, :, 1] * 5e-5


def test_parameters_are_those_of_the_textbook_form(plain: Difficulty) -> None:
    at = plain.operating_points
    scale = effects_by_id()["encoder_scale"].basis(at, "cart1").displacement(at)[:, :, 0] * 1e-3
    assert of(plain, "encoder_scale@cart1", scale)["scale"] == pytest.approx(1e-3, rel=0.01)


@pytest.mark.parametrize("near", [0.06, 0.08, 0.13])
def test_a_period_between_those_of_a_scan_is_found(plain: Difficulty, near: float) -> None:
    at, effect = plain.operating_points, effects_by_id()["rack_periodic"]
    tried = np.array(effect.nonlinear_values(at, "cart3"))
    place = int(np.argmin(np.abs(tried - near)))
    period = float(tried[place : place + 2].mean())
    displacement = effect.basis(at, "cart3", period).displacement(at)[:, :, :2] @ [3e-5, 4e-5]
    found = of(plain, "rack_periodic@cart3", displacement)
    assert found["period"] == pytest.approx(period, rel=2e-4)
    assert found["amplitude"] == pytest.approx(5e-5, rel=0.01)
    assert found["phase"] == pytest.approx(np.arctan2(4.0, 3.0), abs=0.02)


def test_coefficients_are_those_of_least_squares_with_the_geometry_and_all_priors(plain: Difficulty) -> None:
    at, displacement = plain.operating_points, bent(plain)
    best = plain.left(displacement)["linearity@cart2"]
    effect = effects_by_id()["linearity"]
    basis = effect.basis(at, "cart2")
    B, X = whitened(at, basis)
    p, m = B.shape[1], X.shape[1]
    rows = np.vstack([np.hstack([B, X]), np.eye(p + m) / np.repeat([1.0, best.scale], [p, m])[:, None]])
    right = np.concatenate([(displacement / SIGMA).ravel(), np.zeros(p + m)])
    c = np.linalg.lstsq(rows, right, rcond=None)[0][p:] * basis.sigma
    wanted = {n: v for n, (v, _) in effect.parameters_of(at.robot, "cart2", c, ()).items()}
    assert true_parameters(plain, best, displacement) == pytest.approx(wanted, rel=1e-6)


def test_what_calibration_absorbs_changes_no_parameter(plain: Difficulty) -> None:
    at, displacement = plain.operating_points, bent(plain)
    geometry = at.kinematics.geometry
    turn = geometry.names.index("track_direction[cart2].a")
    rate = at.kinematics.geometry_jacobian(at.q, at.poses)[:, :, turn]
    turned = displacement + rate * 0.3 * geometry.tolerance[turn]
    assert np.abs(turned - displacement).max() > 5e-5  # as large as what is not straight
    best = plain.left(displacement)["straightness@cart2"]
    before, after = (true_parameters(plain, best, d) for d in (displacement, turned))
    assert after == pytest.approx(before, rel=0.02, abs=5e-7)


def test_no_effect_leaves_more_than_there_is(linearity: tuple[Case, Calibration], difficulty: Difficulty) -> None:
    (effect,) = linearity[0].effects
    whole, left = difficulty.noncentrality(effect.displacement), difficulty.left(effect.displacement)
    assert all(-1e-6 * whole <= best.left <= whole * (1.0 + 1e-9) for best in left.values())
