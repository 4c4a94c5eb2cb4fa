"""What to measure next: to distinguish the members of a class, to map an unknown effect, to make effects testable."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from gtpin.diagnosis.classes import ClassMember, ranked
from gtpin.diagnosis.discrimination import (
    LEAST_EXPECTED,
    RIVALS,
    CauseClass,
    Prediction,
    best_rows,
    chosen,
    concerns,
    discriminate,
    expected_gain,
    other_causes,
)
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.hypothesis_set import HypothesisSet, Untested
from gtpin.diagnosis.priors import SURE
from gtpin.diagnosis.result import Cause, Experiment, Lacking, Visits
from gtpin.diagnosis.trials import FORCES, HEAVIER, RESOLUTION, Known, Trials, kind, levels, numbers, possible
from gtpin.diagnosis.verdict import Conclusion
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.effects.untestable import as_untestable
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

POSES = 20
"""Poses of an experiment: about ten minutes of work."""
MOST_MEASURED = 2000
"""Most measured poses that are used. Of more, a random part is used, so that the expected gains are a little too small."""
MOST_CLASSES = 3
"""Most classes for which an experiment is proposed, those of the largest causes."""
STATIONS = 5
"""Number of poses, far from each other, that are visited repeatedly."""
REPEATED_POSES = 10
"""Number of poses that are visited twice more, to measure the noise: twenty visits determine a sigma to some 10 %."""
LINE_COMMANDS = 60
"""Number of commands at which the range of one actuator alone is checked."""


def classes(found: Conclusion, causes: Sequence[Cause], hypotheses: HypothesisSet) -> list[CauseClass]:
    """Causes with their classes, the largest first; where one is not sure, with what else has a part of the probability."""
    by_place = {hypothesis.place: hypothesis for hypothesis in found.classes}
    named = []
    for cause in (by_place[c.effect, c.site] for c in causes):
        members = _separable(found.classes[cause], cause)
        if len(members) == 1 and members[0][1] >= SURE:
            named.append(CauseClass(cause, found.scale[cause], tuple(members)))
            continue
        every = ranked(hypotheses, found.model, cause)
        if len(members) == 1:
            others = (m for m in every.named if m.hypothesis.place != cause.place)
            members += [(m.hypothesis, m.probability) for m in others][:1]
        smooth = every.smooth[:RIVALS]
        named.append(
            CauseClass(cause, found.scale[cause], tuple(members), every.temperature, smooth, hypotheses.priors)
        )
    return named


def _separable(members: Iterable[ClassMember], cause: Hypothesis) -> list[tuple[Hypothesis, float]]:
    """The members of a cause's class with their probabilities. What all actuators have alike counts as the cause: no poses
    distinguish the two."""
    found: dict[Hypothesis, float] = {}
    for m in members:
        same = cause.site == "frame" and m.beside is not None and m.hypothesis.effect.alike
        one = cause if same else m.hypothesis
        found[one] = found.get(one, 0.0) + m.probability
    return list(found.items())


def plan(
    known: Known,
    *,
    classes: Sequence[CauseClass],
    untestable: Sequence[Untested],
    unknown: tuple[str, str] | None,
    unseen_noise: bool = False,
    rng: np.random.Generator,
    poses: int = POSES,
) -> tuple[Experiment, ...]:
    """Propose experiments: first for open classes, then for the unknown, then for untestable effects.

    Expected gains are those of linear Gaussian predictions given all measured rows, with geometry and other causes
    marginalised.

    ``classes``: the causes, the largest first; one with a probability of 0.95 or more needs no experiment. ``unknown``: site
    and coordinates of the smooth term that best explains the unknown; None where nothing unknown is assumed. ``unseen_noise``:
    whether residuals exceed the declared noise, and no visits tell whether the excess repeats. ``rng``: the same state gives
    the same plan. ``poses``: number of poses of each experiment.
    """
    known = fewer(known, rng)
    open_ = [i for i, s in enumerate(classes) if len(s.members) > 1 or s.members[0][1] < SURE][:MOST_CLASSES]
    found = [discriminate(known, classes, i, poses, rng) for i in open_]
    if unknown is not None:
        found.append(map_unknown(known, *unknown, poses))
    if unseen_noise:  # visits to some of the measured poses again show which part of the residuals is noise
        stations = _apart(known, min(REPEATED_POSES, len(known.observed.measured.q)))
        visits = Visits("", "", "again", stations=len(stations))
        found.append(Experiment("map_unknown", known.robot, (), np.tile(stations, (2, 1)), visits=visits))
    return (*found, *make_testable(known, classes, untestable, poses, rng))


def fewer(known: Known, rng: np.random.Generator) -> Known:
    """What is known, with a random part of the measured rows where they are more than ``MOST_MEASURED``."""
    count = len(known.observed.weight)
    if count <= MOST_MEASURED:
        return known
    return replace(known, observed=known.observed.take(rng.choice(count, MOST_MEASURED, replace=False)))


def map_unknown(known: Known, site: str, coordinates: str, poses: int) -> Experiment:
    """A dense experiment of about ``poses`` visits along the coordinates that an unknown effect depends on.

    ``site``, ``coordinates``: those of the smooth term that explains it best.
    """
    words, robot, q = coordinates.split(" ")[0].split(","), known.robot, known.observed.measured.q
    spread, recorded = Visits(site, coordinates, "spread"), known.observed.covariates
    covariates: dict[str, Column] = {}
    others = [word for word in words if not re.fullmatch(r"q\d+", word)]
    if not others:  # a line there and back, or a net over two actuators
        middle = q[np.linalg.norm(q - np.median(q, axis=0), axis=1).argmin()]
        moved = [int(word[1:]) - 1 for word in words]
        visits = replace(spread, pattern="net", actuators=tuple(robot.sites[j] for j in moved))
        if len(moved) == 1:
            visits = replace(visits, pattern="line")
            line, name = _line(known, middle, moved[0], poses // 2), f"approach{moved[0] + 1}"
            covariates = {name: np.repeat([1.0, -1.0], [len(line), len(line)])} if name in recorded else {}
            commands = np.vstack([line, line[::-1]])
        else:
            starts = _line(known, middle, moved[0], int(np.ceil(np.sqrt(poses))))
            count = max(poses // len(starts), 2)
            commands = np.vstack([_line(known, start, moved[1], count) for start in starts])
    elif names := _covariates(known, others[0]):  # the same few poses at several levels of covariates of one kind
        stations = _apart(known, min(STATIONS, len(q)))
        values = levels(recorded, known.references, names, max(poses // len(stations), 2))
        visits = replace(spread, pattern="repeated", stations=len(stations), varied=tuple(names), levels=values)
        commands = np.tile(stations, (len(values), 1))
        covariates = dict.fromkeys(names, values[np.repeat(np.arange(len(values)), len(stations))])
        for name in names:
            approach = name.replace("speed", "approach")
            if kind(name) == "speed" and approach in recorded:
                covariates[approach] = np.sign(numbers(covariates[name]))
    else:
        visits, commands = spread, _apart(known, min(poses, len(q)))
    return Experiment("map_unknown", robot, (), commands, covariates, visits=visits)


def _covariates(known: Known, word: str) -> list[str]:
    """Names of the covariates that a coordinate stands for; none where it depends on the pose."""
    if word in ("approach", "speed"):
        return [f"{word}{i + 1}" for i in range(known.robot.n_actuators)]
    if word == "load":
        return ["payload"]
    return [word] if word in known.observed.covariates or word in ("time", "session", "payload") else []


def _line(known: Known, start: Floats, actuator: int, count: int) -> Floats:
    """(count, n) commands that differ in one actuator's command only, over the range of the measured poses."""
    measured = known.observed.measured.q[:, actuator]
    commands = np.tile(start, (LINE_COMMANDS, 1))
    commands[:, actuator] = np.linspace(measured.min(), measured.max(), LINE_COMMANDS)
    poses, before = known.model.kinematics.forward(commands), known.operating_points.poses.T
    inside = poses.reached & ((before.min(axis=0) <= poses.T) & (before.max(axis=0) >= poses.T)).all(axis=1)
    nearest = int(np.abs(commands[:, actuator] - start[actuator]).argmin())
    barred = np.flatnonzero(~inside)
    low = max((int(i) + 1 for i in barred if i < nearest), default=0)
    high = min((int(i) - 1 for i in barred if i > nearest), default=LINE_COMMANDS - 1)
    line = np.tile(start, (count, 1))
    line[:, actuator] = np.linspace(commands[low, actuator], commands[high, actuator], count)
    return np.asarray(np.round(line / RESOLUTION) * RESOLUTION)


