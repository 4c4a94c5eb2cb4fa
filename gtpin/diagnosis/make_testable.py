"""Measurements that make effects testable that these data can't test."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gtpin.diagnosis.discrimination import LEAST, CauseClass, best_rows, chosen, concerns, other_causes
from gtpin.diagnosis.expected_bayes_factor import Prediction, expected_gain
from gtpin.diagnosis.experiment import Experiment, Lacking
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.hypothesis_set import Untested
from gtpin.diagnosis.measurement_conditions import FORCES, HEAVIER, kind
from gtpin.diagnosis.trials import Known, Trials, possible
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.untestable import as_untestable
from gtpin.robot.chain import Chain

POOL = 48
"""Number of random rows from which the most informative are chosen."""
EXAMPLES = 2
"""Number of effects of a group for which poses are chosen; the others can then be tested too."""
POSES = 12
"""Most poses of an experiment: fewer are needed to show an effect than to distinguish it from another."""
SEEN = 1e-9
"""Change of a reading by an effect of typical size, in sigmas of the reading, below which it is a rounding error."""
EFFORTS = (1.0, 4.0, 12.0)
"""Multiples of the assumed largest loads that are tried; the smallest at which most effects can be tested is proposed."""
CARRIED = 0.16
"""Payload that any arm carries, over the mass of its moving links: the smallest ratio of 5 kg / 18 kg (UR5), 10 / 29 (UR10)
and 3 / 18 (Panda), from their makers' data sheets."""


def make_testable(
    known: Known, classes: Sequence[CauseClass], untestable: Sequence[Untested], poses: int, rng: np.random.Generator
) -> list[Experiment]:
    """An experiment for each reason why effects are untestable; the largest expected gain first, those without poses last.

    There is none for an effect that never changes a reading of these instruments: encoders at joints, for example, do not
    depend on the measurement frame.
    """
    found = [
        experiment
        for members, lacking in _groups(known.operating_points, untestable)
        for experiment in _experiments(members, lacking, known, classes, min(poses, POSES), rng)
    ]
    return sorted(found, key=lambda e: -(e.expected_gain or 0.0) if len(e.poses) else 1.0)


def _groups(at: OperatingPoints, untestable: Sequence[Untested]) -> Iterator[tuple[list[Hypothesis], Lacking]]:
    """Effects that the same remedy would make testable, and what they lack."""
    groups: dict[tuple[object, bool], list[tuple[Untested, list[str]]]] = {}
    for row in untestable:
        effect, site = row.hypothesis.effect, row.hypothesis.site
        lacking = [name for name in effect.covariates(at.robot, site) if not at.varies(name)]
        remedy = tuple(sorted({kind(name) for name in lacking})) or as_untestable(effect.untestable(at, site))
        missing = any(name not in at.covariates for name in lacking)
        groups.setdefault((remedy, missing), []).append((row, lacking))
    for (_, missing), members in groups.items():
        covariates = tuple(sorted({name for _, names in members for name in names}))
        yield [row.hypothesis for row, _ in members], Lacking(covariates, missing, members[0][0].reason)


def _experiments(
    members: list[Hypothesis],
    lacking: Lacking,
    known: Known,
    classes: Sequence[CauseClass],
    poses: int,
    rng: np.random.Generator,
) -> Iterator[Experiment]:
    """The poses that show a group's effects, and what to do about those that no poses make testable."""
    robot = known.robot
    words = set(lacking.covariates) or {word for member in members for word in concerns(member, robot)}
    if "load" in words:
        words |= set(FORCES)
    tried = [possible(known, words, POOL, rng, effort) for effort in (_efforts(robot) if "load" in words else (1.0,))]
    hidden = members = [member for member in members if _is_read(member, tried[0])]
    for trials in sorted(tried, key=lambda t: -len(_testable(members, t))):
        shown = _testable(members, trials)
        if not shown:
            break
        others = other_causes(trials, classes, words)
        predictions = [Prediction.of(trials, others)]
        for hypothesis in shown[:EXAMPLES]:
            X = trials.design.columns(hypothesis.basis(trials.design.operating_points))
            if lacking.missing:
                # The missing covariate is not known at the measured rows, so neither is the effect there.
                X[trials.old] = 0.0
            predictions.append(Prediction.of(trials, np.hstack([others, X])))
        pairs = [(i, 0, 1.0) for i in range(1, len(predictions))]
        if expected_gain(predictions, pairs, np.arange(min(poses, len(trials)))) < LEAST:
            continue
        rows, gain, random = best_rows(trials, predictions, pairs, poses, rng)
        effects, set_too = tuple(hypothesis.place for hypothesis in shown), chosen(trials, rows, words)
        told = (effects, trials.q[rows], set_too, gain, random, known.observed.temperature)
        yield Experiment("make_testable", robot, *told, lacking=lacking)
        hidden = [member for member in members if member not in shown]
        break
    if hidden:
        effects, none = tuple(hypothesis.place for hypothesis in hidden), np.zeros((0, robot.n_actuators))
        watch = tuple(site for _, site in effects)
        yield Experiment("make_testable", robot, effects, none, watch=watch, lacking=lacking)


def _testable(members: Sequence[Hypothesis], trials: Trials) -> list[Hypothesis]:
    """The members that measured and further rows together make testable, one of each effect first."""
    at = trials.design.operating_points
    able = [c for c in members if not c.effect.has_nonlinear and not c.effect.untestable(at, c.site)]
    seen = [sum(o.effect.id == c.effect.id for o in able[:i]) for i, c in enumerate(able)]
    return [able[i] for i in np.argsort(seen, kind="stable")]


def _is_read(hypothesis: Hypothesis, trials: Trials) -> bool:
    """Whether a hypothesis changes any measured or further number; True where that can't be computed."""
    effect, site, at = hypothesis.effect, hypothesis.site, trials.design.operating_points
    if any(name not in at.covariates for name in effect.covariates(at.robot, site)):
        return True
    try:
        values = effect.nonlinear_values(at, site)
        if effect.has_nonlinear and not len(values):
            return True
        basis = effect.basis(at, site, float(values[len(values) // 2]) if effect.has_nonlinear else None)
    except Exception:  # a user's effect may fail in any way on covariates that nobody measured
        return True
    return bool(np.abs(trials.design.columns(basis)).max(initial=0.0) > SEEN)


def _efforts(robot: Chain) -> tuple[float, ...]:
    """Multiples of the assumed largest loads that are tried; for a robot without rods one, from its mass."""
    if not robot.joint_sites:
        return EFFORTS
    mass = sum(float(robot.model.inertias[j].mass) for j in robot.moving_joints)
    return (min(1.0, CARRIED * mass / HEAVIER),) if mass > 0.0 else (1.0,)
