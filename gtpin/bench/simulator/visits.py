"""The visits of a machine over a day: commands, motion, loads, times and temperatures."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from gtpin.bench.simulator.fields import curve
from gtpin.bench.simulator.recipe import Machine, SimulatedConditions
from gtpin.data.ids import Ids
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints, Mask

STEP = 20.0
"""Time between two temperatures of a day, s."""


@dataclass(frozen=True)
class Day:
    """Temperatures over time, degC. At time 0 everything is at the reference temperature."""

    time: Floats  # (M,) times, s, from 0
    frame: Floats  # (M,) readings of the frame's sensor, degC: it follows the air slowly
    link: Floats  # (M,) of the links' sensor: they follow the air and are heated by work
    end: float  # End of the day's work, s: slow changes depend on the time over ``end``

    @staticmethod
    def draw(rng: np.random.Generator, duration: float, reference: float, warming: float = 1.0) -> Day:
        """A random day of ``duration``, s, from ``reference``, degC; ``warming``: a factor on the changes of temperature."""
        time = np.arange(0.0, duration + 2.0 * STEP, STEP)
        hours = time / 3600.0
        span = max(float(hours[-1]), 1e-3)
        swing = curve(rng, 0.0, span, max(0.4 * span, 0.5), "twice")(hours)
        rise = rng.uniform(1.5, 5.0) * rng.choice([1.0, 1.0, -1.0])
        air = rise * (1.0 - np.exp(-time / rng.uniform(1500.0, 5000.0))) + rng.uniform(0.3, 0.9) * (swing - swing[0])
        work = rng.uniform(0.5, 3.0) * (1.0 - np.exp(-time / rng.uniform(800.0, 2500.0)))
        frame = _lagged(air, rng.uniform(600.0, 2400.0))
        link = _lagged(rng.uniform(0.4, 1.0) * air + work, rng.uniform(300.0, 1200.0))
        return Day(time, reference + warming * frame, reference + warming * link, float(time[-1]))

    def continued(self, time: Floats, frame: Floats, link: Floats) -> Day:
        """The day, continued by readings of the sensors (N,), degC, at later times (N,), s, ascending."""
        pairs = ((self.time, time), (self.frame, frame), (self.link, link))
        times, frames, links = (np.concatenate(pair) for pair in pairs)
        return Day(times, frames, links, self.end)

    def frame_at(self, time: Floats, delay: float = 0.0) -> Floats:
        """Readings of the frame's sensor, degC, at times (N,) less a delay, s."""
        return np.asarray(np.interp(time - delay, self.time, self.frame))

    def link_at(self, time: Floats, delay: float = 0.0) -> Floats:
        """Readings of the links' sensor, degC, at times (N,) less a delay, s."""
        return np.asarray(np.interp(time - delay, self.time, self.link))


def _lagged(source: Floats, constant: float) -> Floats:
    """(M,) response of a first-order lag with a time constant, s, to a source (M,), from zero."""
    from scipy.signal import lfilter

    share = STEP / (constant + STEP)
    return np.asarray(lfilter([share], [1.0, share - 1.0], source))


REPEATED = 0.1
"""Share of the poses that are visited twice."""
BACK_OFF = (0.010, 0.040)
"""Range of the distance, m or rad, from which each actuator approaches where a visit is not reached directly."""


@dataclass(frozen=True)
class VirtualVisits:
    """N visits in the order of time."""

    pose: Ints  # (N,) number of the pose; two visits of one pose share it
    held: Mask  # (N,) mask of visits that are not measured: the held-out commands
    q: Floats  # (N, n) commands, m or rad
    before: Floats  # (N, n) starts of the actuators' last moves
    time: Floats  # (N,) time, s
    session: Ints  # (N,) number of the session, from 0
    payload: Floats  # (N,) payload, kg
    force: Floats  # (N, 3) force on the tool, base frame, N
    speed: Floats  # (N, n) m/s or rad/s
    acceleration: Floats  # (N, n) m/s^2 or rad/s^2; not recorded in the dataset
    day: Day

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def approach(self) -> Floats:
        """(N, n) sign of each actuator's last move."""
        return np.where(self.q >= self.before, 1.0, -1.0)

    @property
    def phase(self) -> Floats:
        """(N,) time over the end of the day: 0 to 1, and more for later visits."""
        return np.asarray(self.time / self.day.end)

    def take(self, rows: Ints | Mask) -> VirtualVisits:
        """Some of the visits."""
        changed: dict[str, Any] = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "day"}
        return replace(self, **changed)

    def columns(self, conditions: SimulatedConditions) -> dict[str, Column]:
        """The covariates that the dataset records, by name."""
        columns: dict[str, Column] = {"time": self.time}
        if conditions.sessions > 1:
            columns["session"] = ids(self.session)
        columns |= {"temp_frame": self.day.frame_at(self.time), "temp_link": self.day.link_at(self.time)}
        columns["payload"] = self.payload
        for name, values in (("approach", self.approach), ("speed", self.speed)):
            columns |= {f"{name}{i + 1}": values[:, i] for i in range(values.shape[1])}
        if conditions.push > 0.0:
            columns |= {f"f{axis}": self.force[:, i] for i, axis in enumerate("xyz")}
        left_out = tuple(conditions.without)
        return {name: values for name, values in columns.items() if not left_out or not name.startswith(left_out)}


