"""Measurements of an unknown effect along the coordinates that it depends on, with all other conditions constant."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import numpy as np

from gtpin.diagnosis.planning.experiment import Experiment, Visits
from gtpin.diagnosis.planning.measurement_conditions import FAST, HOURS, LATER, kind, next_sessions, payloads, warm
from gtpin.diagnosis.planning.trials import RESOLUTION, Known
from gtpin.effects.situation import Column
from gtpin.typing import Floats

STATIONS = 5
"""Number of poses, far from each other, that are visited repeatedly."""
AGAIN = 10
"""Number of poses that are visited twice more, to measure the noise: twenty visits determine a sigma to some 10 %."""
SPEEDS = (-1.0, -0.5, 0.5, 1.0)
"""Speeds to set, as multiples of the highest recorded one."""
FINE = 60
"""Number of commands at which the range of one actuator alone is checked."""


@dataclass(frozen=True)
class _Plan:
    """Visits, their commands (K, n) in order, m or rad, and the covariates to set."""

    visits: Visits
    q: Floats
    covariates: dict[str, Column] = field(default_factory=dict)


def map_unknown(known: Known, site: str, coordinates: str, poses: int) -> Experiment:
    """A dense experiment along the coordinates that an unknown effect depends on.

    ``site``, ``coordinates``: site and coordinates of the smooth term that explains it best. ``poses``: approximate number of
    visits.
    """
    plan = _plan(known, site, coordinates, poses)
    return Experiment("map_unknown", known.robot, (), plan.q, plan.covariates, visits=plan.visits)


def visit_again(known: Known) -> Experiment:
    """Visits to some of the measured poses again: they show which part of the residuals is noise."""
    stations = _apart(known, min(AGAIN, len(known.observed.measured.q)))
    visits = Visits("", "", "again", stations=len(stations))
    return Experiment("map_unknown", known.robot, (), np.tile(stations, (2, 1)), visits=visits)


def _plan(known: Known, site: str, coordinates: str, poses: int) -> _Plan:
    words = coordinates.split(" ")[0].split(",")
    others = [word for word in words if not re.fullmatch(r"q\d+", word)]
    spread = Visits(site, coordinates, "spread")
    if not others:
        return _along(known, spread, [int(word[1:]) - 1 for word in words], poses)
    names = _covariates(known, others[0])
    if names:
        return _again(known, spread, names, poses)
    return _Plan(spread, _apart(known, min(poses, len(known.observed.measured.q))))


def _covariates(known: Known, word: str) -> list[str]:
    """Names of the covariates that a coordinate stands for; none where it depends on the pose."""
    if word in ("approach", "speed"):
        return [f"{word}{i + 1}" for i in range(known.robot.n_actuators)]
    if word == "load":
        return ["payload"]
    return [word] if word in known.observed.covariates or word in ("time", "session", "payload") else []


def _along(known: Known, visits: Visits, actuators: list[int], poses: int) -> _Plan:
    """A line there and back, or a net over two actuators."""
    q = known.observed.measured.q
    middle = q[np.linalg.norm(q - np.median(q, axis=0), axis=1).argmin()]
    sites = tuple(known.robot.sites[j] for j in actuators)
    if len(actuators) == 1:
        line = _line(known, middle, actuators[0], poses // 2)
        back = np.repeat([1.0, -1.0], [len(line), len(line)])
        name = f"approach{actuators[0] + 1}"
        covariates: dict[str, Column] = {name: back} if name in known.observed.covariates else {}
        return _Plan(replace(visits, pattern="line", actuators=sites), np.vstack([line, line[::-1]]), covariates)
    starts = _line(known, middle, actuators[0], int(np.ceil(np.sqrt(poses))))
    net = np.vstack([_line(known, start, actuators[1], max(poses // len(starts), 2)) for start in starts])
    return _Plan(replace(visits, pattern="net", actuators=sites), net)


def _line(known: Known, start: Floats, actuator: int, count: int) -> Floats:
    """(count, n) commands that differ in one actuator's command only, over the range of the measured poses."""
    measured = known.observed.measured.q[:, actuator]
    commands = np.tile(start, (FINE, 1))
    commands[:, actuator] = np.linspace(measured.min(), measured.max(), FINE)
    poses, before = known.model.kinematics.forward(commands), known.situation.poses.T
    inside = poses.reached & ((before.min(axis=0) <= poses.T) & (before.max(axis=0) >= poses.T)).all(axis=1)
    nearest = int(np.abs(commands[:, actuator] - start[actuator]).argmin())
    barred = np.flatnonzero(~inside)
    low = max((int(i) + 1 for i in barred if i < nearest), default=0)
    high = min((int(i) - 1 for i in barred if i > nearest), default=FINE - 1)
    line = np.tile(start, (count, 1))
    line[:, actuator] = np.linspace(commands[low, actuator], commands[high, actuator], count)
    return np.asarray(np.round(line / RESOLUTION) * RESOLUTION)


def _again(known: Known, visits: Visits, names: list[str], poses: int) -> _Plan:
    """The same few poses at several levels of covariates of one kind."""
    stations = _apart(known, min(STATIONS, len(known.observed.measured.q)))
    levels = _levels(known, names, max(poses // len(stations), 2))
    rows = np.repeat(np.arange(len(levels)), len(stations))
    covariates: dict[str, Column] = dict.fromkeys(names, levels[rows])
    for name in [
        n for n in names if kind(n) == "speed" and n.replace("speed", "approach") in known.observed.covariates
    ]:
        covariates[name.replace("speed", "approach")] = np.sign(np.asarray(covariates[name], dtype=float))
    again = replace(visits, pattern="repeated", stations=len(stations), varied=tuple(names), levels=levels)
    return _Plan(again, np.tile(stations, (len(levels), 1)), covariates)


def _levels(known: Known, names: list[str], rounds: int) -> Column:
    """The value of covariates of one kind in each round of visits."""
    what, recorded = kind(names[0]), known.observed.covariates
    if what == "session":
        sessions = next_sessions(recorded.get("session", np.full(1, "0", dtype=object)), rounds)
        return np.array(sessions, dtype=object)
    if what == "approach":
        return np.resize([1.0, -1.0], rounds)
    numbers = np.concatenate([np.zeros(0), *(np.asarray(recorded[n], dtype=float) for n in names if n in recorded)])
    numbers = numbers if numbers.size else np.zeros(1)
    if what == "time":
        return np.asarray(numbers.max() + LATER + np.linspace(0.0, HOURS, rounds))
    if what == "temperature":
        reference = known.references.temperature
        return np.linspace(reference, warm(numbers, reference), rounds)
    if what == "speed":
        return np.array(SPEEDS) * (float(np.abs(numbers).max()) or FAST)
    low, high = payloads(numbers) if what == "payload" else (float(numbers.min()), float(numbers.max()))
    return np.linspace(low, high, rounds)


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
