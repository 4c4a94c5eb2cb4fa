"""Rows that could be measured next: reachable commands, each with measurement conditions."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.priors import PRIORS
from gtpin.effects.displacement import Displacement
from gtpin.effects.operating_points import Column, OperatingPoints, References
from gtpin.effects.smooth import frame_twist
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

LATER, INTERVAL = 600.0, 25.0
"""Assumed time from the last recorded visit to the next, and between further visits, s."""
NIGHT = 8.0 * 3600.0
"""Time after which a machine has cooled down, s."""
HOURS = 4.0 * 3600.0
"""Time over which poses are visited repeatedly where an effect depends on time, s."""
HEAVIER = 5.0
"""Assumed largest payload above the smallest recorded one, kg, where the data have only one payload."""
MOST_PAYLOAD = 4.0
"""Largest factor on ``HEAVIER``."""
PUSH = 50.0
"""Assumed largest force on the tool, N, where the data have none."""
FAST = 0.2
"""Assumed largest speed of an actuator, m/s or rad/s, where the data have none."""
SESSIONS = 4
"""Number of further sessions where the question is what changes between sessions: one change alone can be small by chance."""
LEAST_WARMER = 1.0
"""Largest recorded difference from the reference temperature, K, below which the temperature of a warm machine is assumed."""
SPEEDS = (-1.0, -0.5, 0.5, 1.0)
"""Speeds to set, as multiples of the highest recorded one."""
FORCES = ("fx", "fy", "fz")
OF_THE_POSE = re.compile(r"load|direction|position|q\d+")
"""Coordinates that depend on the pose, or on several covariates, but are no covariates."""


@dataclass(frozen=True)
class MeasurementConditions:
    """Covariates of the N measured rows, and of M rows that could be measured.

    ``known``, ``new``: by name, (N,) and (M,) each; a covariate that was not recorded has a neutral value. ``timed``: whether
    the further rows are distributed over hours, so that their ``time`` is to be kept.
    """

    known: Mapping[str, Column]
    new: Mapping[str, Column]
    references: References
    timed: bool = False


def kind(name: str) -> str:
    """``approach`` of ``approach2``, ``temperature`` of ``temp_link``, ``force`` of ``fx``; other names unchanged."""
    if name in FORCES:
        return "force"
    if name.startswith("temp_"):
        return "temperature"
    return re.sub(r"^(approach|speed)\d+$", r"\1", name)


def draw(
    recorded: Mapping[str, Column],
    measured: int,
    references: References,
    words: Collection[str],
    rng: np.random.Generator,
    *,
    ways: Floats,
    effort: float = 1.0,
) -> MeasurementConditions:
    """Draw random conditions over the values that can be set.

    ``recorded``, ``measured``: covariates by name, (N,) each, and N. ``words``: names of the covariates to vary, recorded so
    far or not; ``load`` means payload and force on the tool. All others have their easiest values: one direction of approach,
    at rest, the usual load, without pause after the last measurement. ``ways``: (M, k, 3) unit vectors along which forces on
    the tool are most informative. ``effort``: factor on the assumed largest loads, for effects that smaller loads don't show.
    """
    count = len(ways)
    asked = {word for word in words if not OF_THE_POSE.fullmatch(word)}
    if "load" in words:
        asked |= {"payload"} | {name for name in FORCES if name in recorded}
    known = {n: recorded[n] if n in recorded else _silent(n, measured, references) for n in sorted({*recorded, *asked})}
    new = as_usual(known, count)
    cold = (rng.random(count) < 0.5) & any(kind(name) == "temperature" for name in asked)
    push = _pushes(known, ways, effort, rng)
    for name in sorted(asked):
        new[name] = _varied(name, known[name], references, cold, push, effort, rng)
    for name in (n for n in new if kind(n) == "speed"):
        speed, approach = numbers(new[name]), name.replace("speed", "approach")
        if approach in new:
            new[approach] = np.where(speed != 0.0, np.sign(speed), numbers(new[approach]))
    fixed = replace(references, covariates=tuple(sorted(known)))
    if "session" in known:
        later = set(map(str, new["session"])) - set(map(str, known["session"]))
        fixed = replace(fixed, sessions=(*sorted({str(s) for s in known["session"]}), *sorted(later)))
    timed = False
    if "time" in known:
        idle = not np.ptp(numbers(known["time"]))
        timed = idle and "time" in asked
        start, span = float(numbers(known["time"]).max()) + LATER, HOURS if timed else INTERVAL * count
        new["time"] = start + rng.uniform(0.0, span, count) + NIGHT * cold
        fixed = replace(fixed, time=(start, span)) if idle else fixed
    return MeasurementConditions(known, new, fixed, timed)


def numbers(values: Column) -> Floats:
    """The values of a covariate as numbers."""
    return np.asarray(values, dtype=float)


def _silent(name: str, count: int, references: References) -> Column:
    """(N,) a covariate that was not recorded."""
    if name == "session":
        return np.full(count, "0", dtype=object)
    return np.full(count, references.temperature if kind(name) == "temperature" else 0.0)


def as_usual(known: Mapping[str, Column], count: int) -> dict[str, Column]:
    """By name, ``count`` values of each known covariate that are easiest to measure at; times continue after the last."""
    found = {name: _usual(name, values, known.get("time"), count) for name, values in known.items()}
    if "time" in known:
        found["time"] = float(numbers(known["time"]).max()) + LATER + INTERVAL * np.arange(count, dtype=float)
    return found


def with_nights(values: Mapping[str, Column], reference: float) -> dict[str, Column]:
    """The covariates of rows in the order of measurement, with a night in ``time`` before each machine that has cooled down.

    A machine is cold in a row in which a temperature is the reference temperature, degC.
    """
    temperatures = [numbers(column) for name, column in values.items() if kind(name) == "temperature"]
    if "time" not in values or not temperatures:
        return dict(values)
    cold = np.any([column == reference for column in temperatures], axis=0).astype(int)
    return {**values, "time": numbers(values["time"]) + NIGHT * np.cumsum(np.diff(cold, prepend=cold[:1]) == 1)}


def _usual(name: str, known: Column, time: Column | None, count: int) -> Column:
    """(M,) the value of a covariate that is easiest to measure at."""
    if name == "session":
        return np.full(count, next_sessions(known, 1)[0], dtype=object)
    values = numbers(known)
    if kind(name) == "approach":
        return np.ones(count)
    if kind(name) in ("speed", "force"):
        return np.zeros(count)
    if name == "payload":
        levels, counts = np.unique(values, return_counts=True)
        return np.full(count, levels[counts.argmax()])
    if kind(name) == "temperature" and time is not None:
        return np.full(count, values[numbers(time).argmax()])
    return np.full(count, np.median(values))


def _varied(
    name: str,
    known: Column,
    references: References,
    cold: npt.NDArray[np.bool_],
    push: Floats,
    effort: float,
    rng: np.random.Generator,
) -> Column:
    """(M,) random values of a covariate, over all that can be set."""
    count = len(cold)
    if name == "session":
        return rng.choice(next_sessions(known, SESSIONS), count)
    values = numbers(known)
    if kind(name) == "approach":
        return rng.choice([-1.0, 1.0], count)
    if kind(name) == "speed":
        fastest = float(np.abs(values).max()) or FAST
        return rng.choice([-1.0, 0.0, 1.0], count, p=[0.4, 0.2, 0.4]) * fastest * rng.uniform(0.3, 1.0, count)
    if kind(name) == "force":
        return push[:, FORCES.index(name)]
    if name == "payload":
        return rng.choice(payloads(values, min(effort, MOST_PAYLOAD)), count)
    if kind(name) == "temperature":
        return np.where(cold, references.temperature, warm(values, references.temperature))
    return np.asarray(rng.choice(values, count))


def levels(recorded: Mapping[str, Column], references: References, names: Sequence[str], rounds: int) -> Column:
    """The value of covariates of one kind in each round of visits."""
    what = kind(names[0])
    if what == "session":
        return next_sessions(recorded.get("session", np.full(1, "0", dtype=object)), rounds)
    if what == "approach":
        return np.resize([1.0, -1.0], rounds)
    values = np.concatenate([np.zeros(0), *(numbers(recorded[n]) for n in names if n in recorded)])
    values = values if values.size else np.zeros(1)
    if what == "time":
        return np.asarray(values.max() + LATER + np.linspace(0.0, HOURS, rounds))
    if what == "temperature":
        return np.linspace(references.temperature, warm(values, references.temperature), rounds)
    if what == "speed":
        return np.array(SPEEDS) * (float(np.abs(values).max()) or FAST)
    low, high = payloads(values) if what == "payload" else (float(values.min()), float(values.max()))
    return np.linspace(low, high, rounds)


def next_sessions(known: Column, count: int) -> npt.NDArray[np.object_]:
    """Names for new sessions, after the known ones."""
    names = [str(name) for name in known]
    if all(name.isdecimal() for name in names):
        free = (str(max(map(int, names)) + i) for i in itertools.count(1))
    else:
        free = (name for i in itertools.count(1) if (name := f"next {i}" if i > 1 else "next") not in names)
    return np.array(list(itertools.islice(free, count)), dtype=object)


def payloads(known: Floats, effort: float = 1.0) -> Floats:
    """Lightest and heaviest payload, kg, of the known ones (N,).

    The heaviest is ``effort * HEAVIER`` above the lightest instead where all known ones are equal, or where ``effort`` is not 1
    and the known ones are lighter than that.
    """
    least, most = float(known.min()), float(known.max())
    heaviest = least + effort * HEAVIER
    return np.array([least, most if most > least and (effort == 1.0 or most > heaviest) else heaviest])


def warm(known: Floats, reference: float) -> float:
    """Temperature of a warm machine, degC, from the known temperatures (N,) and the reference temperature."""
    farthest = float(known[np.abs(known - reference).argmax()])
    return farthest if abs(farthest - reference) >= LEAST_WARMER else reference + PRIORS.warmer


def _pushes(known: Mapping[str, Column], ways: Floats, effort: float, rng: np.random.Generator) -> Floats:
    """(M, 3) forces on the tool, N: zero at a random half of the rows, at the others along one of the row's ``ways``."""
    count = len(ways)
    columns = [numbers(known[name]) for name in FORCES if name in known]
    largest = float(np.sqrt(sum((column**2 for column in columns), np.zeros(1))).max())
    size = largest if largest > 0.0 and effort == 1.0 else max(largest, effort * PUSH)
    way = ways[np.arange(count), rng.integers(0, ways.shape[1], count)]
    return np.asarray(size * way * (rng.random((count, 1)) < 0.5))


