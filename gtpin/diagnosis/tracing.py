"""Measurements that trace an unknown effect along the coordinates that it goes with, all else unchanged."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.circumstances import FAST, HOURS, LATER, kind, next_session, payloads, warm
from gtpin.diagnosis.experiment import Experiment, listed
from gtpin.diagnosis.trials import RESOLUTION, Known
from gtpin.effects.situation import Column

Floats = npt.NDArray[np.float64]

STATIONS = 5
"""Poses, far from each other, that are visited again and again."""
SPEEDS = (-1.0, -0.5, 0.5, 1.0)
"""Of the highest that is known."""
FINE = 60
"""Steps into which a track is divided to find how far one actuator can go alone."""


@dataclass(frozen=True)
class _Visits:
    """Commands (K, n) in their order, what to set beside them, and what is done, in words."""

    q: Floats
    words: str
    covariates: dict[str, Column] = field(default_factory=dict)


def trace(known: Known, site: str, coordinates: str, poses: int) -> Experiment:
    """A dense experiment along the coordinates that an unknown effect goes with.

    Parameters
    ----------
    site, coordinates
        Of the free motion that explains it best, as :func:`~gtpin.diagnosis.rivals.rivals` has them.
    poses
        About how many visits it may take.
    """
    visits = _visits(known, coordinates.split(" ")[0], poses)
    measure = f"{visits.words}: what is not known at {site} goes with {coordinates}."
    return Experiment(measure, ("unknown",), visits.q, visits.covariates)


def _visits(known: Known, coordinates: str, poses: int) -> _Visits:
    words = coordinates.split(",")
    if all(re.fullmatch(r"q\d+", word) for word in words):
        return _along(known, [int(word[1:]) - 1 for word in words], poses)
    if words[0] in ("direction", "position"):
        return _spread(known, poses)
    return _again(known, "payload" if words[0] == "load" else words[0], poses)


def _along(known: Known, actuators: list[int], poses: int) -> _Visits:
    """A line there and back, or a net over two actuators."""
    q = known.observed.measured.q
    middle = q[np.linalg.norm(q - np.median(q, axis=0), axis=1).argmin()]
    names = listed([known.robot.sites[j] for j in actuators])
    if len(actuators) == 1:
        line = _line(known, middle, actuators[0], poses // 2)
        back = np.repeat([1.0, -1.0], [len(line), len(line)])
        name = f"approach{actuators[0] + 1}"
        first, last = line[[0, -1], actuators[0]]
        words = f"Move {names} alone, in {len(line)} even steps from {first:.3f} to {last:.3f}"
        covariates: dict[str, Column] = {name: back} if name in known.observed.covariates else {}
        return _Visits(np.vstack([line, line[::-1]]), f"{words}, and back", covariates)
    starts = _line(known, middle, actuators[0], int(np.ceil(np.sqrt(poses))))
    net = np.vstack([_line(known, start, actuators[1], max(poses // len(starts), 2)) for start in starts])
    return _Visits(net, f"Move {names} alone, over a net of {len(net)} poses")


def _line(known: Known, start: Floats, actuator: int, count: int) -> Floats:
    """(count, n) commands that differ in one actuator's, as far to both sides as the measurements went."""
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


def _spread(known: Known, poses: int) -> _Visits:
    """Poses as far from each other as can be."""
    q = _apart(known, min(poses, len(known.observed.measured.q)))
    return _Visits(q, f"Visit {len(q)} poses all over the workspace, at rest and unchanged in all else")


def _again(known: Known, name: str, poses: int) -> _Visits:
    """The same few poses under all that can be set of a covariate."""
    values = known.observed.covariates.get(name)
    stations = _apart(known, min(STATIONS, len(known.observed.measured.q)))
    rounds = max(poses // len(stations), 2)
    levels, words = _levels(known, name, values, rounds)
    q = np.tile(stations, (len(levels), 1))
    told = f"Visit the same {len(stations)} poses {words}"
    covariates: dict[str, Column] = {name: levels[np.repeat(np.arange(len(levels)), len(stations))]}
    return _Visits(q, told, covariates)


def _levels(known: Known, name: str, values: Column | None, rounds: int) -> tuple[Column, str]:
    """What to set of a covariate in each round, and how to say it."""
    what = kind(name)
    if what == "session":
        recorded = np.full(1, "0", dtype=object) if values is None else values
        return np.full(rounds, next_session(recorded), dtype=object), f"{rounds} times in a session of its own"
    numbers = np.zeros(1) if values is None else np.asarray(values, dtype=float)
    if what == "time":
        times = numbers.max() + LATER + np.linspace(0.0, HOURS, rounds)
        return times, f"{rounds} times, every {HOURS / 60.0 / (rounds - 1):.0f} minutes"
    if what == "temperature":
        reference = known.references.temperature
        levels = np.linspace(reference, warm(numbers, reference), rounds)
        return levels, f"{rounds} times while the machine warms up"
    if what == "approach":
        site = known.robot.sites[int(name.removeprefix("approach")) - 1]
        return np.tile([1.0, -1.0], -(-rounds // 2))[:rounds], f"{rounds} times, {site} moving up and down by turns"
    if what == "speed":
        site = known.robot.sites[int(name.removeprefix("speed")) - 1]
        fastest = float(np.abs(numbers).max()) or FAST
        return np.array(
            SPEEDS
        ) * fastest, f"{len(SPEEDS)} times, {site} passing slowly and at {fastest:.2g} per second both ways"
    low, high = payloads(numbers) if what == "payload" else (float(numbers.min()), float(numbers.max()))
    levels = np.linspace(low, high, rounds)
    return (
        levels,
        f"{rounds} times with {'a payload' if what == 'payload' else name} of {listed([f'{v:.3g}' for v in levels])}",
    )


def _apart(known: Known, count: int) -> Floats:
    """(count, n) measured commands, each as far from those before it as can be, the first in the middle."""
    q = known.observed.measured.q
    far = np.linalg.norm(q - np.median(q, axis=0), axis=1)
    rows = [int(far.argmin())]
    distance = np.linalg.norm(q - q[rows[0]], axis=1)
    while len(rows) < count:
        rows.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(q - q[rows[-1]], axis=1))
    return q[rows]
