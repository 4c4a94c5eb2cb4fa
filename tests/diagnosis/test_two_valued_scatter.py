"""Play whose direction of approach belongs to other rows is neither nothing nor another cause; Gaussian scatter is no play."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import Conditions
from gtpin.diagnosis.inference.suspicious_data import two_values
from gtpin.report.verdict import verdict

STILL = Conditions(rest=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_play_with_directions_of_other_rows_on_a_machine_that_stands_still_is_not_called_nothing(seed):
    case = make_case(seed, effects=[("backlash", "cart1")], energy=4000.0, poses=130, held_out=1, conditions=STILL)
    order = np.random.default_rng(seed).permutation(len(case.dataset))
    mixed = {n: v[order] if n.startswith("approach") else v for n, v in case.dataset.covariates.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        found = gtpin.diagnose(replace(case.dataset, covariates=mixed))
    assert found.verdict == "unknown"
    assert not [c for c in found.causes if c.probability >= 0.95 and c.effect != "backlash"]
    if any(doubt.reason == "two_valued" for doubt in found.doubts):
        assert any("approach" in line for line in verdict(found).advice)


@pytest.mark.slow
@pytest.mark.parametrize("count", [60, 220, 1000])
def test_gaussian_scatter_is_hardly_ever_taken_for_two_values(count):
    rng = np.random.default_rng(count)
    known = np.full(count, 0.3**2)
    gains = [two_values(rng.normal(size=count) + rng.normal(0.0, 0.3, count), known) for _ in range(100)]
    assert max(gains) < max(10.0, 0.05 * count)


@pytest.mark.parametrize("apart", [2.5, 4.0])
def test_two_values_far_apart_are_seen(apart):
    rng = np.random.default_rng(1)
    errors = apart * rng.choice([-1.0, 1.0], 150) + rng.normal(size=150)
    assert two_values(errors, np.ones(150)) > 10.0
