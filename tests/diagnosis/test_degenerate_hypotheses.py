"""A search ends with finite evidence whatever displacements its hypotheses have: none, equal ones, multiples, a single row."""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

import gtpin
from gtpin.diagnosis.classes import class_of, ranked
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Posterior
from gtpin.diagnosis.hypothesis import Hypothesis, Scope, SmoothTerm, Term
from gtpin.diagnosis.hypothesis_set import HypothesisSet, causes, scales
from gtpin.diagnosis.periodic_lines import with_lines_reestimated
from gtpin.diagnosis.priors import PRIORS
from gtpin.diagnosis.search import search
from gtpin.diagnosis.verdict import decide
from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.rack import RackPeriodic
from gtpin.instruments.readings import Readings
from gtpin.kinematics.kinematics import Kinematics
from gtpin.robot.geometry import Geometry

ROWS = 12
SCOPE = Scope((), frozenset(), 0.01, PRIORS)
KINDS = ("none", "one_row", "equal", "multiple", "sum", "own", "large", "small")
"""How the columns of a drawn hypothesis are made, some of them out of those of the one before."""


@cache
def arm() -> Any:
    return Kinematics(Geometry.nominal(gtpin.load_robot("ur5")))


@dataclass(frozen=True)
class Drawn(Effect):
    """An effect with any displacements of one joint's travel."""

    columns: np.ndarray
    number: int

    @property
    def id(self) -> str:  # type: ignore[override]
        return f"drawn{self.number}"

    def __hash__(self) -> int:
        return self.number

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Drawn) and other.number == self.number

    def sites(self, robot):
        return (*robot.sites, *robot.sites)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        return along_track(at, site, self.columns, np.ones(self.columns.shape[1]))


class Lines(RackPeriodic):
    """Few periods, the whole turn first, some of them equal, with any rule for those that are distinguished."""

    def __init__(self, periods: list[float], apart: float) -> None:
        self.periods, self.apart = periods, apart

    def nonlinear_values(self, at, site):
        return self.periods

    def resolved(self, at, site, values, others):
        if not len(others):
            return np.ones(len(values), dtype=bool)
        away = np.abs(1.0 / np.asarray(values)[:, None] - 1.0 / np.asarray(others)).min(axis=1)
        return np.asarray(away * 2.0 * np.pi >= self.apart)


@st.composite
def problems(draw: st.DrawFn) -> HypothesisSet:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    q = rng.uniform(-2.0, 2.0, (ROWS, 6))
    if draw(st.booleans()):  # few different commands of each joint
        q = np.round(q)
    design = of_arm(q)
    at = design.operating_points
    columns = [1e-4 * rng.standard_normal((ROWS, 2))]
    for kind in draw(st.lists(st.sampled_from(KINDS), max_size=5)):
        columns.append(_columns(kind, columns[-1], rng))
    linear = [Hypothesis(Drawn(c, i), at.robot.sites[draw(st.integers(0, 1))]) for i, c in enumerate(columns)]
    periods = draw(st.lists(st.sampled_from([2.0 * np.pi, 3.0, 2.0, 1.0, 0.7, 0.5, 0.4]), min_size=1, max_size=9))
    lines = Lines(periods, draw(st.sampled_from([0.0, 0.5, 2.0, 50.0])))
    scanned = [Hypothesis(lines, site) for site in at.robot.sites[: draw(st.integers(0, 2))]]
    smooth = [(SmoothTerm("arm", ("time",), "tip"), linear[-1].basis(at))] if draw(st.booleans()) else []
    # Geometry of any rank: columns of hypotheses, and zeros.
    B = np.hstack([design.columns(h.basis(at)) for h in linear[: draw(st.integers(0, 2))]] + [np.zeros((3 * ROWS, 1))])
    true = rng.choice(len(linear) + len(scanned), 2)
    signal = np.zeros(3 * ROWS)
    for k in true:
        if k < len(linear):
            signal += design.columns(linear[k].basis(at)) @ rng.normal(0.0, 3.0, linear[k].basis(at).sigma.size)
        else:
            for period in periods[:3]:
                X = design.columns(lines.basis(at, scanned[k - len(linear)].site, period))
                signal += X @ (rng.normal(0.0, 1.0, X.shape[1]) * draw(st.sampled_from([1.0, 30.0, 1e3])))
    y = signal + rng.standard_normal(3 * ROWS)
    return HypothesisSet(replace(design, y=y, B=B, n_prior=B.shape[1]), linear, scanned, smooth, SCOPE)


