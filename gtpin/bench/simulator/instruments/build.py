"""Makes a case from a recipe and the instruments that measure the machine."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.arms.robot import Arm
from gtpin.bench.simulator.background import weak_others
from gtpin.bench.simulator.build import drawn_machine, ids, known_robot, nominal_arm, strong
from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.instruments.case import InstrumentCase
from gtpin.bench.simulator.instruments.choice import (
    BAR,
    TOUCHED,
    checked,
    errors,
    held_readings,
    noises,
    reading,
    reads,
    stream,
)
from gtpin.bench.simulator.instruments.circles import circles
from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.instruments.past import PastReadings
from gtpin.bench.simulator.instruments.range import Range
from gtpin.bench.simulator.instruments.tables import Read, Tables
from gtpin.bench.simulator.instruments.touch import begun, felt
from gtpin.bench.simulator.instruments.tracker import Tracker
from gtpin.bench.simulator.instruments.way import AnArm, DayWay, Moved
from gtpin.bench.simulator.looped.machine import LoopedMachine
from gtpin.bench.simulator.machine import Machine
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.recipe import Recipe
from gtpin.bench.simulator.response import Plant
from gtpin.bench.simulator.true_robot import OnRods
from gtpin.bench.simulator.truth import Truth
from gtpin.bench.simulator.visits import Visits, drawn, visited
from gtpin.data import Commands
from gtpin.errors import GtpinError
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

POOL = 1000
"""Number of commands all over the workspace. Instruments are placed by them, and the search of touches starts from them."""
MOST = 0.2
"""Largest share of the touches that may fail: where an effect has a step, there can be no command at which the machine
touches."""


@dataclass(frozen=True)
class Outing:
    """Instruments with their own stops. (A stop is a pose at which instruments read.)

    Parameters
    ----------
    layout
        The workspace.
    touching
        Touched instruments, with stops counted from 0, and the commands (M, n) of these stops, m or rad.
    bar
        A ball bar, the commands (M, n) of its circles, m or rad, and the speeds (M, n) there; or None.
    """

    layout: Layout
    touching: tuple[tuple[Gauge, Floats], ...]
    bar: tuple[Gauge, Floats, Floats] | None


def build_measured(recipe: Recipe, instruments: Sequence[str]) -> InstrumentCase:
    """Make the case of a recipe, measured by some instruments.

    ``recipe.poses`` is the number of poses at which the reading instruments read, and the number of touches of each touched
    one.

    Raises
    ------
    GtpinError
        If an instrument, effect or site is not known, the robot can't make the touches, or there is nothing to measure.
    """
    kinds, noise, seed = checked(instruments), recipe.noise, recipe.seed
    if not kinds or recipe.poses < 2 or recipe.held_out < 1:
        what = f"{len(kinds)} instruments, {recipe.poses} poses and {recipe.held_out} held out"
        raise GtpinError(what, hint="ask for at least one instrument, two poses, and one held out")
    if noise.free_target:
        raise GtpinError(
            "a free target with --instrument", hint="leave free_target out: instruments have targets of their own"
        )
    streams = [np.random.default_rng(part) for part in np.random.SeedSequence([seed, 5]).spawn(5)]
    robot = known_robot(recipe.robot)
    machine = drawn_machine(robot, streams[0])
    out = _outing(machine, kinds, recipe, streams[1])
    n_read = recipe.poses if reads(kinds) else 0
    asked = [q for _, q in out.touching] + ([out.bar[1]] if out.bar else [])
    plain = drawn(machine, n_read + recipe.held_out, streams[1])
    q = np.vstack([plain[:n_read], *asked, plain[n_read:]])
    visits = visited(machine, q, len(q) - recipe.held_out, n_read, recipe.conditions, streams[1])
    if out.bar:
        visits = _round(visits, len(q) - recipe.held_out - len(out.bar[1]), *out.bar[1:])
    plant = Plant(machine, visits, np.array(noise.station), _read(machine) if "encoder" in kinds else ())
    gauges = _gauges(kinds, out, plant, n_read, recipe)
    repeatability = noise.repeatability_of(machine, streams[3])
    past, every = _past(plant, gauges, repeatability), np.arange(len(visits))
    causes, _ = strong(recipe.wanted, seed, plant, every, past)
    weak: list[tuple[Cause, float]] = []
    if recipe.background:
        taken = {(want.effect, want.site) for want in recipe.wanted}
        weak, _ = weak_others(plant, every, past, taken, bool(recipe.wanted), streams[2])
    jitter = machine.jitter(repeatability, len(visits), streams[3])
    missed = [errors(gauge, noise, part) for gauge, part in zip(gauges, noises(seed, gauges), strict=True)]
    touching = [i for i, gauge in enumerate(gauges) if gauge.touches]
    way, good = felt(
        DayWay(plant, [*causes, *weak], jitter), [gauges[i] for i in touching], [missed[i] for i in touching]
    )
    if touching and (~good).sum() > MOST * sum(len(gauges[i].stop) for i in touching):
        raise GtpinError("the machine misses most of its touches", hint="make the effects smaller")
    kept = [good[gauge.stop] for gauge in gauges]
    gauges = [gauge.kept(rows) for gauge, rows in zip(gauges, kept, strict=True)]
    missed = [error[rows] for error, rows in zip(missed, kept, strict=True)]
    visits, held = way.plant.visits, np.flatnonzero(way.plant.visits.held)
    dataset = _dataset(recipe, way, gauges, missed)
    covariates = visits.take(held).columns(recipe.conditions)
    steady = way.plant.seen(way.active)
    return InstrumentCase(
        name=f"case{seed:05d}",
        dataset=dataset,
        commands=Commands(ids(np.arange(len(held))), visits.q[held], covariates),
        truth=_held_out(way, gauges)[held],
        effects=_truths(recipe, way.plant, gauges, causes, repeatability),
        gauges=tuple(gauges),
        true=way.poses,
        steady=steady,
        geometry=_geometry(machine),
        machine=machine,
        held=held_readings(gauges, steady[held]),
    )


def _outing(machine: Machine | ArmMachine, kinds: Sequence[str], recipe: Recipe, rng: np.random.Generator) -> Outing:
    """The workspace, and the instruments with their own stops: touches of the machine without effects, circles of the
    nominal."""
    moved: Moved = AnArm(machine) if isinstance(machine, ArmMachine) else OnRods(machine.geometry)
    pool = drawn(machine, POOL, rng)
    robot = machine.robot
    gravity = robot.gravity if isinstance(robot, Arm) else np.array(robot.description.gravity)
    layout = Layout.of(moved.predict(pool), gravity, machine.n_carts)
    touching = []
    for kind in (kind for kind in kinds if kind in TOUCHED):
        own = stream(recipe.seed, kind)
        gauge = TOUCHED[kind](layout, np.arange(recipe.poses), recipe.noise.declared, own)
        touching.append((gauge, begun(gauge, moved, pool, (robot.lower, robot.upper), own)))
    bar = None
    if BAR in kinds:
        nominal: Moved = AnArm(nominal_arm(robot)) if isinstance(robot, Arm) else OnRods(Geometry.nominal(robot))
        q, speed = circles(nominal, layout, pool, (robot.lower, robot.upper), recipe.poses)
        gauge = Range.bar(layout, np.arange(len(q)), recipe.noise.declared, stream(recipe.seed, BAR))
        bar = gauge, q, speed
    return Outing(layout, tuple(touching), bar)


def _round(visits: Visits, first: int, q: Floats, speed: Floats) -> Visits:
    """Visits whose poses from ``first`` on are along circles, in the order of travel."""
    place = np.flatnonzero((visits.pose >= first) & (visits.pose < first + len(q)))  # in order of time
    changed = {name: getattr(visits, name).copy() for name in ("pose", "q", "before", "speed", "acceleration")}
    changed["pose"][place] = first + np.arange(len(q))
    changed["q"][place], changed["speed"][place], changed["acceleration"][place] = q, speed, 0.0
    changed["before"][place] = q - speed  # the command one second earlier
    return replace(visits, **changed)


def _gauges(kinds: Sequence[str], out: Outing, plant: Plant, n_read: int, recipe: Recipe) -> list[Gauge]:
    """The instruments at the stops of a day: those that read, at the first ``n_read`` poses; then the touched ones and the
    bar."""
    pose, found, first = plant.visits.pose, [], n_read
    order = np.random.default_rng(np.random.SeedSequence([recipe.seed, 7]))
    stops = order.permutation(np.flatnonzero(pose < n_read))
    for kind in (kind for kind in kinds if kind not in (*TOUCHED, BAR)):
        poses = plant.there[stops]
        found.append(reading(kind, out.layout, poses, stops, recipe.noise, stream(recipe.seed, kind)))
    own = [*out.touching, *([out.bar[:2]] if out.bar else [])]
    for gauge, q in own:
        place = np.argsort(pose, kind="stable")[np.searchsorted(np.sort(pose), first + np.arange(len(q)))]
        found.append(replace(gauge, stop=place))
        first += len(q)
    return found


def _dataset(recipe: Recipe, way: DayWay, gauges: Sequence[Gauge], missed: Sequence[Floats]) -> Tables:
    visits, robot = way.plant.visits, recipe.robot
    return Tables(
        robot=str(Path(robot).absolute()) if robot.endswith(".urdf") or "/" in robot or os.sep in robot else robot,
        tcp=None,
        reference_temperature=recipe.conditions.reference_temperature,
        pose=ids(visits.pose),
        q=visits.q,
        covariates=visits.columns(recipe.conditions),
        read=tuple(
            Read(gauge.described(), gauge.stop, gauge.columns(way.poses[gauge.stop], error))
            for gauge, error in zip(gauges, missed, strict=True)
        ),
    )


def _held_out(way: DayWay, gauges: Sequence[Gauge]) -> Poses:
    """(N) poses without errors by repeatability: as the tracker measures them where there is one, else without effects of the
    frame."""
    for gauge in gauges:
        if isinstance(gauge, Tracker):
            return gauge.seen(way.plant.seen(way.active), gauge.truth)
    poses: Poses = way.plant.settled(way.active)[0].poses
    return poses


def _truths(
    recipe: Recipe, plant: Plant, gauges: Sequence[Gauge], causes: Sequence[tuple[Cause, float]], repeatability: Floats
) -> tuple[Truth, ...]:
    """The truth about the effects at the final stops."""
    rows = np.concatenate([gauge.stop for gauge in gauges])
    past = _past(plant, gauges, repeatability)
    found = []
    for want, (cause, amplitude) in zip(recipe.wanted, causes, strict=True):
        displacement = plant.displacement([(cause, amplitude)])
        found.append(Truth(want.effect, want.site, past.energy(displacement), amplitude, displacement[rows, :6]))
    return tuple(sorted(found, key=lambda truth: -truth.energy))


def _past(plant: Plant, gauges: Sequence[Gauge], repeatability: Floats) -> PastReadings:
    poses, jitter = plant.there, plant.by_command() * repeatability
    return PastReadings.of(gauges, poses, plant.machine.by_tolerance(plant.visits.q, poses), jitter)


def _read(machine: Machine | ArmMachine) -> tuple[str, ...]:
    """Name of the joint that an encoder reads: the first passive joint of a loop, or that of the first rod; empty for an
    arm."""
    if isinstance(machine, Machine):
        return (machine.universal.name,)
    if not isinstance(machine, LoopedMachine):
        return ()
    return tuple(machine.robot.joints[j].name for j in machine.robot.loops.passive[:1])


def _geometry(machine: Machine | ArmMachine) -> dict[str, float]:
    if isinstance(machine, Machine):
        return dict(zip(machine.geometry.names, machine.geometry.deviation.tolist(), strict=True))
    robot = machine.robot
    places = [*(f"placement[{robot.joints[j].name}]" for j in robot.placed), "platform"]
    axes = ("x", "y", "z", "rx", "ry", "rz")
    values = np.vstack([machine.twists, machine.tool])
    found = {
        f"{place}.{axis}": float(value)
        for place, row in zip(places, values, strict=True)
        for axis, value in zip(axes, row, strict=True)
    }
    if isinstance(machine, LoopedMachine):
        for name, row in zip(machine.robot.loops.ends, machine.ends, strict=True):
            found |= {f"anchor[{name}].{axis}": float(value) for axis, value in zip("xyz", row, strict=True)}
    return found
