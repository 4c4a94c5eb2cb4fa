"""Makes a case from a recipe: the machine is drawn from its tolerances, commanded, and measured."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.arms.robot import Arm
from gtpin.bench.simulator.background import weak_others
from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.causes.kinds import kind
from gtpin.bench.simulator.energy import Past, PastGeometry
from gtpin.bench.simulator.looped.machine import LoopedMachine
from gtpin.bench.simulator.looped.robot import LoopedArm
from gtpin.bench.simulator.machine import Machine
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.recipe import Recipe, Wanted
from gtpin.bench.simulator.response import Plant
from gtpin.bench.simulator.tracker import Noise
from gtpin.bench.simulator.truth import Case, Truth
from gtpin.bench.simulator.visits import plan
from gtpin.data import Commands, Dataset
from gtpin.data import Conditions as Reference
from gtpin.data.ids import Ids
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.robot.library import load_robot
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

Rows = npt.NDArray[np.int_]
CLOSE = 1e-3
STEPS = 6


@dataclass(frozen=True)
class Built:
    """A machine with its effects and its visits of a day, before anything is measured.

    Parameters
    ----------
    plant
        The machine and all its visits.
    active, truths
        All its effects with their amplitudes, and the truth about those that the recipe asks for.
    rows
        Indices of the measured visits, in the order of the dataset's rows.
    background
        Joint energy E of the weak effects.
    repeatability
        (n,) standard deviation of each actuator, m or rad.
    jitter
        Random deviations by the repeatability, at every visit.
    away
        Position (3,), m, and rotation (3, 3) of the base frame in the instrument's frame; None where the two are the same.
    rng
        Source of the instrument's noise.
    """

    plant: Plant
    active: Sequence[tuple[Cause, float]]
    truths: Sequence[Truth]
    rows: Rows
    background: float
    repeatability: Floats
    jitter: Any
    away: tuple[Floats, Floats] | None
    rng: np.random.Generator

    def in_frame(self, seen: Poses) -> Poses:
        """Poses (N), base frame, in the instrument's frame."""
        return seen if self.away is None else seen.moved(*self.away)


def assemble(recipe: Recipe) -> Built:
    """Draw the machine and the visits of a recipe.

    Raises
    ------
    GtpinError
        If an effect or site is not known, or there is nothing to measure.
    """
    noise, conditions = recipe.noise, recipe.conditions
    if recipe.poses < 2 or recipe.held_out < 1:
        what = f"{recipe.poses} poses and {recipe.held_out} held out"
        raise GtpinError(what, hint="ask for at least two, and one held out")
    # A random stream for each part, so that the draws of one part do not change the others.
    streams = [np.random.default_rng(part) for part in np.random.SeedSequence([recipe.seed, 1]).spawn(5)]
    robot = known_robot(recipe.robot)
    if noise.free_target and not isinstance(robot, Arm):
        raise GtpinError(
            "a free target on six rods", hint="leave free_target out: the plant's rods carry theirs at the TCP"
        )
    machine = drawn_machine(robot, streams[0])
    if isinstance(machine, ArmMachine):
        machine = _as_measured(machine, noise, streams[0])
    visits = plan(machine, recipe.poses, recipe.held_out, conditions, streams[1])
    plant = Plant(machine, visits, np.array(noise.station))
    rows = streams[4].permutation(np.flatnonzero(~visits.held))
    past = PastGeometry.of(machine, visits.q[rows], plant.ideal.poses[rows], noise.sigma)
    causes, truths = strong(recipe.wanted, recipe.seed, plant, rows, past)
    weak: list[tuple[Cause, float]] = []
    energy = 0.0
    if recipe.background:
        taken = {(want.effect, want.site) for want in recipe.wanted}
        weak, energy = weak_others(plant, rows, past, taken, bool(recipe.wanted), streams[2])
    repeatability = noise.repeatability_of(machine, streams[3])
    return Built(
        plant=plant,
        active=[*causes, *weak],
        truths=truths,
        rows=rows,
        background=energy,
        repeatability=repeatability,
        jitter=machine.jitter(repeatability, len(visits), streams[3]),
        away=noise.elsewhere(streams[3]) if noise.free else None,
        rng=streams[4],
    )


