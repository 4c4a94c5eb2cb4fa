"""A check against a model that did not explain its own data: no changes are invented, and large ones are found."""

import sys
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import pytest
from checked_machines import later, machine

import gtpin
from gtpin.extras.history.history import Entry

EXAMPLES = Path(__file__).parents[2] / "examples"
if not EXAMPLES.is_dir():
    pytest.skip("needs the examples", allow_module_level=True)
sys.path[:0] = [str(EXAMPLES / "health"), str(EXAMPLES / "certificate")]

from unlisted import OneJoint, measured  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]


@cache
def arm() -> tuple[OneJoint, gtpin.Model]:
    one = OneJoint(77)
    return one, gtpin.calibrate(one.measured(0, 3, True)).model


@pytest.mark.parametrize(("error", "visits"), [("smooth", 1), ("smooth", 3), ("one joint", 1), ("one joint", 3)])
def test_errors_that_a_model_never_explained_are_no_change(error, visits):
    assert not any(row["alarm"] for row in measured(800, error, visits))


def test_a_change_that_is_larger_than_what_was_unexplained_is_found_and_smaller_ones_are_said_to_hide():
    one, model = arm()
    today = one.measured(1, 3, True)
    found = gtpin.diagnose(today, against=model)
    assert found.verdict == "none"
    assert found.unexplained_before.position > 5e-6
    assert found.to_json()["against"]["unexplained"]["position"] == found.unexplained_before.position
    size = next(s.value for s in found.smallest if (s.effect, s.site) == ("zero_shift", "j2"))
    q = today.q.copy()
    q[:, 1] -= 2.0 * size  # the controller believes the joint to be elsewhere
    assert gtpin.diagnose(replace(today, q=q), against=model).verdict != "none"


def test_without_what_was_unexplained_the_same_check_finds_a_change_that_is_none():
    one, model = arm()
    assert model.fit.misfit == 1.0
    blind = replace(model, unexplained=None)
    assert gtpin.diagnose(one.measured(1, 3, True), against=blind).verdict != "none"


def test_a_check_and_its_log_state_the_same_noise():
    case, model = machine(23)
    found = gtpin.diagnose(later(case, 1), against=model)
    assert Entry.of(found, datetime(2026, 1, 1, tzinfo=UTC)).noise_floor == found.to_json()["gap"]["noise_floor"]
