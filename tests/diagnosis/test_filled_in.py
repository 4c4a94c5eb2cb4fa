"""Columns that are constant and can't have been recorded so count as missing; what people state of a measurement is kept."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.diagnosis.preparation.prepare import without_filled_in
from gtpin.errors import GtpinWarning


def constant(data, **columns):
    filled = {name: np.full(len(data), value) for name, value in columns.items()}
    return replace(data, covariates={**data.covariates, **filled})


@pytest.fixture(scope="module")
def backlash():
    return make_case(661, effects=[("backlash", "cart1")], energy=1500.0, poses=130, held_out=1).dataset


NEVER = {"approach1": 1.0, "approach2": -1.0, "time": 0.0, "temp_frame": 20.0, "temp_link": 0.0, "speed1": 0.1}
STATED = [("payload", 0.0), ("payload", 10.0), ("fz", -50.0), ("speed1", 0.0), ("session", "day1")]


@pytest.mark.parametrize(("column", "value"), list(NEVER.items()))
def test_a_constant_that_nobody_can_have_recorded_counts_as_missing(backlash, column, value):
    with pytest.warns(GtpinWarning, match=f"taken as not recorded: {column}$"):
        assert column not in without_filled_in(constant(backlash, **{column: value})).covariates


@pytest.mark.parametrize(("column", "value"), STATED)
def test_a_constant_that_states_something_is_kept(backlash, column, value):
    data = constant(backlash, **{column: value})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert column in without_filled_in(data).covariates


@pytest.mark.slow
def test_backlash_without_approaches_is_not_taken_for_a_sure_lag(backlash):
    filled = constant(backlash, approach1=1.0, approach2=1.0, approach3=1.0)
    with pytest.warns(GtpinWarning, match="taken as not recorded: approach1, approach2, approach3"):
        found = gtpin.diagnose(filled)
    missing = {n: v for n, v in backlash.covariates.items() if not n.startswith("approach")}
    left_out = gtpin.diagnose(replace(backlash, covariates=missing))
    assert found.verdict == left_out.verdict != "explained"
    assert [(c.effect, c.site) for c in found.causes] == [(c.effect, c.site) for c in left_out.causes]


@pytest.mark.slow
def test_marks_of_a_logger_are_set_aside_by_name_and_change_no_cause(backlash):
    temperature = backlash.covariates["temp_frame"].copy()
    temperature[[3, 40]] = -999.0
    with pytest.warns(GtpinWarning, match="temp_frame of -999 is no reading"):
        found = gtpin.diagnose(replace(backlash, covariates={**backlash.covariates, "temp_frame": temperature}))
    assert {str(pose) for pose in backlash.pose[[3, 40]]} <= set(found.set_aside)
    assert [(c.effect, c.site) for c in found.causes] == [("backlash", "cart1")]