ZERO = 4e-5
"""Prior sigma of the change of a drive's zero since the last measurement, m or rad. Assumed."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, m or rad."""


@dataclass(frozen=True, eq=False)
class Known:
    """The N measured poses, the calibrated geometry about which the problem is linear, and the diagnosis's references."""

    observed: Observed
    model: Model
    references: References

    @property
    def robot(self) -> Chain:
        """The robot."""
        return self.model.geometry.robot

    @cached_property
    def operating_points(self) -> OperatingPoints:
        """The N measured poses, computed with this geometry."""
        return self.observed.operating_points(self.model, self.references)


@dataclass(frozen=True, eq=False)
class Trials:
    """M rows that could be measured, with commands q (M, n), together with the N measured rows.

    ``design``: the linear problem of all N + M rows, the measured rows first. ``measured``: N.
    """

    design: Design
    measured: int
    q: Floats
    conditions: MeasurementConditions

    def __len__(self) -> int:
        return len(self.q)

    @property
    def old(self) -> slice:
        """Indices of the measured rows' numbers among all whitened numbers."""
        return slice(self.measured * self.design.components)

    @cached_property
    def since(self) -> Floats:
        """((N + M) c, 6 + n) whitened displacements by changes after the measured rows: instrument's pose, drives' zeros."""
        twist, size = frame_twist(self.design.operating_points)
        frame = self.design.columns(Displacement(size, twist=twist))
        zeros = ZERO * self.design.by_command.reshape(len(frame), -1)
        changed = np.hstack([frame, zeros])
        changed[self.old] = 0.0
        return changed


