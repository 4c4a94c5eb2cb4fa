"""Makes a case that instruments measure: from a recipe, or of a machine without effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.build import drawn_machine, known_robot, reference
from gtpin.bench.simulator.instruments.gauge import Gauge, Layout
from gtpin.bench.simulator.instruments.readers import READERS, VirtualRange, VirtualTracker
from gtpin.bench.simulator.instruments.touch import TOUCHED, begun, circles, felt, motion_of
from gtpin.bench.simulator.machine import Moved
from gtpin.bench.simulator.noncentrality import Past, Response, effects_of
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.recipe import Machine, Recipe, SimulatedNoise
from gtpin.bench.simulator.simulate import TrueRobot, draw_commands, draw_machine
from gtpin.bench.simulator.truth import EffectTruth, InstrumentCase, Tables
from gtpin.bench.simulator.visits import REPEATED, VirtualVisits, ids, visited
from gtpin.data import Commands
from gtpin.errors import GtpinError
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

KINDS = ("tracker", "camera", "range", "plane", "socket", "tilt", "encoder", "ballbar")
"""Kinds of instruments: those of a dataset, a camera (a tracker of several targets), and a ball bar (a range)."""
BAR = "ballbar"
"""This kind has its own stops, along circles."""


def checked(kinds: Sequence[str]) -> tuple[str, ...]:
    """The kinds in the order of KINDS. Raises GtpinError if a kind is not known, or given twice."""
    for i, kind in enumerate(kinds):
        if kind not in KINDS:
            raise GtpinError(f"no instrument is called {kind!r}", hint=f"use {', '.join(KINDS)}")
        if kind in kinds[:i]:
            raise GtpinError(f"the instrument {kind} comes twice", hint="name it once")
    return tuple(kind for kind in KINDS if kind in kinds)


def stream(seed: int, kind: str) -> np.random.Generator:
    """Random stream for the unknowns of an instrument: the same whatever other instruments there are."""
    return np.random.default_rng(np.random.SeedSequence([seed, 6, KINDS.index(kind)]))


def errors(gauge: Gauge, noise: SimulatedNoise, seed: int) -> Floats:
    """(M, c) random errors of an instrument's readings: with its sigma, and with the tails and gross errors of ``noise``.

    They are the same whatever other instruments there are.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 8, *gauge.name.encode()]))
    found = gauge.sigma * noise.drawn(rng, gauge.sigma.shape)
    return np.asarray(found + gauge.sigma * noise.drawn_gross(rng, found.shape))


def held_readings(gauges: Sequence[Gauge], poses: VirtualPoses) -> dict[str, tuple[Floats, Floats]]:
    """Readings of instruments at poses (H) without noise, with ids in turn, and their sigmas, by name; see ``InstrumentCase``.

    Touched instruments are left out: the machine does not touch them at these poses.
    """
    found = {}
    for gauge in (gauge for gauge in gauges if not gauge.touches):
        one = gauge.in_turn(len(poses))
        found[gauge.name] = one.readings(poses, one.truth)[:, :3], one.sigma[:, :3]
    return found


POOL = 1000
"""Number of commands all over the workspace. Instruments are placed by them, and the search of touches starts from them."""
MOST = 0.2
"""Largest share of the touches that may fail: where an effect has a step, there can be no command that touches."""


Own = tuple[Gauge, Floats, Floats | None]
"""An instrument with its own stops, counted from 0; the commands (M, n) there; the speeds (M, n) along a ball bar's circles."""


