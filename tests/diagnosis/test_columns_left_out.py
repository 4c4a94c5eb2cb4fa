"""Columns that can't be right (contradicting, filled in, frozen) are not used, and no cause is named for what they hide."""

import warnings
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from diagnosed import quietly

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.diagnosis.prepare import without_contradictions, without_filled_in, without_frozen
from gtpin.effects.untestable import Untestable
from gtpin.errors import GtpinWarning

CONDITIONS = SimulatedConditions(rest=0.4, sessions=3)


@cache
def measured(seed: int, *effects: tuple[str, str]) -> gtpin.Dataset:
    return make_case(
        seed, effects=list(effects), noncentrality=1500.0, poses=130, held_out=1, conditions=CONDITIONS
    ).dataset


def with_columns(dataset: gtpin.Dataset, **columns: Any) -> gtpin.Dataset:
    """The dataset with other columns: (N,) values, or one value for all rows."""
    filled = {name: np.resize(np.asarray(value), len(dataset)) for name, value in columns.items()}
    return replace(dataset, covariates={**dataset.covariates, **filled})


def with_rows_mixed(dataset: gtpin.Dataset, prefix: str) -> gtpin.Dataset:
    order = np.random.default_rng(1).permutation(len(dataset))
    mixed = {n: v[order] if n.startswith(prefix) else v for n, v in dataset.covariates.items()}
    return replace(dataset, covariates=mixed)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_columns_as_they_were_recorded_are_kept(seed: int) -> None:
    dataset = measured(seed)
    assert without_contradictions(dataset) is without_frozen(dataset) is dataset


@pytest.mark.parametrize("prefix", ["approach", "speed"])
def test_directions_or_speeds_of_other_rows_are_left_out_with_a_warning(prefix: str) -> None:
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        found = without_contradictions(with_rows_mixed(measured(4), prefix))
    assert [f"approach{i} and speed{i} contradict" in str(w.message) for i, w in enumerate(heard, 1)] == [True] * 3
    assert not [name for name in found.covariates if name.startswith(("approach", "speed"))]


def test_reversed_directions_agree_but_for_their_sign() -> None:
    dataset = measured(5)
    dataset = with_columns(dataset, **{n: -v for n, v in dataset.covariates.items() if n.startswith("approach")})
    assert without_contradictions(dataset) is dataset


def test_sessions_of_other_rows_are_left_out_and_clocks_that_begin_anew_are_not() -> None:
    dataset = measured(6)
    with pytest.warns(GtpinWarning, match="the column session is in order neither"):
        assert "session" not in without_contradictions(with_rows_mixed(dataset, "session")).covariates
    ordered = dataset.take(np.argsort(dataset.covariates["time"]))
    session = ordered.covariates["session"]
    time = np.asarray(ordered.covariates["time"], dtype=float).copy()
    for name in np.unique(session.astype(str)):
        own = session.astype(str) == name
        time[own] -= time[own].min()
    anew = replace(ordered, covariates={**ordered.covariates, "time": time}, row=np.arange(2, len(ordered) + 2))
    assert without_contradictions(anew) is anew


@pytest.mark.slow
def test_backlash_with_directions_of_other_rows_is_called_nothing_else() -> None:
    found = quietly(gtpin.diagnose, with_rows_mixed(measured(7, ("backlash", "cart1")), "approach"))
    assert not [c for c in found.causes if c.probability >= 0.95 and c.effect != "backlash"]


@pytest.mark.slow
@pytest.mark.study
def test_commands_that_were_cut_off_name_no_cause() -> None:
    dataset = measured(8)
    cut = replace(dataset, q=np.trunc(dataset.q / 1e-4) * 1e-4, pose=np.arange(len(dataset)).astype(str).astype(object))
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        found = gtpin.diagnose(cut)
    assert any("commands have steps of 0.1 mm" in str(w.message) for w in heard)
    assert found.causes == ()
    assert found.verdict == "unknown"


