"""What to measure next: to distinguish the members of a class, to map an unknown effect, to make effects testable."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtpin.diagnosis.classes import ranked
from gtpin.diagnosis.discrimination import RIVALS, CauseClass, discriminate
from gtpin.diagnosis.experiment import Experiment, Visits
from gtpin.diagnosis.findings import Cause, Conclusion
from gtpin.diagnosis.hypothesis_set import HypothesisSet, Untested
from gtpin.diagnosis.make_testable import make_testable
from gtpin.diagnosis.measurement_conditions import kind, levels, numbers
from gtpin.diagnosis.priors import SURE
from gtpin.diagnosis.trials import RESOLUTION, Known
from gtpin.effects.operating_points import Column
from gtpin.typing import Floats

POSES = 20
"""Poses of an experiment: about ten minutes of work."""
LARGEST = 2000
"""Most measured poses that are used. Of more, a random part is used, so that the expected gains are a little too small."""
CLASSES = 3
"""Most classes for which an experiment is proposed, those of the largest causes."""
STATIONS = 5
"""Number of poses, far from each other, that are visited repeatedly."""
AGAIN = 10
"""Number of poses that are visited twice more, to measure the noise: twenty visits determine a sigma to some 10 %."""
FINE = 60
"""Number of commands at which the range of one actuator alone is checked."""


def classes(found: Conclusion, causes: Sequence[Cause], hypotheses: HypothesisSet) -> list[CauseClass]:
    """Causes with their classes, the largest first; where one is not sure, with what else has a part of the probability."""
    by_place = {hypothesis.place: hypothesis for hypothesis in found.classes}
    named = []
    for cause in (by_place[c.effect, c.site] for c in causes):
        members = [(m.hypothesis, m.probability) for m in found.classes[cause]]
        if len(members) == 1 and members[0][1] >= SURE:
            named.append(CauseClass(cause, found.scale[cause], tuple(members)))
            continue
        every = ranked(hypotheses, found.model, cause)
        if len(members) == 1:
            others = (m for m in every.named if m.hypothesis.place != cause.place)
            members += [(m.hypothesis, m.probability) for m in others][:1]
        smooth = every.smooth[:RIVALS]
        named.append(CauseClass(cause, found.scale[cause], tuple(members), every.heat, smooth, hypotheses.priors))
    return named


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
    count = len(known.observed.weight)
    if count > LARGEST:
        known = replace(known, observed=known.observed.take(rng.choice(count, LARGEST, replace=False)))
    open_ = [i for i, s in enumerate(classes) if len(s.members) > 1 or s.members[0][1] < SURE][:CLASSES]
    found = [discriminate(known, classes, i, poses, rng) for i in open_]
    if unknown is not None:
        found.append(map_unknown(known, *unknown, poses))
    if unseen_noise:  # visits to some of the measured poses again show which part of the residuals is noise
        stations = _apart(known, min(AGAIN, len(known.observed.measured.q)))
        visits = Visits("", "", "again", stations=len(stations))
        found.append(Experiment("map_unknown", known.robot, (), np.tile(stations, (2, 1)), visits=visits))
    return (*found, *make_testable(known, classes, untestable, poses, rng))


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
    commands = np.tile(start, (FINE, 1))
    commands[:, actuator] = np.linspace(measured.min(), measured.max(), FINE)
    poses, before = known.model.kinematics.forward(commands), known.operating_points.poses.T
    inside = poses.reached & ((before.min(axis=0) <= poses.T) & (before.max(axis=0) >= poses.T)).all(axis=1)
    nearest = int(np.abs(commands[:, actuator] - start[actuator]).argmin())
    barred = np.flatnonzero(~inside)
    low = max((int(i) + 1 for i in barred if i < nearest), default=0)
    high = min((int(i) - 1 for i in barred if i > nearest), default=FINE - 1)
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
