"""The measurements that best distinguish the members of a class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.diagnosis.evidence import Groups, Marginal
from gtpin.diagnosis.expected_bayes_factor import (
    Pair,
    Prediction,
    Rivals,
    Rows,
    expected_gain,
    most_telling,
)
from gtpin.diagnosis.experiment import Experiment
from gtpin.diagnosis.hypothesis import Hypothesis, SmoothTerm
from gtpin.diagnosis.measurement_conditions import kind, numbers
from gtpin.diagnosis.posterior import NOTHING, gain
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.diagnosis.smooth_terms import COMMON, smooth_terms
from gtpin.diagnosis.trials import Known, Trials, possible
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import Column
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

POOL = 200
"""Number of random rows from which the most informative are chosen."""
RIVALS = 3
"""Most members of a class from which its leader is distinguished."""
DRAWS = 5
"""Number of random choices with which a plan is compared."""
LEAST = 1.0
"""Log Bayes factor expected of the whole experiment, nats, below which another measurement than poses is also proposed."""
HOPELESS = 0.1
"""Log Bayes factor expected of the whole experiment, nats, below which no poses are proposed."""


@dataclass(frozen=True)
class CauseClass:
    """A fitted cause and its scale, with the members of its class and their probabilities; the cause is one of them.

    Where the cause is alone in its class and not sure, the next hypothesis in probability is added. ``heat``: the temperature
    of the diagnosis. ``smooth``: the most probable smooth terms in the place of the cause, each with its probability if it were
    the only one.
    """

    cause: Hypothesis
    scale: float
    members: tuple[tuple[Hypothesis, float], ...]
    heat: float = PRIORS.temperature
    smooth: tuple[tuple[SmoothTerm, float], ...] = ()
    priors: Priors = PRIORS


def discriminate(
    known: Known, classes: Sequence[CauseClass], which: int, poses: int, rng: np.random.Generator
) -> Experiment:
    """The experiment that best distinguishes the leader of a class from its most probable alternatives, given all other causes.

    A cause without an alternative is distinguished from no effect. ``which`` is the index of the class in ``classes``.
    """
    robot, own = known.robot, classes[which]
    members = sorted(own.members, key=lambda member: -member[1])[: RIVALS + 1]
    words = {word for hypothesis, _ in members for word in concerns(hypothesis, robot)}
    trials = possible(known, words, POOL, rng)
    others = other_causes(trials, [s for i, s in enumerate(classes) if i != which], words)
    at = trials.design.operating_points

    def prediction(basis: Displacement) -> Prediction:
        """The prediction of an explanation given the other causes, at the scale that the measured rows give it."""
        design, old = trials.design, trials.old
        X = design.columns(basis)
        groups: Groups[str] = Groups(Marginal(np.hstack([design.B, others])[old]), design.y[old])
        groups.add("it", X[old])
        return Prediction.of(trials, np.hstack([others, X * gain(groups, NOTHING, "it")[1]]))

    predictions = [prediction(hypothesis.basis(at)) for hypothesis, _ in members]
    probabilities = [p for _, p in members]
    if len(members) == 1:
        predictions.append(Prediction.of(trials, others))
        probabilities.append(1.0 - probabilities[0])
    # The probability of a single alternative can be zero.
    weights = probabilities[1:] if len(probabilities) > 2 else [1.0]
    pairs = [(*pair, p) for i, p in enumerate(weights, start=1) for pair in ((0, i), (i, 0))]
    rows, expected, random = best_rows(trials, predictions, pairs, poses, rng)
    effects = tuple(hypothesis.place for hypothesis, _ in members)
    sites = tuple(site for _, site in effects)
    found = Experiment(
        "discriminate",
        robot,
        effects,
        np.zeros((0, robot.n_actuators)),
        expected_gain=expected,
        random_gain=random,
        reference_temperature=known.observed.temperature,
        watch=sites,
    )
    if expected < HOPELESS:
        return found
    share = dict(own.smooth)
    smooth = [(t, b) for t, b in smooth_terms(at, own.priors) if t in share and t.motion not in COMMON] if share else []
    every = [*predictions, *(prediction(basis) for _, basis in smooth)]
    shares = [*probabilities, *(share[term] for term, _ in smooth)]
    settles, rounds = Rivals(every, shares, len(predictions), own.heat).rounds_needed(rows, rng)
    return replace(
        found,
        poses=trials.q[rows],
        covariates=chosen(trials, rows, words),
        settles=settles,
        rounds=rounds,
        watch=sites if expected < LEAST or rounds is None else (),
    )


def concerns(hypothesis: Hypothesis, robot: Chain) -> tuple[str, ...]:
    """Covariates and coordinates that a hypothesis depends on."""
    return (*hypothesis.covariates(robot), *hypothesis.effect.coordinates(robot, hypothesis.site))


def other_causes(trials: Trials, classes: Sequence[CauseClass], words: set[str]) -> Floats:
    """((N + M) c, m) whitened displacements of the other causes, at the scale of their priors, and of changes between sessions.

    Such changes (the pose of the instrument, the drives' zeros) are left out where ``words`` contains the session.
    """
    at = trials.design.operating_points
    columns = [trials.design.columns(s.cause.basis(at)) * s.scale for s in classes]
    return np.hstack([np.zeros((len(trials.design.y), 0)) if "session" in words else trials.since, *columns])


def best_rows(
    trials: Trials,
    predictions: Sequence[Prediction],
    pairs: Sequence[Pair],
    count: int,
    rng: np.random.Generator,
) -> tuple[Rows, float, float]:
    """The rows with the largest expected gain, in the order of measurement; this gain; and the mean gain of random rows."""
    rows = most_telling(predictions, pairs, count)
    drawn = [rng.choice(len(trials), len(rows), replace=False) for _ in range(DRAWS)]
    random = float(np.mean([expected_gain(predictions, pairs, r) for r in drawn]))
    return rows[_order(trials, rows)], expected_gain(predictions, pairs, rows), random


def _order(trials: Trials, rows: Rows) -> Rows:
    """Order of measurement: by session, warm before cold, by payload, then along the first actuator; or by time."""
    new = trials.conditions.new
    if trials.conditions.timed:
        return np.argsort(numbers(new["time"])[rows])
    keys = [trials.q[rows, 0]]
    if "payload" in new:
        keys.append(numbers(new["payload"])[rows])
    keys += [-numbers(new[name])[rows] for name in new if kind(name) == "temperature"][:1]
    if "session" in new:
        keys.append(np.unique(new["session"][rows].astype(str), return_inverse=True)[1])
    return np.lexsort(keys)


def chosen(trials: Trials, rows: Rows, words: set[str]) -> Mapping[str, Column]:
    """The covariates to set at the chosen rows: those that vary, those in ``words``, and a new session where it is needed."""
    new = trials.conditions.new
    wanted = {"session"} | ({"payload", "fx", "fy", "fz"} if "load" in words else set()) | words
    if not trials.conditions.timed:
        wanted -= {"time"}
    return {name: new[name][rows] for name in sorted(new) if name in wanted}
