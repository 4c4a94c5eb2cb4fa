"""From what a machine shall have to a case: the machine is drawn, sent on its way, and measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.data import Commands, Dataset
from gtpin.data import Conditions as Reference
from gtpin.data.ids import Ids
from gtpin.errors import GtpinError
from gtpin.kinematics.poses import Poses
from gtpin.plant.amplitude import amplitude_for
from gtpin.plant.background import weak_others
from gtpin.plant.causes.cause import Cause
from gtpin.plant.causes.kinds import kind
from gtpin.plant.conditions import Conditions
from gtpin.plant.energy import PastGeometry
from gtpin.plant.machine import Machine
from gtpin.plant.response import Plant
from gtpin.plant.tracker import Noise
from gtpin.plant.truth import Case, Truth
from gtpin.plant.visits import Visits, plan
from gtpin.robot.library import load_robot, robot_names
from gtpin.robot.robot import Robot

Rows = npt.NDArray[np.int_]


@dataclass(frozen=True)
class Wanted:
    """An effect that a machine shall have: how strong by its energy, or else by its amplitude in typical sizes."""

    effect: str
    site: str
    energy: float | None = None
    amplitude: float | None = None


def build(
    wanted: Sequence[Wanted],
    seed: int,
    *,
    robot: str,
    poses: int,
    held_out: int,
    noise: Noise,
    conditions: Conditions,
    background: bool = True,
) -> Case:
    """Make the case of a machine with the effects wanted; see :func:`~gtpin.plant.case.make_case`."""
    if poses < 2 or held_out < 1:
        raise GtpinError(f"{poses} poses and {held_out} held out", hint="ask for at least two, and one held out")
    # A stream for each part: what one of them draws does not change the others.
    streams = [np.random.default_rng(part) for part in np.random.SeedSequence([seed, 1]).spawn(5)]
    machine = Machine.draw(known_robot(robot), streams[0])
    plant = Plant(machine, plan(machine, poses, held_out, conditions, streams[1]), np.array(noise.station))
    rows = streams[4].permutation(np.flatnonzero(~plant.visits.held))
    past = PastGeometry.of(machine, plant.visits.q[rows], plant.ideal.poses[rows], noise.sigma)
    causes, truths = _strong(wanted, seed, plant, rows, past)
    weak: list[tuple[Cause, float]] = []
    energy = 0.0
    if background:
        taken = {(want.effect, want.site) for want in wanted}
        weak, energy = weak_others(plant, rows, past, taken, bool(wanted), streams[2])
    active = [*causes, *weak]
    held = np.flatnonzero(plant.visits.held)
    jitter = noise.jitter(machine, len(plant.visits), streams[3])
    truth, true = plant.seen(active)[held], plant.seen(active, jitter)[rows]
    if noise.free:
        away = noise.elsewhere(streams[3])
        truth, true = truth.moved(*away), true.moved(*away)
    mine, asked = plant.visits.take(rows), plant.visits.take(held)
    return Case(
        name=f"case{seed:05d}",
        dataset=_dataset(robot, mine, noise.measured(true, streams[4]), noise, conditions),
        commands=Commands(_ids(np.arange(len(held))), asked.q, asked.columns(conditions)),
        truth=truth,
        effects=tuple(sorted(truths, key=lambda truth: -truth.energy)),
        machine=machine,
        visits=mine,
        true=true,
        background=energy,
    )


def _strong(
    wanted: Sequence[Wanted], seed: int, plant: Plant, rows: Rows, past: PastGeometry
) -> tuple[list[tuple[Cause, float]], list[Truth]]:
    """The effects wanted, with their amplitudes, and what they do at the rows that are measured."""
    causes, truths = [], []
    for want, part in zip(wanted, np.random.SeedSequence([seed, 2]).spawn(len(wanted)), strict=True):
        found = kind(want.effect)
        cause = found.at(plant.machine.robot, want.site, np.random.default_rng(part))
        amplitude = 1.0 if want.amplitude is None else want.amplitude
        if want.energy is not None:
            amplitude = amplitude_for(plant, cause, rows, past, want.energy, found.largest)
        displacement = plant.displacement([(cause, amplitude)])[rows]
        causes.append((cause, amplitude))
        truths.append(Truth(want.effect, want.site, past.energy(displacement), amplitude, displacement))
    return causes, truths


def _dataset(robot: str, visits: Visits, seen: Poses, noise: Noise, conditions: Conditions) -> Dataset:
    return Dataset(
        robot=robot if robot in robot_names() else str(Path(robot).absolute()),
        pose=_ids(visits.pose),
        q=visits.q,
        position=seen.T,
        orientation=seen.quaternions if noise.orientations else None,
        covariates=visits.columns(conditions),
        instrument=noise.instrument,
        conditions=Reference(reference_temperature=conditions.reference_temperature),
    )


def _ids(numbers: Rows) -> Ids:
    return np.array([str(number) for number in numbers], dtype=object)


@cache
def known_robot(robot: str) -> Robot:
    """A robot, loaded once: nothing here changes it."""
    return load_robot(robot)
