"""A warning of a diagnosis is true of its last fit, also where the geometry alone left more than the causes do."""

from dataclasses import replace

import numpy as np
import pytest
from closures import ORIENTATION_SIGMA, POSITION_SIGMA, Closures, nominal
from diagnosed import quietly
from quick_first import quick_first
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import Dataset, InstrumentSection
from gtpin.diagnosis.result import Diagnosis

POSES, REFERENCE = 150, 20.0


def seen(machine: str, seed: int, growth: float = 0.0, drift: float = 0.0, declared: bool = True) -> Dataset:
    """What a tracker reads of a machine whose rods become 12 K warmer: ``growth``, 1/K; it drifts by ``drift``, m."""
    rng, plain = np.random.default_rng(seed), nominal(machine)
    real = plain.off({name: rng.normal(0.0, sigma) for name, sigma in plain.parameters().items()})
    q = plain.commands(POSES, seed) if plain.spread else plain.in_range(rng, POSES)
    time = np.sort(rng.uniform(0.0, 7200.0, POSES))
    warm = REFERENCE + 12.0 * (1.0 - np.exp(-time / 2500.0)) + rng.normal(0.0, 0.05, POSES)
    T, R = real.follow(q, 0.02)
    for i in range(POSES if growth else 0):
        T[i], R[i] = grown(real, 1.0 + growth * (warm[i] - REFERENCE), q[i], T[i], R[i])
    T += drift * np.outer(time / 7200.0, [0.7, -0.5, 0.5]) + rng.normal(0.0, POSITION_SIGMA, T.shape)
    turned = Rotation.from_rotvec(rng.normal(0.0, ORIENTATION_SIGMA, T.shape)) * Rotation.from_matrix(R)
    sigmas = {"position_sigma": POSITION_SIGMA, "orientation_sigma": ORIENTATION_SIGMA} if declared else {}
    return Dataset(
        robot=machine,
        pose=np.array([str(i) for i in range(POSES)], dtype=object),
        q=q,
        position=T,
        orientation=turned.as_quat(scalar_first=True),
        covariates={"temp_link": warm, "time": time},
        instrument=InstrumentSection(**sigmas),
    )


def grown(real: Closures, factor: float, q: np.ndarray, T: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    longer = replace(real, L0=real.L0 * factor)
    closed = longer.close(q[None], T[None], R[None])
    return closed[0][0], closed[1][0]


def said(found: Diagnosis, words: str) -> list[str]:
    return [text for text in found.warnings if words in text]


@pytest.mark.parametrize(
    ("machine", "seed", "growth", "declared"),
    quick_first([("gantry_tau", 0, 2.3e-5, True), ("gantry_tau", 3, 4e-5, False)]),
)
def test_cold_poses_of_a_machine_that_becomes_warm_are_no_gross_errors(machine, seed, growth, declared) -> None:
    found = quietly(gtpin.diagnose, seen(machine, seed, growth, declared=declared))
    assert len(found.baseline.rejected) > 0  # geometry alone can't explain them
    assert [(c.effect, c.site) for c in found.causes] == [("thermal_links", "arm")]
    assert found.set_aside == ()
    assert not said(found, "gross errors")


@pytest.mark.slow
def test_a_warning_names_the_gross_errors_that_are_left_beside_the_causes() -> None:
    dataset = seen("gantry_tau", 0, 2.3e-5)
    position = dataset.position.copy()
    position[[2, 77]] += [[5e-3, 0.0, 0.0], [0.0, 4e-4, 0.0]]
    found = quietly(gtpin.diagnose, replace(dataset, position=position))
    assert len(found.baseline.rejected) > 2
    assert set(found.set_aside) == {"2", "77"}
    assert said(found, "gross errors") == ["set aside as gross errors: poses 2, 77"]


@pytest.mark.slow
@pytest.mark.parametrize("machine", ["gantry_tau", "stewart"])
def test_residuals_that_a_cause_explains_are_no_warning(machine: str) -> None:
    dataset = seen(machine, 2, drift=2e-3)
    found = quietly(gtpin.diagnose, dataset)
    assert [(c.effect, c.site) for c in found.causes] == [("tracker_drift", "frame")]
    assert not said(found, "does not explain")
    with pytest.warns(gtpin.GtpinWarning, match="does not explain"):
        gtpin.calibrate(dataset)


@pytest.mark.slow
def test_residuals_that_nothing_explains_are_a_warning() -> None:
    """An error of a millimetre that bends through the workspace, as of no machine."""
    dataset = seen("gantry_tau", 4)
    waves = np.sin(2.0 * np.pi * dataset.position[:, [1, 2, 0]] / 1.6)
    found = quietly(gtpin.diagnose, replace(dataset, position=dataset.position + 1e-3 * waves))
    assert found.verdict == "unknown"
    assert said(found, "does not explain") or said(found, "but these data scatter by")


@pytest.mark.slow
@pytest.mark.parametrize("growth", [0.0, 4e-5])
def test_warnings_of_a_fit_with_a_wrong_noise_go_with_it(growth: float) -> None:
    """A sigma of a hundredth of the noise moves parameters by dozens of tolerances; the diagnosis estimates the noise."""
    dataset = seen("gantry_tau", 0, growth)
    small = {"position_sigma": 0.01 * POSITION_SIGMA, "orientation_sigma": 0.01 * ORIENTATION_SIGMA}
    found = quietly(gtpin.diagnose, replace(dataset, instrument=dataset.instrument.model_copy(update=small)))
    assert len(found.warnings) == len(said(found, "but these data scatter by")) == 2