def ids(numbers: Ints) -> Ids:
    """(N,) ids of poses or sessions, from their numbers."""
    return np.array([str(number) for number in numbers], dtype=object)


def plan(
    machine: Machine, poses: int, held_out: int, conditions: SimulatedConditions, rng: np.random.Generator
) -> VirtualVisits:
    """A day's visits: of ``poses`` poses, a tenth of them twice, and of ``held_out`` others in between.

    Raises UnreachableError if hardly any poses can be reached.
    """
    return visited(machine, machine.reachable(poses + held_out, rng), poses, poses, conditions, rng)


def visited(
    machine: Machine, q: Floats, poses: int, repeatable: int, conditions: SimulatedConditions, rng: np.random.Generator
) -> VirtualVisits:
    """A day's visits of commands q (P, n): the first ``poses`` are measured, a tenth of the first ``repeatable`` twice."""
    again = rng.choice(repeatable, size=int(REPEATED * repeatable), replace=False)
    pose = np.concatenate([np.arange(len(q)), again])
    pose = rng.permutation(pose)
    if conditions.order == "layers":
        # By round (first visits, then second ones), by layer, then by the difference of the first two commands.
        first = np.isin(np.arange(len(pose)), np.unique(pose, return_index=True)[1])
        layer = np.round(machine.places(q)[pose].mean(axis=1) / 0.2)
        pose = pose[np.lexsort((q[pose, 1 % q.shape[1]] - q[pose, 0], layer, ~first))]
    q, total = q[pose], len(pose)
    session = np.arange(total) * conditions.sessions // total
    gaps = rng.gamma(2.0, conditions.interval / 2.0, total)
    gaps[1:] += np.where(np.diff(session) > 0, rng.uniform(600.0, 5400.0, total - 1), 0.0)
    time = np.asarray(np.round(np.cumsum(gaps), 3), dtype=float)
    # The last moves start at the visit before, or at a point at a small distance to a random side.
    before = np.vstack([q[:1], q[:-1]])
    via = (rng.random(total) >= conditions.direct) | (np.abs(q - before).min(axis=1) < 1e-3)
    side = rng.choice([-1.0, 1.0], q.shape)
    before[via] = (q + side * rng.uniform(*BACK_OFF, q.shape))[via]
    moving = rng.random(total) >= conditions.rest
    way = (q - before) / np.abs(q - before).max(axis=1, keepdims=True) * moving[:, None]
    # Payloads in blocks of time; each has about as many blocks as the others.
    count = max(conditions.payload_blocks, len(conditions.payloads))
    rounds = -(-conditions.payload_blocks // len(conditions.payloads))
    payloads = np.concatenate([rng.permutation(np.array(conditions.payloads)) for _ in range(rounds)])[:count]
    return VirtualVisits(
        pose=pose,
        held=pose >= poses,
        q=q,
        before=before,
        time=time,
        session=session,
        payload=payloads[np.arange(total) * count // total],
        # No force at about half of the visits, drawn at random.
        force=np.round(conditions.push * rng.standard_normal((total, 3))) * (rng.random((total, 1)) < 0.5),
        speed=way * rng.uniform(0.05, 0.30, (total, 1)),
        acceleration=way * 0.4 * rng.standard_normal((total, 1)),
        day=Day.draw(rng, float(time[-1]), conditions.reference_temperature, conditions.warming),
    )