def _columns(kind: str, before: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    one_row = np.zeros((ROWS, 1))
    one_row[rng.integers(ROWS)] = 1e-3
    own = 1e-4 * rng.standard_normal((ROWS, 2))
    return {
        "none": np.zeros((ROWS, 2)),
        "one_row": one_row,
        "equal": before,
        "multiple": 3.0 * before,
        "sum": np.hstack([before, before.sum(axis=1, keepdims=True), 0.0 * before]),
        "own": own,
        "large": 1e4 * own,
        "small": 1e-9 * own,
    }[kind]


def of_arm(q: np.ndarray) -> Design:
    """Measured positions without a deviation, in units of 0.1 mm."""
    at = OperatingPoints(arm(), q, arm().forward(q), {})
    rows = len(q)
    return Design(
        at,
        np.broadcast_to(np.eye(3) * 1e4, (rows, 3, 3)),
        gtpin.Model(at.kinematics.geometry),
        np.zeros(3 * rows),
        np.zeros((3 * rows, 0)),
        0,
        0,
        Readings.of_poses(q, at.poses.T, None, at.robot),
    )


def check(hypotheses: HypothesisSet, model: Posterior[Term]) -> None:
    places = [term.place for term in causes(model)]
    assert len(set(places)) == len(places)
    for cause in causes(model):
        assert len(set(cause.values)) == len(cause.values)
    for part in (model.log_evidence, model.mean, model.covariance, hypotheses.log_posterior(model)):
        assert np.isfinite(part).all()
    y, B = hypotheses.design.y, hypotheses.design.B
    nothing = np.eye(len(y)) + B @ B.T
    groups = hypotheses.groups
    whole = nothing + sum(s**2 * groups.columns(t) @ groups.columns(t).T for t, s in scales(model).items())
    if np.linalg.cond(whole) > 1e8:
        return
    dense = [multivariate_normal(np.zeros(len(y)), C, allow_singular=True).logpdf(y) for C in (whole, nothing)]
    prior = -0.5 * sum((np.log(s) / PRIORS.scale_spread) ** 2 for s in model.scale)
    assert model.log_evidence == pytest.approx(dense[0] - dense[1] + prior, rel=1e-4, abs=1e-3)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(hypotheses=problems())
def test_a_search_over_any_hypotheses_ends_with_finite_evidence(hypotheses: HypothesisSet) -> None:
    alone = hypotheses.gains(NOTHING, hypotheses.every)
    assert np.isfinite([gain.value for gain in alone.values()]).all()
    model = search(hypotheses, hypotheses.every)
    check(hypotheses, model)
    for cause in causes(model):
        members = class_of(hypotheses, model, cause)
        assert sum(m.probability for m in members) <= 1.0 + 1e-6


@pytest.mark.parametrize("size", [10.0, 100.0])  # each line gains more than it costs
def test_a_line_that_can_t_be_told_from_the_others_stays_as_it_is(size: float) -> None:
    rng = np.random.default_rng(5)
    q = rng.uniform(-2.0, 2.0, (40, 6))
    design, turn = of_arm(q), 2.0 * np.pi
    lines, site = Lines([turn, 3.0, 2.0], apart=50.0), "shoulder_pan_joint"
    X = np.hstack([design.columns(lines.basis(design.operating_points, site, p)) for p in (turn, 3.0)])
    y = X @ (size * rng.standard_normal(X.shape[1])) + rng.standard_normal(len(X))
    hypotheses = HypothesisSet(replace(design, y=y), (), (Hypothesis(lines, site),), (), SCOPE)
    cause = Hypothesis(lines, site, turn, 0.01, (3.0,), (0.01,))
    model = hypotheses.of((cause,), (1.0,))
    found = with_lines_reestimated(hypotheses, model)
    assert causes(found) == (cause,)
    check(hypotheses, found)


class Tip(Drawn):
    """A motion of the tip that is the same at whatever site it is said to act."""

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        return Displacement(np.ones(2), twist=self.columns)


def test_what_explains_as_much_as_a_cause_is_in_its_class_though_it_could_imitate_another_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(3)
    q = rng.uniform(-2.0, 2.0, (60, 6))
    design, twist = of_arm(q), 1e-4 * rng.standard_normal((60, 6, 2))
    at = design.operating_points
    strong = Hypothesis(Drawn(1e-4 * rng.standard_normal((60, 2)), 0), at.robot.sites[1])
    imitator, elsewhere = (Hypothesis(Tip(twist, i), at.robot.sites[k]) for i, k in ((1, 1), (2, 3)))
    signal = 30.0 * design.columns(strong.basis(at)).sum(axis=1) + 5.0 * design.columns(imitator.basis(at)).sum(axis=1)
    y = signal + rng.standard_normal(len(signal))
    hypotheses = HypothesisSet(replace(design, y=y), (strong, imitator, elsewhere), (), (), SCOPE)
    monkeypatch.setattr(HypothesisSet, "share", lambda _, a, b: PRIORS.same if imitator in (a, b) else 0.0)
    model = hypotheses.of((strong, elsewhere), (1.0, 1.0))
    dear, cheap = (hypotheses.costs((strong, h))[h] for h in (imitator, elsewhere))
    assert dear > cheap + 100.0
    members = {m.hypothesis: m.probability for m in class_of(hypotheses, model, elsewhere)}
    assert members[elsewhere] > members[imitator] > 0.0


def test_many_that_explain_a_little_less_than_a_cause_are_no_smooth_term() -> None:
    """They have most of the probability, each too little for the class; but a smooth term has next to none."""
    rng = np.random.default_rng(4)
    design = of_arm(rng.uniform(-2.0, 2.0, (60, 6)))
    at, (own, off, apart) = design.operating_points, 1e-4 * rng.standard_normal((3, 60, 1))
    known = [Hypothesis(Drawn(own, 0), at.robot.sites[1])]
    known += [Hypothesis(Drawn(own + 0.3 * off, i), at.robot.sites[1]) for i in range(1, 80)]
    y = 3.0 * design.columns(known[0].basis(at))[:, 0] + rng.standard_normal(180)
    term, moved = SmoothTerm(at.robot.sites[2], ("q3",), "along"), along_track(at, at.robot.sites[2], apart, np.ones(1))
    hypotheses = HypothesisSet(replace(design, y=y), known, (), [(term, moved)], SCOPE)
    found = decide(hypotheses)
    ((cause, members),) = found.classes.items()
    every = ranked(hypotheses, found.model, cause)
    assert members == (every.named[0],)
    assert every.smooth[0][1] < members[0].probability < 0.5
    assert not found.doubts


def test_an_effect_that_names_a_site_twice_acts_there_once() -> None:
    robot = gtpin.load_robot("ur5")
    effect = Drawn(np.zeros((ROWS, 1)), 1)
    found = list(Scope((effect,), frozenset(), 0.01).hypotheses(robot))
    assert [h.site for h in found] == list(robot.sites)
