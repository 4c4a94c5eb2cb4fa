"""Errors of the measurement: pose and scale of the instrument, and the target on the platform."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.fields import curve
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.situation import Postures, Site

SIZES = np.array([2.5e-5] * 3 + [5e-6] * 3)
"""Typical shift, m, and rotation, rad, of the instrument: at some metres of distance both have similar effects."""


def tracker_drift(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """Shift and rotation about the instrument's station: a settling, a slow random drift, and in some cases one step.

    Root mean square of the drift over the day: typically 25 um along and 5 urad about each axis; settling and step are of
    that size too.
    """
    wander = [curve(rng, 0.0, 1.0, rng.uniform(0.25, 0.8), "twice") for _ in range(6)]
    rough = [curve(rng, 0.0, 1.0, 0.05, "rough") for _ in range(6)]
    settling, soon = rng.standard_normal(6), rng.uniform(0.1, 0.6)
    jolt, when = 0.4 * rng.standard_normal(6) * (rng.random() < 0.4), rng.uniform(0.1, 0.9)
    part, sizes = rng.uniform(0.03, 0.12), SIZES * rng.uniform(0.4, 1.4, 6)
    t = now.visits.phase
    columns = [w(t) + part * r(t) for w, r in zip(wander, rough, strict=True)]
    moved = np.column_stack(columns) + settling * (1.0 - np.exp(-t / soon))[:, None] + jolt * (t > when)[:, None]
    return now.off(frame=(..., sizes * moved))


def target_drift(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """A tool that warms up grows by 60 um along its axis, with a time constant of 0.1 to 0.5 of the day, and bends a little."""
    warming, bend = rng.uniform(0.1, 0.5), 0.15 * rng.standard_normal(2)
    growth, part = rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.4), rng.uniform(0.02, 0.08)
    breath = curve(rng, 0.0, 1.0, 0.2, "twice")
    t = now.visits.phase
    along = growth * (1.0 - np.exp(-t / warming)) + part * breath(t)
    return now.off(target=(..., 6e-5 * np.column_stack([bend[0] * along, bend[1] * along, along])))


def target_shift(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """A target that is put back on its nest in each session, 40 um elsewhere along each axis; it creeps a little."""
    shifts, creep = 4e-5 * rng.standard_normal((20, 3)), curve(rng, 0.0, 1.0, 0.3, "twice")
    return now.off(target=(..., shifts[now.visits.session] * (1.0 + 0.05 * creep(now.visits.phase))[:, None]))


def frame_shift(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """30 um and 6 urad between sessions, with a small drift over the day."""
    shifts = 1.2 * SIZES * rng.standard_normal((20, 6))
    drift = [curve(rng, 0.0, 1.0, 0.2, "twice") for _ in range(6)]
    part = rng.uniform(0.03, 0.12)
    within = np.column_stack([d(now.visits.phase) for d in drift])
    return now.off(frame=(..., shifts[now.visits.session] + part * SIZES * within))


def tracker_scale(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """20 ppm of the distance; some ppm depend on the air's temperature and on time."""
    sign, air = rng.choice([-1.0, 1.0]), rng.uniform(-1.5e-7, 1.5e-7)
    wander, part = curve(rng, 0.0, 1.0, 0.3, "twice"), rng.uniform(0.003, 0.012)
    day = now.visits.day
    warm = day.frame_at(now.visits.time) - day.frame[0]
    return now.off(scale=(..., sign * 2e-5 * (1.0 + part * wander(now.visits.phase)) + air * warm))


def measurement_delay(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """Positions of 1 ms before, with orientations in time; the clocks of controller and instrument drift apart by 2 to 8 % of
    that over the day."""
    apart, part = curve(rng, 0.0, 1.0, 0.4, "twice"), rng.uniform(0.02, 0.08)
    by_command = now.machine.command_jacobian(now.q, now.poses)[:, :3]
    velocity = np.einsum("nij,nj->ni", by_command, now.visits.speed)
    late = 1e-3 * (1.0 + part * apart(now.visits.phase))
    return now.off(frame=(slice(0, 3), -late[:, None] * velocity))


def target_offset(now: Postures, site: Site, rng: np.random.Generator) -> Deviation:
    """100 um per axis; up to 0.1 % of it per 20 kg changes with the payload, and less over the day.

    Geometry absorbs the constant part. A larger change would be another effect.
    """
    offset, yields = rng.standard_normal(3), rng.uniform(-0.001, 0.001, 3)
    creep = curve(rng, 0.0, 1.0, 0.4, "twice")
    load = now.visits.payload[:, None] / 20.0
    return now.off(target=(..., 1e-4 * (offset + yields * load + 0.0003 * creep(now.visits.phase)[:, None])))