def _apart(known: Known, count: int) -> Floats:
    """(count, n) measured commands: the first in the middle, each other one as far as possible from those before it."""
    q = known.observed.measured.q
    far = np.linalg.norm(q - np.median(q, axis=0), axis=1)
    rows = [int(far.argmin())]
    distance = np.linalg.norm(q - q[rows[0]], axis=1)
    while len(rows) < count:
        rows.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(q - q[rows[-1]], axis=1))
    return q[rows]


TESTABLE_ROWS = 48
"""Number of random rows from which the most informative are chosen."""
SHOWN_EFFECTS = 2
"""Number of effects of a group for which poses are chosen; the others can then be tested too."""
MOST_SHOWING_POSES = 12
"""Most poses of an experiment: fewer are needed to show an effect than to distinguish it from another."""
ROUNDING = 1e-9
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
        for experiment in _experiments(members, lacking, known, classes, min(poses, MOST_SHOWING_POSES), rng)
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
    tried = [
        possible(known, words, TESTABLE_ROWS, rng, effort)
        for effort in (_efforts(robot) if "load" in words else (1.0,))
    ]
    hidden = members = [member for member in members if _is_read(member, tried[0])]
    for trials in sorted(tried, key=lambda t: -len(_testable(members, t))):
        shown = _testable(members, trials)
        if not shown:
            break
        others = other_causes(trials, classes, words)
        predictions = [Prediction.of(trials, others)]
        for hypothesis in shown[:SHOWN_EFFECTS]:
            X = trials.design.columns(hypothesis.basis(trials.design.operating_points))
            if lacking.missing:
                # The missing covariate is not known at the measured rows, so neither is the effect there.
                X[trials.old] = 0.0
            predictions.append(Prediction.of(trials, np.hstack([others, X])))
        pairs = [(i, 0, 1.0) for i in range(1, len(predictions))]
        if expected_gain(predictions, pairs, np.arange(min(poses, len(trials)))) < LEAST_EXPECTED:
            continue
        rows, gain, random = best_rows(trials, predictions, pairs, poses, rng)
        effects, set_too = tuple(hypothesis.place for hypothesis in shown), chosen(trials, rows, words)
        found = (effects, trials.q[rows], set_too, gain, random, known.observed.temperature)
        yield Experiment("make_testable", robot, *found, lacking=lacking)
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
    return bool(np.abs(trials.design.columns(basis)).max(initial=0.0) > ROUNDING)


def _efforts(robot: Chain) -> tuple[float, ...]:
    """Multiples of the assumed largest loads that are tried; for a robot without rods one, from its mass."""
    if not robot.joint_sites:
        return EFFORTS
    mass = sum(float(robot.model.inertias[j].mass) for j in robot.moving_joints)
    return (min(1.0, CARRIED * mass / HEAVIER),) if mass > 0.0 else (1.0,)