def build(recipe: Recipe) -> Case:
    """Make the case of a recipe; see :func:`~gtpin.bench.simulator.case.make_case`."""
    made = assemble(recipe)
    plant, rows = made.plant, made.rows
    held = np.flatnonzero(plant.visits.held)
    mine, held_visits = plant.visits.take(rows), plant.visits.take(held)
    truth = made.in_frame(plant.seen(made.active)[held])
    true = made.in_frame(plant.seen(made.active, made.jitter)[rows])
    columns = mine.columns(recipe.conditions)
    return Case(
        name=f"case{recipe.seed:05d}",
        dataset=as_dataset(recipe, ids(mine.pose), mine.q, columns, recipe.noise.measured(true, made.rng)),
        commands=Commands(ids(np.arange(len(held))), held_visits.q, held_visits.columns(recipe.conditions)),
        truth=truth,
        effects=tuple(sorted(made.truths, key=lambda truth: -truth.energy)),
        machine=plant.machine,
        visits=mine,
        true=true,
        background=made.background,
        recipe=recipe,
    )


def strong(
    wanted: Sequence[Wanted], seed: int, plant: Plant, rows: Rows, past: Past
) -> tuple[list[tuple[Cause, float]], list[Truth]]:
    """The effects that a recipe asks for, with their amplitudes, and their truth at the measured rows."""
    causes, truths = [], []
    for want, part in zip(wanted, np.random.SeedSequence([seed, 2]).spawn(len(wanted)), strict=True):
        found = kind(want.effect, plant.machine.robot)
        cause = found.at(plant.machine.robot, want.site, np.random.default_rng(part), want.periods)
        amplitude = 1.0 if want.amplitude is None else want.amplitude
        if want.energy is not None:
            amplitude = amplitude_for(plant, cause, rows, past, want.energy, found.largest)
        displacement = plant.displacement([(cause, amplitude)])[rows]
        causes.append((cause, amplitude))
        truths.append(Truth(want.effect, want.site, past.energy(displacement), amplitude, displacement))
    return causes, truths


def as_dataset(recipe: Recipe, pose: Ids, q: Floats, columns: dict[str, Column], seen: Poses) -> Dataset:
    """The measurements as a dataset."""
    robot, noise = recipe.robot, recipe.noise
    return Dataset(
        robot=str(Path(robot).absolute()) if robot.endswith(".urdf") or "/" in robot or os.sep in robot else robot,
        pose=pose,
        q=q,
        position=seen.T,
        orientation=seen.quaternions if noise.orientations else None,
        covariates=columns,
        instrument=noise.instrument,
        conditions=Reference(reference_temperature=recipe.conditions.reference_temperature),
    )


def ids(numbers: Rows) -> Ids:
    """(N,) ids of poses, from their numbers."""
    return np.array([str(number) for number in numbers], dtype=object)


@cache
def known_robot(robot: str) -> Robot | Arm:
    """A robot by its name or path. It is loaded once, because the plant does not change it."""
    found = load_robot(robot)
    if found.rods:
        return found
    return LoopedArm.of(found) if found.description.loops else Arm.of(found)


def capacity(robot: Robot | Arm) -> float:
    """Payload that a robot may carry, kg; 20 kg for a robot with rods."""
    return robot.capacity if isinstance(robot, Arm) else 20.0


def drawn_machine(robot: Robot | Arm, rng: np.random.Generator) -> Machine | ArmMachine:
    """A machine of a robot, drawn from its tolerances."""
    if isinstance(robot, LoopedArm):
        return LoopedMachine.draw(robot, rng)
    return ArmMachine.draw(robot, rng) if isinstance(robot, Arm) else Machine.draw(robot, rng)


def nominal_arm(robot: Arm) -> ArmMachine:
    """The machine that the URDF of an arm or of a robot with loops describes."""
    return LoopedMachine.nominal(robot) if isinstance(robot, LoopedArm) else ArmMachine.nominal(robot)


def _as_measured(machine: ArmMachine, noise: Noise, rng: np.random.Generator) -> ArmMachine:
    machine = replace(machine, free=(noise.free, noise.free_target))
    return replace(machine, target=noise.target(rng)) if noise.free_target else machine


def amplitude_for(
    plant: Plant, cause: Cause, rows: npt.NDArray[np.int_], past: Past, energy: float, largest: float
) -> float:
    """Amplitude of a cause, in typical sizes, at which it has ``energy`` at the visits ``rows``; at most ``largest``."""
    amplitude = 1.0
    for _ in range(STEPS):
        reached = past.energy(plant.displacement([(cause, amplitude)])[rows])
        if abs(reached - energy) <= CLOSE * energy:
            break
        # The energy is almost proportional to the square of the amplitude.
        wanted = amplitude * np.sqrt(energy / reached) if reached > 0.0 else largest
        if wanted >= largest and amplitude == largest:
            break
        amplitude = float(min(wanted, largest))
    return amplitude
