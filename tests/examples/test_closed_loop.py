"""The parts of the closed loop: rows are added as they were measured, and what counts as settled."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gtpin.bench.simulator import make_case
from gtpin.diagnosis.result import Cause, Member

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "next_experiment"))

import closed_loop
from again import again

TRUE, OTHER = ("linearity", "cart2"), ("straightness", "cart2")


def cause(probability: float, *members: tuple[str, str]) -> Cause:
    listed = tuple(Member(effect, site, probability if i == 0 else 0.1) for i, (effect, site) in enumerate(members))
    return Cause(*members[0], probability, listed, {}, 0.5)


@pytest.mark.parametrize(
    ("causes", "expected"),
    [
        ([cause(0.96, TRUE)], "right"),
        ([cause(0.96, OTHER)], "wrong"),
        ([cause(0.8, TRUE, OTHER)], "open"),
        ([cause(0.8, OTHER, TRUE)], "open"),
        ([cause(0.8, OTHER)], "lost"),
        ([], "lost"),
        ([cause(0.99, ("backlash", "cart1")), cause(0.96, TRUE)], "right"),
        ([cause(0.99, ("backlash", "cart1"))], "lost"),
    ],
)
def test_a_cause_is_settled_only_where_it_is_the_true_one_and_sure(causes: list[Cause], expected: str) -> None:
    second: Any = SimpleNamespace(causes=causes)
    assert closed_loop.outcome(second, TRUE, cause(0.6, TRUE, OTHER)) == expected


@pytest.mark.slow
def test_further_rows_are_added_with_their_conditions_and_cold_ones_after_a_night() -> None:
    case = make_case(1, effects=[("linearity", "cart2")], poses=40, without=("session", "fx", "fy", "fz"))
    old = case.dataset
    count, cold = 6, old.conditions.reference_temperature
    given = {
        "session": np.array(["2", "1", "2", "1", "2", "1"], dtype=object),
        "fx": np.linspace(0.0, 50.0, count),
        "temp_frame": np.array([cold, cold + 5.0, cold + 5.0, cold + 5.0, cold + 5.0, cold + 5.0]),
        "temp_link": np.full(count, cold + 5.0),
    }
    both = again(case, old.q[:count], given, 0)
    assert len(both) == len(old) + count
    later = {name: np.asarray(values)[len(old) :] for name, values in both.covariates.items()}
    assert list(later["session"]) == ["1", "1", "1", "2", "2", "2"]
    assert set(both.covariates["session"][: len(old)]) == {"0"}
    assert not np.any(both.covariates["fx"][: len(old)])
    order = [1, 3, 5, 2, 4, 0]
    np.testing.assert_array_equal(both.q[len(old) :], old.q[order])
    np.testing.assert_array_equal(later["fx"], given["fx"][order])
    time = np.asarray(later["time"], dtype=float)
    assert (np.diff(time) > 0.0).all()
    assert np.diff(time)[-1] > 8.0 * 3600.0 > np.diff(time)[:-1].max()
