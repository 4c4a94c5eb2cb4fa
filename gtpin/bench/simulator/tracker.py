"""True noise of the instrument, the noise that the dataset declares, and the repeatability of the machine."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.arms.urdf import Frame
from gtpin.bench.simulator.machine import Machine
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import exp
from gtpin.data import Instrument
from gtpin.typing import Floats

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Micro = Annotated[float, Field(ge=0.0, le=1e-3)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Noise(BaseModel):
    """Random errors of the instrument and the machine.

    Parameters
    ----------
    position_sigma, orientation_sigma
        Standard deviation per axis, m and rad.
    repeatability
        Range, m, from which the standard deviation of each cart along its track is drawn; the errors are drawn at every visit.
        Across the track the standard deviation is 0.3 of that along it, in both directions.
    declared
        Whether the dataset states the sigmas.
    by_range
        Relative increase of the position's sigma between the mean distance from the instrument and twice this distance; 0: the
        sigma is constant.
    tails
        Degrees of freedom of a Student distribution with the same sigma; None for a normal one.
    gross
        Share of the measurements with gross errors, of 10 to 100 sigma.
    orientations
        Whether orientations are measured.
    free
        Whether the instrument measures in its own frame, whose pose is unknown to the user.
    free_target
        Whether the target of an arm has an unknown pose in the TCP frame: a distance of some tens of mm, and any orientation.
    station
        Position of the instrument, base frame, m.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

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
    def instrument(self) -> Instrument:
        """The instrument as the dataset declares it."""
        frame: Literal["robot", "free"] = "free" if self.free else "robot"
        target: Literal["tcp", "free"] = "free" if self.free_target else "tcp"
        if not self.declared:
            return Instrument(frame=frame, target=target)
        turns = self.orientation_sigma if self.orientations else None
        return Instrument(position_sigma=self.position_sigma, orientation_sigma=turns, frame=frame, target=target)

    def elsewhere(self, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """A random pose of the base frame in the instrument's frame: T (3,), m, and R (3, 3), with z vertical to about 0.6
        degrees per axis."""
        turn = exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])) @ exp(0.01 * rng.standard_normal(3))
        return np.asarray(rng.uniform(-5.0, 5.0, 3)), np.asarray(turn)

    def repeatability_of(self, machine: Machine | ArmMachine, rng: np.random.Generator) -> Floats:
        """(n,) standard deviation of each cart along its track, m, or of each joint of an arm, rad or m."""
        return np.asarray(rng.uniform(*self.repeatability, machine.n_carts) * machine.per_metre)

    def target(self, rng: np.random.Generator) -> Frame:
        """A random pose of an arm's target in the TCP frame."""
        return Frame(-1, exp(rng.standard_normal(3)), np.asarray(rng.uniform(-0.06, 0.06, 3)))

    def measured(self, true: Poses, rng: np.random.Generator) -> Poses:
        """Poses (N) as the instrument reads them."""
        sigma = np.array([self.position_sigma] * 3 + [self.orientation_sigma] * 3)
        errors = sigma * self.drawn(rng, (len(true), 6))
        distance = np.linalg.norm(true.T - np.array(self.station), axis=1)
        errors[:, :3] *= np.maximum(1.0 + self.by_range * (distance / distance.mean() - 1.0), 0.1)[:, None]
        off = rng.random(len(true)) < self.gross
        size = np.exp(rng.uniform(np.log(10.0), np.log(100.0), (len(true), 1)))
        way = rng.standard_normal((len(true), 6))
        errors += sigma * np.where(off[:, None], size * way / np.linalg.norm(way, axis=1, keepdims=True), 0.0)
        return Poses(true.T + errors[:, :3], exp(errors[:, 3:]) @ true.R)

    def drawn(self, rng: np.random.Generator, shape: tuple[int, int]) -> Floats:
        """Random draws with standard deviation 1."""
        if self.tails is None:
            return rng.standard_normal(shape)
        return np.asarray(rng.standard_t(self.tails, shape) * np.sqrt((self.tails - 2.0) / self.tails))
