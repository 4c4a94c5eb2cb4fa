"""Makes a case from a recipe: the machine is drawn from its tolerances, commanded, and measured; once more later if wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.causes.kinds import PlantedCause
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.noncentrality import Past, Response, effects_of
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.recipe import Machine, Recipe, SimulatedConditions
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.truth import Case, EffectTruth
from gtpin.bench.simulator.visits import BACK_OFF, VirtualVisits, ids, plan
from gtpin.data import Commands, Dataset
from gtpin.data import Conditions as Reference
from gtpin.data.ids import Ids
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.references import is_path
from gtpin.robot.chain import Chain
from gtpin.robot.library import load_robot
from gtpin.typing import Floats, Ints


@cache
def known_robot(robot: str) -> Chain | Arm:
    """A robot by its name or path. It is loaded once, because the simulator does not change it."""
    found = load_robot(robot)
    return found if found.rods else Arm.of(found)


def drawn_machine(robot: Chain | Arm, rng: np.random.Generator) -> Machine:
    """A machine of a robot, drawn from its tolerances."""
    return ArmMachine.draw(robot, rng) if isinstance(robot, Arm) else RodMachine.draw(robot, rng)


@dataclass(frozen=True)
class Built:
    """A machine with its effects and its visits of a day, before anything is measured."""

    response: Response  # The machine and all its visits
    active: Sequence[tuple[PlantedCause, float]]  # All its effects with their amplitudes
    truths: Sequence[EffectTruth]  # Of the effects that the recipe asks for
    rows: Ints  # Indices of the measured visits, in the order of the dataset's rows
    background: float  # Joint energy E of the weak effects
    repeatability: Floats  # (n,) standard deviation of each actuator, m or rad
    jitter: Deviation  # Random deviations by the repeatability, at every visit
    away: tuple[Floats, Floats] | None  # Base frame in the instrument's: position, m, rotation; None: the same frame
    rng: np.random.Generator  # Source of the instrument's noise

    def in_frame(self, seen: VirtualPoses) -> VirtualPoses:
        """Poses (N), base frame, in the instrument's frame."""
        return seen if self.away is None else seen.moved(*self.away)


def assemble(recipe: Recipe) -> Built:
    """Draw the machine and the visits of a recipe.

    Raises GtpinError if an effect or site is not known, or there is nothing to measure.
    """
    noise, conditions = recipe.noise, recipe.conditions
    if recipe.poses < 2 or recipe.held_out < 1:
        what = f"{recipe.poses} poses and {recipe.held_out} held out"
        raise GtpinError(what, hint="ask for at least two, and one held out")
    # A random stream for each part, so that the draws of one part do not change the others.
    streams = [np.random.default_rng(part) for part in np.random.SeedSequence([recipe.seed, 1]).spawn(5)]
    machine = drawn_machine(known_robot(recipe.robot), streams[0])
    if isinstance(machine, ArmMachine):
        target = noise.target(streams[0]) if noise.free_target else machine.target
        machine = replace(machine, free=(noise.free, noise.free_target), target=target)
    elif noise.free_target:
        hint = "leave free_target out: the simulator's rods carry theirs at the TCP"
        raise GtpinError("a free target on six rods", hint=hint)
    visits = plan(machine, recipe.poses, recipe.held_out, conditions, streams[1])
    response = Response(machine, visits, np.array(noise.station))
    rows = streams[4].permutation(np.flatnonzero(~visits.held))
    past = Past.of_poses(machine, visits.q[rows], response.ideal.poses[rows], noise.sigma)
    strong, truths, weak, noncentrality = effects_of(recipe, response, rows, past, streams[2])
    repeatability = noise.repeatability_of(machine, streams[3])
    return Built(
        response=response,
        active=[*strong, *weak],
        truths=truths,
        rows=rows,
        background=noncentrality,
        repeatability=repeatability,
        jitter=machine.jitter(repeatability, len(visits), streams[3]),
        away=noise.elsewhere(streams[3]) if noise.free else None,
        rng=streams[4],
    )


def build(recipe: Recipe) -> Case:
    """Make the case of a recipe; see :func:`~gtpin.bench.simulator.case.make_case`."""
    made, conditions = assemble(recipe), recipe.conditions
    response, held = made.response, np.flatnonzero(made.response.visits.held)
    mine, held_visits = response.visits.take(made.rows), response.visits.take(held)
    truth = made.in_frame(response.seen(made.active)[held])
    true = made.in_frame(response.seen(made.active, made.jitter)[made.rows])
    measured = recipe.noise.measured(true, made.rng)
    return Case(
        name=f"case{recipe.seed:05d}",
        dataset=as_dataset(recipe, ids(mine.pose), mine.q, mine.columns(conditions), measured),
        commands=Commands(ids(np.arange(len(held))), held_visits.q, held_visits.columns(conditions)),
        truth=truth,
        effects=tuple(sorted(made.truths, key=lambda truth: -truth.noncentrality)),
        machine=response.machine,
        visits=mine,
        true=true,
        background=made.background,
        recipe=recipe,
    )