def possible(known: Known, words: Collection[str], count: int, rng: np.random.Generator, effort: float = 1.0) -> Trials:
    """Random rows, over the measured workspace and over the values to which some covariates can be set.

    Half of the commands are measured ones, the others are between two measured ones.

    ``words``, ``effort``: covariates to vary; see :func:`~gtpin.diagnosis.trials.draw`. ``count``:
    number of rows before those that can't be reached are left out.
    """
    from scipy.spatial import cKDTree

    observed, model, before = known.observed, known.model, known.operating_points
    measured = observed.measured
    again = rng.choice(len(measured.q), min(count // 2, len(measured.q)), replace=False)
    a, b = rng.integers(0, len(measured.q), (2, count - len(again)))
    between = measured.q[a] + rng.random((len(a), 1)) * (measured.q[b] - measured.q[a])
    q = np.vstack([measured.q[again], np.round(between / RESOLUTION) * RESOLUTION])
    poses = model.kinematics.forward(q)
    q, poses = q[poses.reached], poses[poses.reached]
    ways = _against(known, q, poses)
    drawn = draw(observed.covariates, len(before), known.references, words, rng, ways=ways, effort=effort)
    # A further pose is read by the same instrument and with the same noise as the nearest measured one.
    rows = np.concatenate([np.arange(len(before)), cKDTree(before.poses.T).query(poses.T)[1]])
    operating_points = OperatingPoints(
        before.kinematics,
        np.vstack([measured.q, q]),
        before.poses.followed_by(poses),
        {name: np.concatenate([drawn.known[name], drawn.new[name]]) for name in drawn.new},
        drawn.references,
        observed.temperature,
    )
    design = Design.of(
        operating_points,
        model,
        measured.at_trials(rows, operating_points.q),
        observed.noise.take(rows),
        np.concatenate([observed.weight, np.ones(len(q))]),
        observed.free_frame,
    )
    return Trials(design, len(before), q, drawn)


def _against(known: Known, q: Floats, poses: Poses) -> Floats:
    """(M, k, 3) unit vectors along which a force on the tool reduces the force of each rod most; the base frame's axes where
    there is no rod.
    """
    at = OperatingPoints(known.operating_points.kinematics, q, poses, {})
    if not at.force.shape[1]:
        return np.tile(np.eye(3), (len(q), 1, 1))
    ways = -np.sign(at.force)[:, :, None] * np.swapaxes(at.response[:, :3], 1, 2)
    return np.asarray(ways / np.linalg.norm(ways, axis=2, keepdims=True))