def outing(
    kinds: Sequence[str],
    moved: Moved,
    nominal: Moved,
    robot: Chain | Arm,
    pool: Floats,
    poses: int,
    noise: SimulatedNoise,
    seed: int,
) -> tuple[Layout, dict[str, Own]]:
    """The workspace that the commands ``pool`` (P, n) fill, and the instruments with their own stops, by kind.

    Touches are those of the machine ``moved``, without effects; circles those of the ``nominal`` one.
    """
    gravity = robot.gravity if isinstance(robot, Arm) else np.array(robot.description.gravity)
    layout, ranges = Layout.of(moved.predict(pool), gravity, pool.shape[1]), (robot.lower, robot.upper)
    found: dict[str, Own] = {}
    for kind in kinds:
        rng = stream(seed, kind)
        if kind in TOUCHED:
            gauge = TOUCHED[kind](layout, np.arange(poses), noise.declared, rng)
            found[kind] = gauge, begun(gauge, moved, pool, ranges, rng), None
        elif kind == BAR:
            q, speed = circles(nominal, layout, pool, ranges, poses)
            found[kind] = VirtualRange.bar(layout, np.arange(len(q)), noise.declared, rng), q, speed
    return layout, found


ONE_IN = 6
"""One in this many of an instrument's touches is left out, at random."""