def measure_at(case: Case, commands: Commands, seed: int = 0) -> Dataset:
    """Measure the machine of a case again, after its day, with the same instrument at the same place.

    These covariates of the commands are applied: ``approach1..n`` and ``speed1..n`` (with equal signs), ``payload``,
    ``fx fy fz``, ``session``, ``time`` (after the day's last visit), ``temp_frame`` and ``temp_link``. Covariates that are not
    given have their values at the end of the day; directions of approach are then random, speeds and forces zero. Effects that
    depend on earlier loads and moves start without this history.

    ``commands``: commands, and covariates by name, in the order in which they are measured. ``seed``: seed of the
    instrument's noise and the repeatability. The same seed gives the same bytes.

    Returns one row for each command, with the covariates of the case's dataset and those of the commands.

    Raises `GtpinError` if conditions contradict each other, or a pose can't be reached.
    """
    made, recipe = assemble(case.recipe), case.recipe
    rng = np.random.default_rng(np.random.SeedSequence([recipe.seed, 5, seed]))
    visits = _later(made.response.visits, commands, recipe.conditions, rng)
    response = Response(made.response.machine, visits, made.response.station)
    jitter = response.machine.jitter(made.repeatability, len(visits), rng)
    true = made.in_frame(response.seen(made.active, jitter))
    columns = {**visits.columns(recipe.conditions), **commands.covariates}
    return as_dataset(recipe, commands.pose, commands.q, columns, recipe.noise.measured(true, rng))


def _later(
    day: VirtualVisits, commands: Commands, conditions: SimulatedConditions, rng: np.random.Generator
) -> VirtualVisits:
    """The commands as visits after those of a day."""
    given, q, total = commands.covariates, commands.q, len(commands)

    def wanted(name: str, otherwise: Column | float) -> Floats:
        return np.asarray(np.broadcast_to(np.asarray(given.get(name, otherwise), dtype=float), total))

    def each(name: str, otherwise: Floats) -> Floats:
        return np.column_stack([wanted(f"{name}{i + 1}", otherwise[:, i]) for i in range(q.shape[1])])

    last = float(day.time[-1])
    time = wanted("time", last + 600.0 + conditions.interval * np.arange(total))
    if not total or time[0] <= last or (np.diff(time) < 0.0).any():
        raise GtpinError("times that do not go on from the day", hint=f"give ascending times after {last:.0f} s")
    speed = each("speed", np.zeros_like(q))
    approach = each("approach", np.where(speed != 0.0, np.sign(speed), rng.choice([-1.0, 1.0], q.shape)))
    if (np.abs(approach) != 1.0).any() or (speed * approach < 0.0).any():
        what = "an actuator that moves one way and comes from the other"
        raise GtpinError(what, hint="give speed the approach's sign")
    session = np.full(total, day.session[-1])
    if "session" in given:
        names = [str(name) for name in given["session"]]
        if wrong := [name for name in names if not name.isdecimal() or int(name) >= 20]:
            raise GtpinError(f"session {wrong[0]!r}", hint="number the simulator's sessions from 0 to 19")
        session = np.array([int(name) for name in names])
    temperatures = (wanted("temp_frame", day.day.frame[-1]), wanted("temp_link", day.day.link[-1]))
    return VirtualVisits(
        pose=np.arange(total),
        held=np.zeros(total, dtype=bool),
        q=q,
        before=q - approach * rng.uniform(*BACK_OFF, q.shape),
        time=time,
        session=session,
        payload=wanted("payload", day.payload[-1]),
        force=np.column_stack([wanted(f"f{axis}", 0.0) for axis in "xyz"]),
        speed=speed,
        acceleration=np.abs(speed) * approach * 0.4 * rng.standard_normal((total, 1)),
        day=day.day.continued(time, *temperatures),
    )


def as_dataset(recipe: Recipe, pose: Ids, q: Floats, columns: dict[str, Column], seen: VirtualPoses) -> Dataset:
    """The measurements as a dataset."""
    return Dataset(
        robot=reference(recipe.robot),
        pose=pose,
        q=q,
        position=seen.T,
        orientation=seen.quaternions if recipe.noise.orientations else None,
        covariates=columns,
        instrument=recipe.noise.instrument,
        conditions=Reference(reference_temperature=recipe.conditions.reference_temperature),
    )


def reference(robot: str) -> str:
    """A robot's name, or the absolute path of its file, as a dataset names it."""
    return str(Path(robot).absolute()) if is_path(robot) else robot
