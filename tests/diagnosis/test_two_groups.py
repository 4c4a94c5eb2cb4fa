"""Rows of two measurements that were mixed in one table are told from noise."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from every_effect import every_effect

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import Noise
from gtpin.diagnosis.hypotheses.propose import propose
from gtpin.diagnosis.inference.reestimate_noise import left_over
from gtpin.diagnosis.inference.suspicious_data import two_groups
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.linear.posterior import NOTHING
from gtpin.errors import GtpinWarning

pytestmark = pytest.mark.slow


def groups_of(dataset: gtpin.Dataset):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        baseline = gtpin.calibrate(dataset)
    design = Observed.of(dataset, baseline).design(baseline.model)
    left, _ = left_over(propose(design, every_effect()).hypotheses, NOTHING)
    return two_groups(design, left, (1.5e-5, 5e-5))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("repeatability", [(1e-6, 4e-6), (4e-5, 6e-5)])
def test_noise_and_scatter_of_drives_are_one_group(seed: int, repeatability: tuple[float, float]) -> None:
    noise = Noise(repeatability=repeatability)
    assert groups_of(make_case(seed, n_effects=0, poses=120, held_out=1, noise=noise).dataset) is None


@pytest.mark.parametrize(("effect", "site"), [("linearity", "cart3"), ("thermal_links", "arm"), ("backlash", "cart1")])
def test_effects_are_one_group(effect: str, site: str) -> None:
    assert groups_of(make_case(4, effects=[(effect, site)], energy=1500.0, poses=120, held_out=1).dataset) is None


@pytest.mark.parametrize("seed", [5, 6])
def test_two_frames_in_one_table_are_told_with_their_rows(seed: int) -> None:
    dataset = make_case(seed, n_effects=0, poses=120, held_out=1).dataset
    rng = np.random.default_rng(seed)
    other = np.isin(dataset.visits, rng.permutation(120)[:50])
    moved = replace(dataset, position=dataset.position + np.where(other[:, None], [4e-4, -3e-4, 2e-4], 0.0))
    found = groups_of(moved)
    assert found is not None
    assert (found.smaller == other).mean() > 0.95
    assert found.apart == pytest.approx(np.linalg.norm([4e-4, -3e-4, 2e-4]), rel=0.3)


def test_no_verdict_of_silence_stands_on_two_groups() -> None:
    dataset = make_case(7, n_effects=0, poses=120, held_out=1).dataset
    half = np.random.default_rng(7).permutation(len(dataset))[: len(dataset) // 2]
    position = dataset.position.copy()
    position[half] += [6e-4, 0.0, -6e-4]
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        found = gtpin.diagnose(replace(dataset, position=position))
    assert found.verdict == "unknown"
    assert any("two groups" in str(w.message) for w in heard)
