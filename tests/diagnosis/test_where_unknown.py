"""Where an unknown error is, and with what it goes, is told of the strongest errors too."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed import quietly

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.report.verdict import verdict

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_scale_that_wanders_over_time_is_told_as_a_scale_over_time(seed: int) -> None:
    """Every p-value is 0 here; sessions, payloads and temperatures change with time, too."""
    dataset = make_case(seed, effects=[], poses=220).dataset
    assert dataset.position is not None
    time = dataset.covariates["time"]
    scale = 3e-4 * np.sin(2.0 * np.pi * 1.3 * (time - time.min()) / np.ptp(time))
    centre = dataset.position.mean(axis=0) + np.array([0.5, 0.3, 0.2])
    wandered = replace(dataset, position=dataset.position + scale[:, None] * (dataset.position - centre))
    found = quietly(gtpin.diagnose, wandered)
    assert found.verdict == "unknown"
    best = found.unexplained.correlates[0]
    assert best.p_value == 0.0
    assert (best.site, best.coordinates) == ("frame", "time")
    assert "the scale of the instrument or the whole machine depending on time" in verdict(found).headline
