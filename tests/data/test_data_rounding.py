"""Rounding of positions counts as noise where it is coarser than the instrument's."""

from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.data.rounding import rounded_to, with_rounding
from gtpin.errors import GtpinWarning


@pytest.fixture(scope="module")
def measured() -> gtpin.Dataset:
    return simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=80, seed=9).dataset


@pytest.mark.parametrize("step", [1e-2, 1e-3, 5e-4, 1e-4])
def test_the_noise_of_rounded_positions_is_what_rounding_makes_it(measured: gtpin.Dataset, step: float) -> None:
    rounded = replace(measured, position=np.round(measured.position / step) * step)
    assert rounded_to(rounded) == step
    with pytest.warns(GtpinWarning, match="positions are rounded to"):
        found = with_rounding(rounded)
    declared = measured.instrument.position_sigma
    off = rounded.position - measured.position  # what rounding did, beside noise of the declared size
    assert declared is not None
    assert found.instrument.position_sigma == pytest.approx(np.hypot(declared, off.std()), rel=0.1)


def test_full_or_fine_digits_change_nothing(measured: gtpin.Dataset) -> None:
    assert rounded_to(measured) is None
    assert with_rounding(measured) is measured
    fine = replace(measured, position=np.round(measured.position, 6))
    assert with_rounding(fine) is fine


def test_a_calibration_of_rounded_positions_fits_within_its_noise(measured: gtpin.Dataset) -> None:
    rounded = replace(measured, position=np.round(measured.position, 3))
    with pytest.warns(GtpinWarning, match="positions are rounded to 1 mm"):
        found = gtpin.calibrate(rounded)
    assert 0.7 < found.chi2_per_dof < 1.3
