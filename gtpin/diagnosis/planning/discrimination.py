"""The measurements that best part the members of a class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.linear.evidence import NOTHING, Groups, Marginal
from gtpin.diagnosis.linear.evidence import gain as best_gain
from gtpin.diagnosis.planning.expected_bayes_factor import Prediction, Rivalry, expected_gain, most_telling
from gtpin.diagnosis.planning.experiment import Experiment, listed, settings
from gtpin.diagnosis.planning.measurement_conditions import kind
from gtpin.diagnosis.planning.trials import Known, Trials, possible
from gtpin.effects.situation import Column
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]

POOL = 200
"""Rows at random of which the most telling are taken."""
RIVALS = 3
"""Members of a class that its leader is parted from."""
DRAWS = 5
"""Choices at random that a plan is compared with."""
SETTLED = 2.9
"""Log Bayes factor, nats, from which on one of two stands at 95 %."""
LEAST = 1.0
"""The same, of a whole round, below which something else than poses tells sooner."""
HOPELESS = 0.1
"""The same below which there is nothing to choose rows by."""


@dataclass(frozen=True)
class Standing:
    """A cause, and what could stand in for it.

    Parameters
    ----------
    cause, scale
        The cause as it was fitted: its scale is over the typical size.
    members
        Its class with probabilities, itself among them.
    """

    cause: Hypothesis
    scale: float
    members: tuple[tuple[Hypothesis, float], ...]


def split(known: Known, standings: Sequence[Standing], which: int, poses: int, rng: np.random.Generator) -> Experiment:
    """The experiment that best parts the leader of one class from its likeliest rivals, beside all other causes.

    A cause without a rival is parted from no effect at all.
    """
    robot = known.robot
    members = sorted(standings[which].members, key=lambda member: -member[1])[: RIVALS + 1]
    words = {word for hypothesis, _ in members for word in concerns(hypothesis, robot)}
    trials = possible(known, words, POOL, rng)
    others = beside(trials, [s for i, s in enumerate(standings) if i != which], words)
    predictions = [_prediction(trials, others, hypothesis) for hypothesis, _ in members]
    weights = [p for _, p in members[1:]]
    if not weights:
        predictions.append(Prediction.of(trials, others))
        weights = [1.0]
    rivalries = [Rivalry(*pair, weight=p) for i, p in enumerate(weights, start=1) for pair in ((0, i), (i, 0))]
    rows, gain, random = best_rows(trials, predictions, rivalries, poses, rng)
    names = tuple(str(hypothesis) for hypothesis, _ in members)
    told = f"{names[0]} from {listed(names[1:] or ('no effect',))}"
    instead = watch([hypothesis.site for hypothesis, _ in members], robot)
    if gain < HOPELESS:
        measure = f"No poses within reach tell {told}: {instead}."
        return Experiment(measure, names, np.zeros((0, robot.n_actuators)), {}, gain, random)
    set_too = chosen(trials, rows, words)
    measure = (
        f"Measure these {len(rows)} poses to tell {told}{settings(set_too, robot.sites, known.observed.temperature)}."
    )
    if gain < SETTLED:
        rounds = f"It takes about {int(np.ceil(SETTLED / gain))} such rounds"
        measure += f" {rounds}; or {instead}." if gain < LEAST else f" {rounds}."
    return Experiment(measure, names, trials.q[rows], set_too, gain, random)


def concerns(hypothesis: Hypothesis, robot: Robot) -> tuple[str, ...]:
    """Covariates and coordinates that a hypothesis goes with."""
    return (*hypothesis.covariates(robot), *hypothesis.effect.coordinates(robot, hypothesis.site))


def beside(trials: Trials, standings: Sequence[Standing], words: set[str]) -> Floats:
    """((N + M) c, m) displacements of causes, as large as their priors have them, and of what may change in between.

    Nothing changes in between where sessions themselves are asked about.
    """
    at = trials.design.situation
    columns = [trials.design.columns(s.cause.basis(at)) * s.scale for s in standings]
    return np.hstack([np.zeros((len(trials.design.y), 0)) if "session" in words else trials.since, *columns])


def _prediction(trials: Trials, others: Floats, hypothesis: Hypothesis) -> Prediction:
    """What a hypothesis beside other causes expects, as large as what was measured has it."""
    design, old = trials.design, trials.old
    X = design.columns(hypothesis.basis(design.situation))
    groups: Groups[Hypothesis] = Groups(Marginal(np.hstack([design.B, others])[old]), design.y[old])
    groups.add(hypothesis, X[old])
    scale = best_gain(groups, NOTHING, hypothesis)[1]
    return Prediction.of(trials, np.hstack([others, X * scale]))


def best_rows(
    trials: Trials,
    predictions: Sequence[Prediction],
    rivalries: Sequence[Rivalry],
    count: int,
    rng: np.random.Generator,
) -> tuple[Rows, float, float]:
    """The most telling rows, in the order in which they are best measured, their gain, and the mean gain of random ones."""
    rows = most_telling(predictions, rivalries, count)
    drawn = [rng.choice(len(trials), len(rows), replace=False) for _ in range(DRAWS)]
    random = float(np.mean([expected_gain(predictions, rivalries, r) for r in drawn]))
    return rows[_order(trials, rows)], expected_gain(predictions, rivalries, rows), random


def _order(trials: Trials, rows: Rows) -> Rows:
    """Warm before cold, load by load, then along the first actuator; or as time goes on."""
    new = trials.circumstances.new
    if trials.circumstances.timed:
        return np.argsort(np.asarray(new["time"], dtype=float)[rows])
    keys = [trials.q[rows, 0]]
    if "payload" in new:
        keys.append(np.asarray(new["payload"], dtype=float)[rows])
    keys += [-np.asarray(new[name], dtype=float)[rows] for name in new if kind(name) == "temperature"][:1]
    return np.lexsort(keys)


def chosen(trials: Trials, rows: Rows, words: set[str]) -> Mapping[str, Column]:
    """Covariates of some rows that are to be set: those that vary, that words ask for, or a session that has to be new."""
    new = trials.circumstances.new
    wanted = {"session"} | ({"payload", "fx", "fy", "fz"} if "load" in words else set()) | words
    if not trials.circumstances.timed:
        wanted -= {"time"}
    return {name: new[name][rows] for name in sorted(new) if name in wanted}


def watch(sites: Sequence[str], robot: Robot) -> str:
    """How some sites are measured by themselves."""
    carts = [site for site in dict.fromkeys(sites) if site in robot.sites]
    links = [site for site in sites if site == "arm" or site in set(robot.rod_sites) - set(robot.sites)]
    words = (
        [f"watch {listed(carts)} by {'targets of their own' if len(carts) > 1 else 'a target of its own'}"]
        if carts
        else []
    )
    if links:
        words.append("watch the length of the links by targets at both of their ends")
    if "frame" in sites:
        words.append("watch targets that stand still beside the robot")
    if "platform" in sites:
        words.append("measure by itself where the target sits on the platform")
    return listed(words)
