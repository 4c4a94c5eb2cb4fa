"""How long a diagnosis takes beside the calibration that it starts from, and how that grows with the number of poses."""

from __future__ import annotations

import time
import warnings

import pytest

import gtpin
from gtpin.bench.simulator.case import make_case

pytestmark = pytest.mark.benchmark(timer=time.process_time)
FACTOR = 60.0
"""Times the calibration of the same poses that a diagnosis may take."""


@pytest.fixture(scope="module")
def usual():
    return make_case(1, effects=[("linearity", "cart2")], noncentrality=500.0, poses=220).dataset


def test_a_diagnosis_takes_no_more_than_a_few_dozen_calibrations(benchmark, usual):
    warnings.simplefilter("ignore")
    start = time.process_time()
    for _ in range(3):
        gtpin.calibrate(usual)
    once = (time.process_time() - start) / 3.0
    benchmark.pedantic(gtpin.diagnose, args=(usual,), rounds=3, warmup_rounds=1)
    assert benchmark.stats.stats.min < FACTOR * once


def test_ten_times_the_poses_take_less_than_twenty_times_as_long(benchmark, usual):
    warnings.simplefilter("ignore")
    many = make_case(1, effects=[("linearity", "cart2")], noncentrality=500.0, poses=2200).dataset
    gtpin.diagnose(usual)
    start = time.process_time()
    gtpin.diagnose(usual)
    once = time.process_time() - start
    benchmark.pedantic(gtpin.diagnose, args=(many,), rounds=1)
    assert benchmark.stats.stats.min < 20.0 * once
