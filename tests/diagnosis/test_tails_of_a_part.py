"""Where a search uses a part of the rows, the last fit weighs all of them by the tails that the part shows."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from every_effect import every_effect
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.data import Dataset
from gtpin.diagnosis.inference import settle as settling
from gtpin.diagnosis.inference.joint_fit import fit_together
from gtpin.diagnosis.inference.settle import SearchState, settle
from gtpin.diagnosis.preparation.prepare import Prepared, prepare

pytestmark = pytest.mark.slow

POSES, PART, FREEDOM = 240, 120, 2.5


def heavy_tailed(seed: int) -> Dataset:
    """Poses of a nominal machine; the six numbers of a pose share the factor that makes their tails heavy."""
    dataset = make_case(seed, effects=[], poses=POSES, background=False).dataset
    rng = np.random.default_rng(seed)
    poses = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"))).predict(dataset.q)
    z = rng.standard_normal((len(dataset), 6)) * np.sqrt(FREEDOM / rng.chisquare(FREEDOM, (len(dataset), 1)))
    turned = Rotation.from_rotvec(5e-5 * z[:, 3:]) * Rotation.from_matrix(poses.R)
    instrument = dataset.instrument.model_copy(update={"position_sigma": 1.5e-5, "orientation_sigma": 5e-5})
    return replace(
        dataset,
        position=poses.T + 1.5e-5 * z[:, :3],
        orientation=turned.as_quat(scalar_first=True),
        instrument=instrument,
    )


def settled(prepared: Prepared) -> SearchState:
    rows = prepared.baseline.used(prepared.dataset)
    return settle(prepared, rows, every_effect(), np.random.default_rng(0))


def geometry(of: SearchState, prepared: Prepared, **changed: object) -> np.ndarray:
    references = of.hypotheses.design.situation.references
    everything = replace(of.everything, **changed)
    model = fit_together(everything, prepared.baseline.model, [], [], references)
    return model.geometry.values / model.geometry.tolerance


@pytest.mark.parametrize("seed", [1, 2])
def test_a_fit_after_a_search_of_half_the_rows_is_that_after_a_search_of_all(seed, monkeypatch):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        prepared = prepare(heavy_tailed(seed), gtpin.load_robot("gantry_tau"))
    whole = settled(prepared)
    assert (whole.everything.weight != 1.0).any()  # the tails are found
    monkeypatch.setattr(settling, "MOST_POSES", PART)
    half = settled(prepared)
    assert len(half.observed.weight) <= PART < len(half.everything.weight)
    aim = geometry(whole, prepared)
    off = np.abs(geometry(half, prepared) - aim).max()
    alike = np.abs(geometry(half, prepared, tails={}) - aim).max()  # all rows count alike
    assert off < 0.3 * alike