def without_some_touches(gauges: Sequence[Gauge], seed: int) -> tuple[list[Gauge], tuple[Gauge, ...]]:
    """Instruments without some of their touches, and the touching ones with these alone."""
    kept, left_out = [], []
    for gauge in gauges:
        stays = np.ones(len(gauge.stop), dtype=bool)
        if gauge.touches:
            rng = np.random.default_rng(np.random.SeedSequence([seed, 9, *gauge.name.encode()]))
            stays[rng.permutation(len(stays))[: len(stays) // ONE_IN]] = False
            left_out.append(gauge.take(~stays))
        kept.append(gauge.take(stays))
    return kept, tuple(left_out)


def build_measured(recipe: Recipe, instruments: Sequence[str], *, leave_out: bool = False) -> InstrumentCase:
    """Make the case of a recipe, measured by some instruments.

    ``recipe.poses`` is the number of poses at which the reading instruments read, and the number of touches of each touched
    one. ``leave_out``: whether some touches are left out of the dataset. None is where an encoder measures too: the truth has
    no displacements of its joint.

    Raises `GtpinError` if an instrument, effect or site is not known, the robot can't make the touches, or there is nothing
    to measure.
    """
    kinds, noise, seed = checked(instruments), recipe.noise, recipe.seed
    if not kinds or recipe.poses < 2 or recipe.held_out < 1:
        what = f"{len(kinds)} instruments, {recipe.poses} poses and {recipe.held_out} held out"
        raise GtpinError(what, hint="ask for at least one instrument, two poses, and one held out")
    if noise.free_target:
        hint = "leave free_target out: instruments have targets of their own"
        raise GtpinError("a free target with --instrument", hint=hint)
    streams = [np.random.default_rng(part) for part in np.random.SeedSequence([seed, 5]).spawn(5)]
    machine = drawn_machine(known_robot(recipe.robot), streams[0])
    pool = machine.reachable(POOL, streams[1])
    layout, own = outing(kinds, machine, machine.nominal(), machine.robot, pool, recipe.poses, noise, seed)
    reading = [kind for kind in kinds if kind in READERS]
    n_read = recipe.poses if reading else 0
    plain = machine.reachable(n_read + recipe.held_out, streams[1])
    q = np.vstack([plain[:n_read], *(own_q for _, own_q, _ in own.values()), plain[n_read:]])
    visits = visited(machine, q, len(q) - recipe.held_out, n_read, recipe.conditions, streams[1])
    if BAR in own:
        visits = _round(visits, len(q) - recipe.held_out, *own[BAR][1:])
    read = machine.readable if "encoder" in kinds else ()
    response = Response(machine, visits, np.array(noise.station), read)
    # The instruments at the stops of a day: those that read, at the first `n_read` poses; then those with their own stops.
    order = np.random.default_rng(np.random.SeedSequence([seed, 7]))
    stops = order.permutation(np.flatnonzero(visits.pose < n_read))
    there = response.there[stops]
    gauges = [READERS[kind](layout, there, stops, noise, stream(seed, kind)) for kind in reading]
    by_pose, first = np.argsort(visits.pose, kind="stable"), n_read
    for gauge, own_q, _ in own.values():
        place = by_pose[np.searchsorted(visits.pose[by_pose], first + np.arange(len(own_q)))]
        gauges.append(replace(gauge, stop=place))
        first += len(own_q)
    repeatability, every = noise.repeatability_of(machine, streams[3]), np.arange(len(visits))
    past = _past(machine, visits.q, response.there, gauges, repeatability)
    strong, _, weak, _ = effects_of(recipe, response, every, past, streams[2])
    jitter = machine.jitter(repeatability, len(visits), streams[3])
    missed = [errors(gauge, noise, seed) for gauge in gauges]
    active = [*strong, *weak]

    def motion(q: Floats) -> tuple[VirtualPoses, Floats]:
        nonlocal response
        response = response.at(q)
        return response.seen(active, jitter), machine.command_jacobian(q, response.there)[:, :6]

    q, good = felt(motion, visits.q, gauges, missed)
    response = response.at(q)
    touching = sum(len(gauge.stop) for gauge in gauges if gauge.touches)
    if touching and (~good).sum() > MOST * touching:
        raise GtpinError("the machine misses most of its touches", hint="make the effects smaller")
    missed = [error[good[gauge.stop]] for gauge, error in zip(gauges, missed, strict=True)]
    gauges = [gauge.take(good[gauge.stop]) for gauge in gauges]
    left_out: tuple[Gauge, ...] = ()
    visits, held = response.visits, np.flatnonzero(response.visits.held)
    true, steady, tracker = response.seen(active, jitter), response.seen(active), _tracker(gauges)
    gauges = _read(true, gauges, missed)
    if leave_out and not read:
        gauges, left_out = without_some_touches(gauges, seed)
    rows = np.concatenate([gauge.stop for gauge in gauges])
    past = _past(machine, q, true if left_out else response.there, gauges, repeatability)
    truths = []
    for want, (cause, amplitude) in zip(recipe.wanted, strong, strict=True):
        d = response.displacement([(cause, amplitude)])
        truths.append(EffectTruth(want.effect, want.site, past.noncentrality(d), amplitude, d[rows, :6]))
    return InstrumentCase(
        name=f"case{seed:05d}",
        dataset=Tables(
            robot=reference(recipe.robot),
            tcp=None,
            reference_temperature=recipe.conditions.reference_temperature,
            pose=ids(visits.pose),
            q=visits.q,
            covariates=visits.columns(recipe.conditions),
            read=tuple(gauges),
        ),
        commands=Commands(ids(np.arange(len(held))), visits.q[held], visits.take(held).columns(recipe.conditions)),
        truth=(tracker.seen(steady, tracker.truth) if tracker else response.settled(active)[0].poses)[held],
        effects=tuple(sorted(truths, key=lambda truth: -truth.noncentrality)),
        machine=machine,
        true=true,
        recipe=recipe,
        steady=steady,
        repeatability=repeatability,
        held=held_readings(gauges, steady[held])
        | {one.name: (one.readings(steady[one.stop], one.truth), one.sigma) for one in left_out},
        left_out=left_out,
    )


def _round(visits: VirtualVisits, end: int, q: Floats, speed: Floats | None) -> VirtualVisits:
    """Visits whose last poses before ``end`` are along circles, in the order of travel."""
    assert speed is not None
    place = np.flatnonzero((visits.pose >= end - len(q)) & (visits.pose < end))  # in order of time
    before = q - speed  # the command one second earlier
    new = {"pose": end - len(q) + np.arange(len(q)), "q": q, "before": before, "speed": speed, "acceleration": 0.0}
    changed = {name: getattr(visits, name).copy() for name in new}
    for name, values in new.items():
        changed[name][place] = values
    return replace(visits, **changed)


def _past(machine: Machine, q: Floats, poses: VirtualPoses, gauges: Sequence[Gauge], repeatability: Floats) -> Past:
    jitter = machine.command_jacobian(q, poses) * repeatability
    return Past.of_readings(gauges, poses, machine.by_tolerance(q, poses), jitter)


def _tracker(gauges: Sequence[Gauge]) -> VirtualTracker | None:
    return next((gauge for gauge in gauges if isinstance(gauge, VirtualTracker)), None)


def _read(poses: VirtualPoses, gauges: Sequence[Gauge], missed: Sequence[Floats]) -> list[Gauge]:
    """The instruments with the columns of their tables, with errors (M, c) of the readings."""
    read = zip(gauges, missed, strict=True)
    return [replace(gauge, columns=gauge.recorded(poses[gauge.stop], error)) for gauge, error in read]


def simulate_measured(
    robot: Chain,
    reference: str,
    instruments: Sequence[str],
    *,
    poses: int = 200,
    seed: int = 0,
    held_out: int = 120,
    tcp: str | None = None,
) -> InstrumentCase:
    """Draw a machine without effects, command it, and measure it by some instruments.

    ``robot``: the nominal robot. ``reference``, ``tcp``: name of the robot and of its TCP frame in the dataset.
    ``instruments``: kinds of instruments: see :data:`KINDS`. ``poses``: number of
    poses at which the reading instruments read (a tenth of them twice), and number of touches of each touched one.
    ``seed``: seed of the random numbers. The same seed gives the same bytes. ``held_out``: number of further commands,
    which are not measured and whose truth is given.

    Raises `GtpinError` if an instrument is not known, the robot hardly reaches its range or can't make the touches, or
    there is nothing to measure.
    """
    kinds, noise = checked(instruments), SimulatedNoise()
    if not kinds or poses < 1 or held_out < 1:
        what = f"{len(kinds)} instruments, {poses} poses and {held_out} held out"
        raise GtpinError(what, hint="ask for at least one of each")
    rng = np.random.default_rng(seed)
    machine = replace(draw_machine(robot, rng), read="encoder" in kinds)
    pool = draw_commands(machine, POOL, rng)
    layout, own = outing(kinds, machine, TrueRobot(Geometry.nominal(robot)), robot, pool, poses, noise, seed)
    pose, q = np.zeros(0, dtype=int), np.zeros((0, robot.n_actuators))
    reading = [kind for kind in kinds if kind in READERS]
    if reading:
        again = rng.choice(poses, size=int(REPEATED * poses), replace=False)
        pose = rng.permutation(np.concatenate([np.arange(poses), again]))
        q = draw_commands(machine, poses, rng)[pose]
    there, stops = machine.predict(q), np.arange(len(q))
    found = {kind: READERS[kind](layout, there, stops, noise, stream(seed, kind)) for kind in reading}
    for kind, (gauge, own_q, _) in own.items():
        found[kind] = replace(gauge, stop=len(q) + gauge.stop)
        pose = np.concatenate([pose, (pose.max() + 1 if len(pose) else 0) + gauge.stop])
        q = np.vstack([q, own_q])
    gauges = [found[kind] for kind in kinds]
    missed = [errors(gauge, noise, seed) for gauge in gauges]
    q, _ = felt(motion_of(machine), q, gauges, missed)
    held = draw_commands(machine, held_out, rng)
    true, truth, tracker = machine.predict(q), machine.predict(held), _tracker(gauges)
    return InstrumentCase(
        name=f"case{seed:05d}",
        dataset=Tables(
            robot=reference,
            tcp=tcp,
            reference_temperature=20.0,
            pose=ids(pose),
            q=q,
            covariates={},
            read=tuple(_read(true, gauges, missed)),
        ),
        commands=Commands(ids(np.arange(held_out)), held),
        truth=tracker.seen(truth, tracker.truth) if tracker else truth,
        machine=machine,
        true=true,
        steady=true,  # a machine without effects returns exactly
        repeatability=np.zeros(robot.n_actuators),
        held=held_readings(gauges, truth),
    )
