"""Columns that contradict each other are not used, and no cause is named for what they hide."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.recipe import Conditions
from gtpin.diagnosis.preparation.prepare import without_contradictions
from gtpin.effects.untestable import Untestable
from gtpin.errors import GtpinWarning

CONDITIONS = Conditions(rest=0.4, sessions=3)


def measured(seed: int, effects: list[tuple[str, str]]) -> gtpin.Dataset:
    return make_case(seed, effects=effects, energy=1500.0, poses=130, held_out=1, conditions=CONDITIONS).dataset


def with_rows_mixed(dataset: gtpin.Dataset, prefix: str) -> gtpin.Dataset:
    order = np.random.default_rng(1).permutation(len(dataset))
    mixed = {n: v[order] if n.startswith(prefix) else v for n, v in dataset.covariates.items()}
    return replace(dataset, covariates=mixed)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_columns_as_they_were_recorded_are_kept(seed: int) -> None:
    dataset = measured(seed, [])
    assert without_contradictions(dataset) is dataset


@pytest.mark.parametrize("prefix", ["approach", "speed"])
def test_directions_or_speeds_of_other_rows_are_left_out_with_a_warning(prefix: str) -> None:
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", GtpinWarning)
        found = without_contradictions(with_rows_mixed(measured(4, []), prefix))
    assert [f"approach{i} and speed{i} contradict" in str(w.message) for i, w in enumerate(heard, 1)] == [True] * 3
    assert not [name for name in found.covariates if name.startswith(("approach", "speed"))]


def test_reversed_directions_agree_but_for_their_sign() -> None:
    dataset = measured(5, [])
    reversed_ = {n: -v if n.startswith("approach") else v for n, v in dataset.covariates.items()}
    dataset = replace(dataset, covariates=reversed_)
    assert without_contradictions(dataset) is dataset


def test_sessions_of_other_rows_are_left_out_and_clocks_that_begin_anew_are_not() -> None:
    dataset = measured(6, [])
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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        found = gtpin.diagnose(with_rows_mixed(measured(7, [("backlash", "cart1")]), "approach"))
    assert not [c for c in found.causes if c.probability >= 0.95 and c.effect != "backlash"]


@pytest.mark.slow
def test_commands_that_were_cut_off_name_no_cause() -> None:
    dataset = measured(8, [])
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
    return replace(ordered, covariates={**ordered.covariates, "session": np.array(labels, dtype=object)})


def test_a_session_of_its_own_in_every_row_is_left_out_as_a_time() -> None:
    stamped = in_sessions(measured(8, []), len(measured(8, [])))
    with pytest.warns(GtpinWarning, match="every row has its own session: looks like a time"):
        assert "session" not in without_contradictions(stamped).covariates


@pytest.mark.slow
@pytest.mark.parametrize("count", [31, 75, 100])
def test_too_many_or_too_short_sessions_are_left_out(count: int) -> None:
    with pytest.warns(GtpinWarning, match=rf"{count} sessions in \d+ rows: up to 30 sessions of 2 rows or more"):
        assert "session" not in without_contradictions(in_sessions(measured(8, []), count)).covariates
    kept = in_sessions(measured(8, []), 30)
    assert without_contradictions(kept) is kept


@pytest.mark.slow
def test_a_session_in_every_row_makes_its_effects_untestable_for_that_reason() -> None:
    dataset = measured(8, []).take(np.arange(60))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        stamped = gtpin.diagnose(in_sessions(dataset, len(dataset)))
    reasons = {
        c.reason
        for c in stamped.candidates
        if "session" in stamped.effect(c.effect).covariates(stamped.model.robot, c.site)
    }
    assert reasons == {Untestable("unusable", "session")}
