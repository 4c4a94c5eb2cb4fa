"""Something is seen in pure noise no more often than was asked for."""

from dataclasses import replace

import numpy as np
import pytest
from linear_problems import calibrated, every_effect
from scipy.stats import binom

from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.search import rough_guess

pytestmark = pytest.mark.slow

MACHINES = 60
RATES = (0.3, 0.05)
"""Asked for, the larger one first: a smaller one takes as much more off every explanation, so that what is silent stays so."""
AT_BOTH = 10
"""Machines that are also tried at the smaller rate where the larger one was silent."""
MOST = 0.03
"""Measured on 200 machines: 1 alarm at 0.3, none at 0.05; this is the upper 95 % bound of 1 in 200."""


@pytest.mark.study
def test_noise_and_geometry_alone_raise_an_alarm_less_often_than_asked_for():
    observed, baseline = calibrated(poses=60)
    design = observed.design(baseline.model)
    rng = np.random.default_rng(1)
    alarms = dict.fromkeys(RATES, 0)
    for number in range(MACHINES):
        off = np.concatenate([rng.standard_normal(design.n_prior), np.zeros(design.B.shape[1] - design.n_prior)])
        own = replace(design, y=design.B @ off + rng.standard_normal(len(design.y)))
        silent = False
        for rate in RATES if number < AT_BOTH else RATES[:1]:
            alarm = bool(rough_guess(propose(own, every_effect(rate))).terms)
            assert not (silent and alarm), rate
            alarms[rate], silent = alarms[rate] + alarm, not alarm
        if not silent and number >= AT_BOTH:
            alarms[RATES[1]] += bool(rough_guess(propose(own, every_effect(RATES[1]))).terms)
    assert max(alarms.values()) <= binom.ppf(0.999, MACHINES, MOST)
