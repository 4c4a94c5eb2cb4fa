"""How probable it is that a proposed experiment settles the question."""

from dataclasses import replace

import numpy as np
import pytest
from linear_problems import calibrated, every_effect, hypothesis
from scipy.special import softmax
from scipy.stats import multivariate_normal

from gtpin.diagnosis.classes import ClassMember, ranked
from gtpin.diagnosis.discrimination import PROMISED, SIMULATED, Prediction, Rivals, discriminate
from gtpin.diagnosis.evidence import NOTHING
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.next_experiment import classes
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.result import Cause
from gtpin.diagnosis.smooth_terms import smooth_terms
from gtpin.diagnosis.trials import SESSIONS, Known, next_sessions
from gtpin.diagnosis.verdict import Conclusion

ROWS = np.arange(4)


def prediction(seed: int, size: float) -> Prediction:
    rng = np.random.default_rng(seed)
    return Prediction(size * rng.standard_normal((4, 2)), 0.5 * rng.standard_normal((4, 2, 3)))


def chance(rivals: Rivals, rounds: int = 1) -> float:
    return rivals.settling_probability(ROWS, np.random.default_rng(5), rounds)


def test_the_probability_is_that_of_measurements_drawn_from_the_members() -> None:
    share, heat = np.array([0.6, 0.4]), 2.5
    members = [prediction(seed, 1.8) for seed in (1, 2)]
    densities = []
    for p in members:
        L = p.spread.reshape(8, 3)
        densities.append(multivariate_normal(p.mean.ravel(), np.eye(8) + L @ L.T))
    rng, settled = np.random.default_rng(0), []
    for true, weight in enumerate(share):
        drawn = densities[true].rvs(40_000, random_state=rng)
        log = np.log(share) + np.stack([d.logpdf(drawn) for d in densities], axis=1) / heat
        settled.append(weight * np.mean(softmax(log, axis=1).max(axis=1) >= 0.95))
    exact = sum(settled)
    assert 0.1 < exact < 0.9
    found = chance(Rivals(members, share, 2, heat))
    assert found == pytest.approx(exact, abs=4.0 * np.sqrt(exact * (1.0 - exact) / SIMULATED))


def test_members_with_the_same_prediction_are_never_settled() -> None:
    same = prediction(1, 2.0)
    rivals = Rivals([same, same], (0.6, 0.4), 2, 2.0)
    assert chance(rivals, 5) == 0.0
    assert rivals.rounds_needed(ROWS, np.random.default_rng(0)) == (0.0, None)


def test_a_smooth_term_with_the_prediction_of_the_leader_keeps_the_question_open() -> None:
    leader, other = prediction(1, 20.0), prediction(2, 20.0)
    assert chance(Rivals([leader, other], (0.6, 0.3), 2, 2.0)) > 0.9
    assert chance(Rivals([leader, other, leader], (0.6, 0.3, 0.1), 2, 2.0)) < 0.5


def test_a_higher_temperature_settles_less_and_more_rounds_settle_more() -> None:
    members = [prediction(seed, 1.5) for seed in (1, 2)]
    cool, hot = (Rivals(members, (0.5, 0.5), 2, heat) for heat in (2.0, 4.0))
    assert chance(cool) > chance(hot)
    probability, rounds = hot.rounds_needed(ROWS, np.random.default_rng(3))
    assert probability < PROMISED
    assert rounds is not None
    assert rounds > 1


@pytest.mark.slow
def test_a_cause_alone_in_its_class_is_distinguished_from_the_next_hypothesis() -> None:
    observed, baseline = calibrated()
    known = Known(observed, baseline.model, observed.operating_points(baseline.model).references)
    design = observed.design(baseline.model)
    cause, *others = (hypothesis(f"{name}@cart2") for name in ("linearity", "straightness", "backlash"))
    smooth = list(smooth_terms(design.operating_points, PRIORS))
    hypotheses = HypothesisSet(design, (cause, *others), (), smooth, every_effect())
    model = hypotheses.extended(NOTHING, cause)
    found = Conclusion(model, {cause: (ClassMember(cause, 0.7),)}, ())
    (of_cause,) = classes(found, [Cause("linearity", "cart2", 0.7, (), {}, 0.5)], hypotheses)
    every = ranked(hypotheses, model, cause)
    second = next(m.hypothesis for m in every.named if m.hypothesis != cause)
    assert [member for member, _ in of_cause.members] == [cause, second]
    assert of_cause.smooth == every.smooth[:3]
    experiment = discriminate(known, [of_cause], 0, 20, np.random.default_rng(0))
    assert experiment.separates == (str(cause), str(second))
    sure = replace(found, classes={cause: (ClassMember(cause, 0.97),)})
    (of_cause,) = classes(sure, [Cause("linearity", "cart2", 0.97, (), {}, 0.5)], hypotheses)
    assert len(of_cause.members) == 1


def test_names_of_further_sessions_are_new_and_different() -> None:
    for known in (["0", "1", "12"], ["monday", "next 2"], ["next"]):
        names = next_sessions(np.array(known, dtype=object), SESSIONS)
        assert len(set(names)) == SESSIONS
        assert not set(names) & set(known)
