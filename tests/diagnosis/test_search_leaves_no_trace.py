"""What a search gives up changes nothing that it keeps: hypotheses and models are values."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from diagnosed import machine
from every_effect import every_effect

import gtpin
from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.hypotheses.propose import propose
from gtpin.diagnosis.inference.infer import decide
from gtpin.diagnosis.inference.search import rough_guess
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.linear.posterior import NOTHING

pytestmark = pytest.mark.slow


def design_of(effect: str, site: str) -> Design:
    dataset = machine(5, effect, site).dataset
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        baseline = gtpin.calibrate(dataset)
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
            assert other.nonlinear is not None
            hypotheses.extended(strange, replace(other, nonlinear=0.93 * other.nonlinear))


@pytest.mark.parametrize(
    ("effect", "site"), [("rack_periodic", "cart2"), ("rack_step", "cart1"), ("backlash", "cart3")]
)
def test_a_rejected_branch_changes_no_answer(effect, site):
    design = design_of(effect, site)
    first = propose(design, every_effect()).hypotheses
    second = propose(design, every_effect()).hypotheses
    # Effects are the same objects in both sets, so that hypotheses compare as values.
    wander(second)
    assert said(decide(first)) == said(decide(second))
    assert (effect, site) in {cause.place for cause in decide(first).classes}


def test_a_model_keeps_its_evidence_while_others_are_tried():
    hypotheses = propose(design_of("rack_periodic", "cart2"), every_effect()).hypotheses
    found = decide(hypotheses).model
    before = (found.log_evidence, found.mean.copy())
    wander(hypotheses)
    again = hypotheses.only(found, found.terms)
    assert again.log_evidence == pytest.approx(before[0], rel=1e-12)
    np.testing.assert_allclose(again.mean, before[1], rtol=1e-12, atol=1e-14)
    assert (found.mean == before[1]).all()
