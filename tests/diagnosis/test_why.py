"""What stands for and against one cause that a user asks for, and that asking changes nothing else."""

from functools import cache

import numpy as np
import pytest
from diagnosed import machine, quietly, said

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.diagnosis.result import Diagnosis, Why
from gtpin.report.why import why_words

FAULT = (1, "backlash", "cart1")
"""A machine with play in its first drive."""


@cache
def asked(word: str, *fault: object) -> Diagnosis:
    return quietly(gtpin.diagnose, machine(*fault).dataset, why=word)


def why(word: str, *fault: object) -> Why:
    found = asked(word, *fault).why
    assert found is not None
    return found


@pytest.mark.slow
def test_asking_changes_nothing_else():
    before, after = said(*FAULT).to_json(), asked("servo_lag@cart1", *FAULT).to_json()
    told, experiments = after.pop("why"), after.pop("next_experiment")
    assert (told["effect"], told["site"]) == ("servo_lag", "cart1")
    known = before.pop("next_experiment")
    assert experiments[: len(known)] == known
    assert len(experiments) <= len(known) + 1
    assert after == before


def test_a_cause_that_is_named_makes_the_errors_smaller_by_its_part():
    found = asked("backlash@cart1", *FAULT)
    told = why("backlash@cart1", *FAULT)
    assert told.standing == "named"
    assert told.probability == found.causes[0].probability
    assert told.left_out is not None
    assert told.left_out.geometry == pytest.approx(found.gap.before)
    assert told.left_out.with_it == pytest.approx(found.gap.after)
    assert told.left_out.with_it < 0.9 * told.left_out.without
    assert told.beside > told.needed
    # A machine with this fault alone: what is fitted without and with all else is the same.
    alone, fitted = told.parameters["half_width"], found.causes[0].parameters["half_width"]
    assert abs(alone.value - fitted.value) < 3.0 * np.hypot(alone.sigma, fitted.sigma)


@pytest.mark.slow
def test_what_only_looks_like_a_cause_has_the_cause_as_its_first_rival():
    told = why("linearity@cart1", 1, "rack_periodic", "cart1")
    assert told.standing in ("taken", "beside", "class", "weak")
    if told.standing != "weak":
        assert (told.rivals[0].effect, told.rivals[0].site) == ("rack_periodic", "cart1")
        assert told.rivals[0].log_evidence > told.in_place
    assert told.beside < told.needed
    found = asked("linearity@cart1", 1, "rack_periodic", "cart1")
    candidate = next(c for c in found.candidates if (c.effect, c.site) == ("linearity", "cart1"))
    assert told.log_evidence == candidate.log_evidence


@pytest.mark.slow
def test_poses_that_would_tell_are_planned_for_it_and_its_rival():
    found, told = (
        asked("linearity@cart1", 1, "rack_periodic", "cart1"),
        why("linearity@cart1", 1, "rack_periodic", "cart1"),
    )
    assert told.experiment is not None
    assert told.experiment in found.next_experiment
    assert "linearity@cart1" in told.experiment.separates
    assert told.experiment.expected_gain is not None
    assert told.experiment.expected_gain > 0.0


def test_nothing_speaks_for_a_cause_of_a_machine_without_one():
    told = why("backlash@cart2", 1)
    assert told.standing == "weak"
    assert told.log_evidence < told.odds
    assert abs(told.parameters["half_width"].value) < 4.0 * told.parameters["half_width"].sigma


def test_of_what_was_not_recorded_it_says_what_to_record():
    case = make_case(1, effects=[], poses=100, without=("approach",))
    found = quietly(gtpin.diagnose, case.dataset, why="backlash@cart2")
    assert found.why is not None
    assert found.why.standing == "untestable"
    assert found.why.reason is not None
    assert found.why.reason.covariate == "approach2"
    assert found.why.experiment in found.next_experiment
    assert why_words(found, found.why).endswith("because the covariate approach2 is missing.")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plate_bending", "cable_chain"])
def test_beside_something_unknown_the_leader_is_told_with_what_smooth_terms_take_from_it(kind: str):
    first = said(1, kind).unexplained.leaders[0]
    word = f"{first.effect}@{first.site}"
    found, told = asked(word, 1, kind), why(word, 1, kind)
    assert found.verdict == "unknown"
    assert told.standing not in ("named", "untestable")
    assert told.smooth
    assert told.beside_smooth < told.beside
    assert told.left_out is not None
    assert told.left_out.with_it == pytest.approx(found.unexplained.could_be[first.effect, first.site])
    assert any(not one.effect for one in told.rivals) or told.standing == "weak"


@pytest.mark.parametrize(
    ("word", "near"),
    [
        ("backlsh@cart1", "backlash@cart1"),
        ("backlash@cart9", "backlash@cart"),
        ("backlash", "backlash@cart1"),
        ("", "@"),
    ],
)
def test_an_effect_or_a_site_that_does_not_exist_is_refused_with_the_nearest(word: str, near: str):
    with pytest.raises(gtpin.GtpinError, match=near) as refused:
        gtpin.diagnose(machine(*FAULT).dataset, why=word)
    assert "diagnosis.json" in str(refused.value)


def test_what_is_excluded_and_a_check_are_refused():
    dataset = machine(*FAULT).dataset
    with pytest.raises(gtpin.GtpinError, match="excluded"):
        gtpin.diagnose(dataset, why="backlash@cart1", exclude=["backlash"])
    model = gtpin.calibrate(dataset).model
    with pytest.raises(gtpin.GtpinError, match="earlier model"):
        gtpin.diagnose(dataset, against=model, why="backlash@cart1")  # type: ignore[call-overload]
