"""A cause that no machine can have: the others of its class take its place, and its share."""

import warnings

import numpy as np
import pytest
from diagnosed import machine

import gtpin
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.propose import propose
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.inference.findings import Question
from gtpin.diagnosis.inference.questions import with_possible, without_impossible
from gtpin.diagnosis.inference.verdict import Conclusion, Contender
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.linear.posterior import NOTHING


@pytest.fixture(scope="module")
def hypotheses() -> HypothesisSet:
    dataset = machine(5, "backlash", "cart1").dataset
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        baseline = gtpin.calibrate(dataset)
    design = Observed.of(dataset.take(baseline.used(dataset)), baseline).design(baseline.model)
    return propose(design, Scope.of(gtpin.catalogue(), (), 0.01, baseline.model.robot)).hypotheses


def concluded(hypotheses: HypothesisSet, *shares: float) -> Conclusion:
    """A conclusion with one cause, whose class has a member for each share."""
    members = tuple(Contender(h, share) for h, share in zip(hypotheses.linear, shares, strict=False))
    model = hypotheses.extended(NOTHING, members[0].hypothesis)
    return Conclusion(model, {members[0].hypothesis: members}, (), {})


def impossible(found: Conclusion) -> Question:
    (cause,) = found.classes
    return Question(*cause.place, "scale", -1.0, 0.1, "m/m", 0.0, np.inf, "nobody has it", False)


def test_the_next_of_the_class_is_the_cause_with_what_the_others_leave_of_the_probability(
    hypotheses: HypothesisSet,
) -> None:
    found = concluded(hypotheses, 0.5, 0.3, 0.1)
    other = with_possible(hypotheses, found, [impossible(found)])
    assert other is not None
    ((cause, members),) = other.classes.items()
    assert cause == hypotheses.linear[1]
    assert other.model.terms == (cause,)
    np.testing.assert_allclose([m.probability for m in members], [0.75, 0.25], rtol=1e-12)


def test_without_another_member_there_is_none(hypotheses: HypothesisSet) -> None:
    found = concluded(hypotheses, 1.0)
    assert with_possible(hypotheses, found, [impossible(found)]) is None


def test_what_only_a_proxy_shows_takes_no_place(hypotheses: HypothesisSet) -> None:
    found = concluded(hypotheses, 0.6)
    (cause,) = found.classes
    unrecorded = Contender(hypotheses.linear[2], 0.4, recorded=False)
    found = Conclusion(found.model, {cause: (*found.classes[cause], unrecorded)}, (), {})
    assert with_possible(hypotheses, found, [impossible(found)]) is None


def test_causes_that_are_named_only_beside_an_impossible_one_are_dropped(hypotheses: HypothesisSet) -> None:
    first, second, third = hypotheses.linear[:3]
    model = hypotheses.of([first, second, third], [1.0, 1.0, 1.0])
    found = Conclusion(model, {c: (Contender(c, 1.0),) for c in (first, second, third)}, (), {})
    asked = Question(*first.place, "scale", -1.0, 0.1, "m/m", 0.0, np.inf, "nobody has it", False)
    left = without_impossible(hypotheses, found, [asked], {first.place, third.place})
    assert tuple(left.classes) == (third,)
    assert [(doubt.reason, doubt.site) for doubt in left.doubts] == [("impossible", first.site)]
