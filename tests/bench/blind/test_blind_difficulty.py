"""E and D against the definition, and the baselines on a machine whose effect is known."""

import numpy as np
import pytest

from gtpin.bench.blind.baselines import fit_known_causes, gaussian_process_positions
from gtpin.bench.blind.difficulty import SCALES, Difficulty
from gtpin.bench.simulator.case import Case, make_case
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.result import Calibration
from gtpin.effects.catalogue import effects_by_id

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")  # poses set aside

SIGMA = np.array([1.5e-5] * 3 + [5e-5] * 3)


def made(effect: str, site: str) -> Case:
    conditions = SimulatedConditions(payloads=(0.0, 10.0, 20.0))
    return make_case(
        3, effects=[(effect, site)], energy=1000.0, poses=80, held_out=40, conditions=conditions, background=False
    )


@pytest.fixture(scope="module")
def linearity() -> tuple[Case, Calibration]:
    case = made("linearity", "cart2")
    return case, calibrate(case.dataset)


@pytest.fixture(scope="module")
def difficulty(linearity: tuple[Case, Calibration]) -> Difficulty:
    case, baseline = linearity
    return Difficulty.of(case.dataset, SIGMA, baseline.model.geometry)


def test_energy_is_the_plants(linearity: tuple[Case, Calibration], difficulty: Difficulty) -> None:
    (effect,) = linearity[0].effects
    assert difficulty.energy(effect.displacement) == pytest.approx(effect.energy, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["backlash@cart1", "link_compliance@arm", "straightness@cart2"])
def test_what_an_effect_leaves_is_by_the_definition(
    linearity: tuple[Case, Calibration], difficulty: Difficulty, name: str
) -> None:
    (true,) = linearity[0].effects
    at, geometry = difficulty.situation, linearity[1].model.geometry
    effect, _, site = name.partition("@")
    basis = effects_by_id()[effect].basis(at, site)
    B = (at.kinematics.geometry_jacobian(at.q, at.poses) * geometry.tolerance / SIGMA[:, None]).reshape(6 * len(at), -1)
    X = (basis.displacement(at) * basis.sigma / SIGMA[:, None]).reshape(6 * len(at), -1)
    d = (true.displacement / SIGMA).ravel()
    best = max(
        ((s, np.eye(len(d)) + B @ B.T + s**2 * X @ X.T) for s in SCALES),
        key=lambda trial: -0.5 * d @ np.linalg.solve(trial[1], d) - 0.5 * np.linalg.slogdet(trial[1])[1],
    )
    found = difficulty.left(true.displacement)[name]
    assert found.scale == best[0]
    assert found.left == pytest.approx(d @ np.linalg.solve(best[1], d), rel=1e-6)


def test_an_effect_leaves_next_to_nothing_of_its_own_textbook_form(difficulty: Difficulty) -> None:
    at = difficulty.situation
    for effect, site, nonlinear in (("backlash", "cart1", None), ("rack_periodic", "cart3", 0.08)):
        form = effects_by_id()[effect].basis(at, site, nonlinear)
        displacement = 5.0 * (form.displacement(at) * form.sigma)[:, :, 0]
        found = difficulty.left(displacement)[f"{effect}@{site}"]
        assert found.left < 0.01 * difficulty.energy(displacement)
        assert nonlinear is None or found.nonlinear == pytest.approx(nonlinear, rel=0.05)


def test_who_knows_the_cause_is_nearer_to_the_truth_than_the_geometry_and_who_smooths(
    linearity: tuple[Case, Calibration], difficulty: Difficulty
) -> None:
    case, baseline = linearity
    best = difficulty.left(case.effects[0].displacement)["linearity@cart2"]
    model = fit_known_causes(case.dataset, baseline, [best])

    def off(T: np.ndarray) -> float:
        return float(np.sqrt(((T - case.truth.T) ** 2).sum(axis=1).mean()))

    geometry = off(baseline.model.predict(case.commands.q).T)
    known = off(model.predict(case.commands.q, case.commands.covariates).T)
    smooth = off(gaussian_process_positions(case.dataset, baseline.model, case.commands))
    assert known < 0.7 * geometry
    assert known < smooth < geometry