def in_sessions(dataset: gtpin.Dataset, count: int) -> gtpin.Dataset:
    """The rows in the order of time, in sessions of equal size."""
    ordered = dataset.take(np.argsort(dataset.covariates["time"]))
    labels = [f"2026-03-01 10:{i:04d}" for i in np.arange(len(ordered)) * count // len(ordered)]
    return with_columns(ordered, session=np.array(labels, dtype=object))


def test_a_session_of_its_own_in_every_row_is_left_out_as_a_time() -> None:
    stamped = in_sessions(measured(8), len(measured(8)))
    with pytest.warns(GtpinWarning, match="every row has its own session: looks like a time"):
        assert "session" not in without_contradictions(stamped).covariates


@pytest.mark.slow
@pytest.mark.parametrize("count", [31, 75, 100])
def test_too_many_or_too_short_sessions_are_left_out(count: int) -> None:
    with pytest.warns(GtpinWarning, match=rf"{count} sessions in \d+ rows: up to 30 sessions of 2 rows or more"):
        assert "session" not in without_contradictions(in_sessions(measured(8), count)).covariates
    kept = in_sessions(measured(8), 30)
    assert without_contradictions(kept) is kept


@pytest.mark.slow
def test_a_session_in_every_row_makes_its_effects_untestable_for_that_reason() -> None:
    dataset = measured(8).take(np.arange(60))
    stamped = quietly(gtpin.diagnose, in_sessions(dataset, len(dataset)))
    reasons = {
        c.reason
        for c in stamped.candidates
        if "session" in stamped.effect(c.effect).covariates(stamped.model.robot, c.site)
    }
    assert reasons == {Untestable("unusable", "session")}


def test_a_temperature_that_stands_still_in_a_third_of_the_rows_is_not_used():
    dataset = measured(4)
    values = np.asarray(dataset.covariates["temp_link"], dtype=float).copy()
    order = np.argsort(dataset.covariates["time"])
    values[order[: len(values) // 3]] = values[order[0]]
    with pytest.warns(GtpinWarning, match="temp_link is .* rows one after the other"):
        found = without_frozen(with_columns(dataset, temp_link=values))
    assert "temp_link" not in found.covariates
    assert found.unusable == {"temp_link"}


@pytest.mark.parametrize("step", [0.1, 0.5, 1.0])
def test_a_thermometer_of_coarse_steps_is_used(step):
    dataset = measured(5)
    coarse = np.round(np.asarray(dataset.covariates["temp_link"], dtype=float) / step) * step
    found = without_frozen(with_columns(dataset, temp_link=coarse))
    assert "temp_link" in found.covariates


@pytest.fixture(scope="module")
def backlash():
    return measured(661, ("backlash", "cart1"))


NEVER = {"approach1": 1.0, "approach2": -1.0, "time": 0.0, "temp_frame": 20.0, "temp_link": 0.0, "speed1": 0.1}
STATED = [("payload", 0.0), ("payload", 10.0), ("fz", -50.0), ("speed1", 0.0), ("session", "day1")]


@pytest.mark.parametrize(("column", "value"), list(NEVER.items()))
def test_a_constant_that_nobody_can_have_recorded_counts_as_missing(backlash, column, value):
    with pytest.warns(GtpinWarning, match=f"taken as not recorded: {column}$"):
        assert column not in without_filled_in(with_columns(backlash, **{column: value})).covariates


@pytest.mark.parametrize(("column", "value"), STATED)
def test_a_constant_that_states_something_is_kept(backlash, column, value):
    data = with_columns(backlash, **{column: value})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert column in without_filled_in(data).covariates


@pytest.mark.slow
def test_backlash_without_approaches_is_not_taken_for_a_sure_lag(backlash):
    filled = with_columns(backlash, approach1=1.0, approach2=1.0, approach3=1.0)
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
        found = gtpin.diagnose(with_columns(backlash, temp_frame=temperature))
    assert {str(pose) for pose in backlash.pose[[3, 40]]} <= set(found.set_aside)
    assert [(c.effect, c.site) for c in found.causes] == [("backlash", "cart1")]
