"""Temperatures that were not read for a stretch are not used; those in coarse steps, or read throughout, are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.diagnosis.preparation.prepare import without_frozen
from gtpin.errors import GtpinWarning


def measured(seed: int) -> gtpin.Dataset:
    return make_case(seed, effects=[], poses=130, held_out=1).dataset


def with_temperature(dataset: gtpin.Dataset, values: np.ndarray) -> gtpin.Dataset:
    return replace(dataset, covariates={**dataset.covariates, "temp_link": values})


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_temperatures_as_they_were_read_are_kept(seed):
    dataset = measured(seed)
    assert without_frozen(dataset) is dataset


def test_a_temperature_that_stands_still_in_a_third_of_the_rows_is_not_used():
    dataset = measured(4)
    values = np.asarray(dataset.covariates["temp_link"], dtype=float).copy()
    order = np.argsort(dataset.covariates["time"])
    values[order[: len(values) // 3]] = values[order[0]]
    with pytest.warns(GtpinWarning, match="temp_link is .* rows one after the other"):
        found = without_frozen(with_temperature(dataset, values))
    assert "temp_link" not in found.covariates
    assert found.unusable == {"temp_link"}


@pytest.mark.parametrize("step", [0.1, 0.5, 1.0])
def test_a_thermometer_of_coarse_steps_is_used(step):
    dataset = measured(5)
    coarse = np.round(np.asarray(dataset.covariates["temp_link"], dtype=float) / step) * step
    found = without_frozen(with_temperature(dataset, coarse))
    assert "temp_link" in found.covariates
