"""A machine with loops as it was really built: its passive joints close the loops in spite of all deviations."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.bench.simulator.arms.machine import NUDGE, ArmMachine
from gtpin.bench.simulator.arms.tree import STRAIGHT, Bending, Placed, placed
from gtpin.bench.simulator.looped.deviation import LoopedDeviation
from gtpin.bench.simulator.looped.robot import LoopedArm
from gtpin.bench.simulator.loops import Loops
from gtpin.bench.simulator.poses import Poses
from gtpin.errors import UnreachableError
from gtpin.typing import Floats

SHARE = 0.95
"""Used share of each range, about its middle. Bad conditioning limits a machine with loops more than the ends of its ranges."""


@dataclass(frozen=True, eq=False)
class LoopedMachine(ArmMachine):
    """A machine with n commanded joints and passive ones; see :class:`~gtpin.bench.simulator.arms.machine.ArmMachine`.

    Parameters
    ----------
    ends
        (2 L, 3) displacement from nominal of the points at which L loops close, m, in the frames of their links.
    """

    robot: LoopedArm
    ends: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    @staticmethod
    def nominal(robot: LoopedArm) -> LoopedMachine:  # type: ignore[override]
        """The machine that the URDF describes."""
        return LoopedMachine(**vars(ArmMachine.nominal(robot)), ends=np.zeros((len(robot.loops.ends), 3)))

    @staticmethod
    def draw(robot: LoopedArm, rng: np.random.Generator) -> LoopedMachine:  # type: ignore[override]
        """A machine whose parameters deviate from nominal by normal draws from the tolerances, its masses by some per cent."""
        return LoopedMachine.nominal(robot).drawn(rng)

    def drawn(self, rng: np.random.Generator) -> Self:
        """See :class:`~gtpin.bench.simulator.arms.machine.ArmMachine`; the points at which its loops close deviate as well."""
        machine = super().drawn(rng)
        return replace(machine, ends=self.robot.tolerance[:3] * rng.standard_normal(self.ends.shape))

    @cached_property
    def loops(self) -> Loops:
        """Its loops, with the true placements of the joints and of the points at which the loops close."""
        return replace(self.robot.loops.with_ends_moved(self.ends), joints=self.joints)

    def by_tolerance(self, q: Floats, poses: Poses) -> Floats:
        """See :class:`~gtpin.bench.simulator.arms.machine.ArmMachine`; also by the points at which the loops close."""
        columns, near, read = [], self.bodies(q)[0], tuple(poses.joints)
        for end, axis in np.ndindex(self.ends.shape):
            step = np.zeros(self.ends.shape)
            step[end, axis] = NUDGE
            one, other = (replace(self, ends=self.ends + s * step).forward(q, near, read) for s in (1.0, -1.0))
            columns.append(one.change(other) / (2.0 * NUDGE) * self.robot.tolerance[axis])
        return np.concatenate([super().by_tolerance(q, poses), np.stack(columns, axis=2)], axis=2)

    def bodies(
        self, q: Floats, deviation: ArmDeviation | None = None, near: Placed | None = None
    ) -> tuple[Placed, Bending]:
        """See :class:`~gtpin.bench.simulator.arms.machine.ArmMachine`; NaN where the loops don't close.

        Raises
        ------
        UnreachableError
            If the loops close without the deviation but not with it.
        """
        x = self.loops.led(q) if near is None else near.x
        if deviation is None:
            return placed(self.joints, x if near is None else self.loops.closed(x, q)), STRAIGHT
        axis = self._on_all(deviation.axis)
        if isinstance(deviation, LoopedDeviation) and deviation.seat.any():
            axis = deviation.seat if axis is None else axis + deviation.seat
        bending = Bending(axis, self._on_all(deviation.tip), self._ends)
        closed = self.loops.closed(x, q + deviation.travel, bending)
        if np.isnan(closed[~np.isnan(x).any(axis=1)]).any():
            raise UnreachableError("the deviations open the loops", hint="make the effects smaller")
        return placed(self.joints, closed, bending), bending

    @cached_property
    def _ends(self) -> Floats:
        """(J, 3) ends of the bodies, own frames, m: everything that is fixed to a body moves with its end."""
        return np.array([self.robot.next_frame(j).p for j in range(len(self.joints))])

    def unbent(self, visits: int) -> LoopedDeviation:
        """Deviations of zero at a number of visits."""
        return LoopedDeviation.at_rest(visits, self.n_carts, len(self.joints))

    @cached_property
    def region(self) -> tuple[Floats, Floats]:
        """(n,) middles and half widths of the ranges from which commands are drawn, rad or m; about home for an infinite
        range."""
        lower, upper = self.robot.lower, self.robot.upper
        ended = np.isfinite(upper - lower)
        lower, upper = np.where(ended, lower, -np.pi), np.where(ended, upper, np.pi)
        around = np.where(ended, (lower + upper) / 2.0, self.robot.loops.home_q)
        wide = np.where(ended, (upper - lower) / 2.0, np.where(self.robot.slides, 0.5, np.pi))
        return around, SHARE * wide
