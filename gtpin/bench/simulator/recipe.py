"""The inputs from which the same machine and case are made again: effects, noise, measurement conditions."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, Field

from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.poses import VirtualPoses, exp
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.tree import TreeFrame
from gtpin.data import InstrumentSection
from gtpin.typing import Floats

Machine = RodMachine | ArmMachine
"""A machine with n drives as it was really built, with what its effects depend on."""
Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Micro = Annotated[float, Field(ge=0.0, le=1e-3)]


class SimulatedConditions(BaseModel, frozen=True, extra="forbid"):
    """Measurement conditions of a machine.

    - ``rest``: share of the poses at which the machine stands still; it passes the others in motion.
    - ``sessions``: number of sessions. With two or more there is a column ``session``.
    - ``payloads``: payloads, kg, in ``payload_blocks`` blocks of time.
    - ``push``: standard deviation per axis, N, of forces on the tool. They act at half of the visits, drawn at random. Above 0
      there are columns ``fx fy fz``.
    - ``interval``: mean time between visits, s.
    - ``direct``: share of the visits that are reached directly from the one before; the others through a point at some
      centimetres, so that each actuator approaches from a random side.
    - ``order``: ``random``, or ``layers``: by the mean of the actuators' places in their ranges, in layers, and within a layer
      by the difference of the first two commands. The second visits follow after all first ones.
    - ``warming``: factor on the drawn changes of temperature.
    - ``reference_temperature``: temperature of everything when the day starts, degC.
    - ``without``: columns (or beginnings of their names, such as ``temp``) that the files lack.
    """

    rest: Share = 0.5
    sessions: Annotated[int, Field(ge=1, le=20)] = 1
    payloads: Annotated[tuple[Annotated[float, Field(ge=0.0, le=200.0)], ...], Field(min_length=1)] = (0.0, 10.0, 20.0)
    payload_blocks: Annotated[int, Field(ge=1, le=100)] = 6
    push: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    interval: Annotated[float, Field(gt=0.0, le=3600.0)] = 25.0
    direct: Share = 0.3
    order: Literal["random", "layers"] = "random"
    warming: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    reference_temperature: Finite = 20.0
    without: tuple[str, ...] = ()

    @staticmethod
    def draw(rng: np.random.Generator, needs: Collection[str] = (), capacity: float = 20.0) -> SimulatedConditions:
        """Random conditions; those that ``needs`` names (``session``, ``speed``, ``payload``, ``force``, ``heat``) vary.

        Payloads are up to ``capacity``, kg, and forces on the tool are proportional to it.
        """
        part = capacity / 20.0
        resting = rng.random() < 0.15 and "speed" not in needs
        sessions = int(rng.integers(2, 4)) if "session" in needs or rng.random() < 0.3 else 1
        constant = rng.random() < 0.15 and "payload" not in needs
        return SimulatedConditions(
            rest=1.0 if resting else round(float(rng.uniform(0.4, 0.65)), 2),
            sessions=sessions,
            payloads=(part * float(rng.choice([0.0, 10.0, 20.0])),) if constant else (0.0, 10.0 * part, 20.0 * part),
            payload_blocks=int(rng.integers(3, 13)),
            push=part
            * (round(float(rng.uniform(120.0, 250.0)), 0) if "force" in needs else 60.0 * bool(rng.random() < 0.3)),
            interval=round(float(rng.uniform(12.0, 45.0)), 1),
            direct=round(float(rng.uniform(0.0, 0.6)), 2),
            order="layers" if rng.random() < 0.1 else "random",
            warming=round(float(rng.uniform(1.0, 2.5) if "heat" in needs else rng.uniform(0.6, 1.8)), 2),
        )


class SimulatedNoise(BaseModel, frozen=True, extra="forbid"):
    """Random errors of the instrument and the machine.

    - ``position_sigma``, ``orientation_sigma``: standard deviation per axis, m and rad.
    - ``repeatability``: range, m, from which the standard deviation of each cart along its track is drawn; the errors are
      drawn at every visit. Across the track the standard deviation is 0.3 of that along it, in both directions.
    - ``declared``: whether the dataset states the sigmas.
    - ``by_range``: relative increase of the position's sigma between the mean distance from the instrument and twice this
      distance; 0: the sigma is constant.
    - ``tails``: degrees of freedom of a Student distribution with the same sigma; None for a normal one.
    - ``gross``: share of the measurements with gross errors, of 10 to 100 sigma.
    - ``orientations``: whether orientations are measured.
    - ``free``: whether the instrument measures in its own frame, whose pose is unknown to the user.
    - ``free_target``: whether the target of an arm has an unknown pose in the TCP frame: a distance of some tens of mm, and
      any orientation.
    - ``station``: position of the instrument, base frame, m.
    """

    position_sigma: Positive = 1.5e-5
    orientation_sigma: Positive = 5e-5
    repeatability: tuple[Micro, Micro] = (1e-6, 4e-6)
    declared: bool = True
    by_range: Share = 0.0
    tails: Annotated[float, Field(gt=2.0, le=1000.0)] | None = None
    gross: Share = 0.0
    orientations: bool = True
    free: bool = False
    free_target: bool = False
    station: tuple[Finite, Finite, Finite] = (1.5, -7.0, 0.3)

    @property
    def sigma(self) -> Floats:
        """(6,) standard deviation of each component of the pose, m and rad; infinite for components that are not measured."""
        turns = self.orientation_sigma if self.orientations else np.inf
        return np.array([self.position_sigma] * 3 + [turns] * 3)

    @property
    def instrument(self) -> InstrumentSection:
        """The instrument as the dataset declares it."""
        frame: Literal["robot", "free"] = "free" if self.free else "robot"
        target: Literal["tcp", "free"] = "free" if self.free_target else "tcp"
        position = self.position_sigma if self.declared else None
        turns = self.orientation_sigma if self.declared and self.orientations else None
        return InstrumentSection(position_sigma=position, orientation_sigma=turns, frame=frame, target=target)

    def elsewhere(self, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """A random pose of the base frame in the instrument's: T (3,), m, and R (3, 3); z is vertical to some 0.6 degrees."""
        turn = exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])) @ exp(0.01 * rng.standard_normal(3))
        return np.asarray(rng.uniform(-5.0, 5.0, 3)), np.asarray(turn)

    def repeatability_of(self, machine: Machine, rng: np.random.Generator) -> Floats:
        """(n,) standard deviation of each cart along its track, m, or of each joint of an arm, rad or m."""
        return np.asarray(rng.uniform(*self.repeatability, machine.n_carts) * machine.per_metre)

    def target(self, rng: np.random.Generator) -> TreeFrame:
        """A random pose of an arm's target in the TCP frame."""
        return TreeFrame(-1, exp(rng.standard_normal(3)), np.asarray(rng.uniform(-0.06, 0.06, 3)))

    def growth(self, T: Floats) -> Floats:
        """(N,) factor on the position's sigma, by the distance of positions (N, 3), m, from the instrument."""
        distance = np.linalg.norm(T - np.array(self.station), axis=1)
        return np.asarray(np.maximum(1.0 + self.by_range * (distance / distance.mean() - 1.0), 0.1))

    def measured(self, true: VirtualPoses, rng: np.random.Generator) -> VirtualPoses:
        """Poses (N) as the instrument reads them."""
        sigma = np.array([self.position_sigma] * 3 + [self.orientation_sigma] * 3)
        errors = sigma * self.drawn(rng, (len(true), 6))
        errors[:, :3] *= self.growth(true.T)[:, None]
        errors += sigma * self.drawn_gross(rng, errors.shape)
        return VirtualPoses(true.T + errors[:, :3], exp(errors[:, 3:]) @ true.R)

    def drawn(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
        """Random draws with standard deviation 1."""
        if self.tails is None:
            return rng.standard_normal(shape)
        return np.asarray(rng.standard_t(self.tails, shape) * np.sqrt((self.tails - 2.0) / self.tails))

    def drawn_gross(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
        """Gross errors (M, c) of 10 to 100 sigma, in random directions; zero in the rows without one."""
        off = rng.random(shape[0]) < self.gross
        size = np.exp(rng.uniform(np.log(10.0), np.log(100.0), (shape[0], 1)))
        way = rng.standard_normal(shape)
        return np.where(off[:, None], size * way / np.linalg.norm(way, axis=1, keepdims=True), 0.0)


@dataclass(frozen=True)
class Wanted:
    """An effect that the machine gets, with its energy or, where that is None, its amplitude in typical sizes.

    ``periods``: for a periodic error of an arm, the number of periods a turn of each line; drawn where empty.
    """

    effect: str
    site: str
    noncentrality: float | None = None
    amplitude: float | None = None
    periods: tuple[float, ...] = ()


@dataclass(frozen=True)
class Recipe:
    """Everything that a case is made from. The same recipe gives the same bytes."""

    # See :func:`~gtpin.bench.simulator.case.make_case`
    wanted: tuple[Wanted, ...]
    seed: int
    robot: str
    poses: int
    held_out: int
    noise: SimulatedNoise
    conditions: SimulatedConditions
    background: bool = True


def digest() -> str:
    """SHA-256, in hexadecimal, of all sources of the simulator, by name: printed before a check, recorded with its score."""
    folder = Path(__file__).parent
    found = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        found.update(file.relative_to(folder).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return found.hexdigest()
