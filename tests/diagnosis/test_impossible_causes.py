"""A cause that no machine can have is not named; and searches share no state."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed import machine, quietly
from linear_problems import every_effect

import gtpin
from gtpin.diagnosis.classes import ClassMember
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.doubts import without_impossible
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.result import Question
from gtpin.diagnosis.search import rough_guess
from gtpin.diagnosis.verdict import Conclusion, decide


@pytest.fixture(scope="module")
def hypotheses() -> HypothesisSet:
    dataset = machine(5, "backlash", "cart1").dataset
    baseline = quietly(gtpin.calibrate, dataset)
    design = Observed.of(dataset.take(baseline.used(dataset)), baseline).design(baseline.model)
    return propose(design, Scope.of(gtpin.catalogue(), (), 0.01, baseline.model.robot))


def test_causes_that_are_named_only_beside_an_impossible_one_are_dropped(hypotheses: HypothesisSet) -> None:
    first, second, third = hypotheses.linear[:3]
    model = hypotheses.of([first, second, third], [1.0, 1.0, 1.0])
    found = Conclusion(model, {c: (ClassMember(c, 1.0),) for c in (first, second, third)}, ())
    asked = Question(*first.place, "scale", -1.0, 0.1, "m/m", 0.0, np.inf, "nobody has it", False)
    left = without_impossible(hypotheses, found, [asked], {first.place, third.place})
    assert tuple(left.classes) == (third,)
    assert [(doubt.reason, doubt.site) for doubt in left.doubts] == [("impossible", first.site)]


def design_of(effect: str, site: str) -> Design:
    dataset = machine(5, effect, site).dataset
    baseline = quietly(gtpin.calibrate, dataset)
    used = dataset.take(baseline.used(dataset))
    return Observed.of(used, baseline).design(baseline.model)


def said(found: Conclusion) -> object:
    return found.verdict, found.model.terms, found.model.scale, found.model.log_evidence, found.classes


def wander(hypotheses: HypothesisSet) -> None:
    """Grow models that no search would keep, with other values of every nonlinear parameter."""
    rough_guess(hypotheses)
    strange = NOTHING
    for term in hypotheses.smooth[:3]:
        strange = hypotheses.extended(strange, term)
        for hypothesis in hypotheses.scanned:
            other = hypotheses.gains(strange, (hypothesis,))[hypothesis].term
            assert isinstance(other, Hypothesis)
            assert other.shape_parameter is not None
            hypotheses.extended(strange, replace(other, shape_parameter=0.93 * other.shape_parameter))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "site"), [("rack_periodic", "cart2"), ("rack_step", "cart1"), ("backlash", "cart3")]
)
def test_a_rejected_branch_changes_no_answer(effect, site):
    design = design_of(effect, site)
    first = propose(design, every_effect())
    second = propose(design, every_effect())
    # Effects are the same objects in both sets, so that hypotheses compare as values.
    wander(second)
    assert said(decide(first)) == said(decide(second))
    assert (effect, site) in {cause.place for cause in decide(first).classes}


@pytest.mark.slow
def test_a_model_keeps_its_evidence_while_others_are_tried():
    hypotheses = propose(design_of("rack_periodic", "cart2"), every_effect())
    found = decide(hypotheses).model
    before = (found.log_evidence, found.mean.copy())
    wander(hypotheses)
    again = hypotheses.only(found, found.terms)
    assert again.log_evidence == pytest.approx(before[0], rel=1e-12)
    np.testing.assert_allclose(again.mean, before[1], rtol=1e-12, atol=1e-14)
    assert (found.mean == before[1]).all()
