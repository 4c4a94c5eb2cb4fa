"""A machine with loops as it was really built: the joints that follow close its loops whatever is off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.errors import UnreachableError
from gtpin.plant.arms.deviation import ArmDeviation
from gtpin.plant.arms.machine import ArmMachine
from gtpin.plant.arms.tree import STRAIGHT, Bending, Placed, placed
from gtpin.plant.looped.deviation import LoopedDeviation
from gtpin.plant.looped.robot import LoopedArm
from gtpin.plant.loops import Loops

Floats = npt.NDArray[np.float64]

SHARE = 0.95
"""Of each range, about its middle: what keeps a machine with loops from its ends is where they lead it badly."""


@dataclass(frozen=True, eq=False)
class LoopedMachine(ArmMachine):
    """A machine with n commanded joints, and others that follow; see :class:`~gtpin.plant.arms.machine.ArmMachine`."""

    robot: LoopedArm

    @staticmethod
    def nominal(robot: LoopedArm) -> LoopedMachine:  # type: ignore[override]
        """The machine that the URDF describes."""
        return LoopedMachine(**vars(ArmMachine.nominal(robot)))

    @staticmethod
    def draw(robot: LoopedArm, rng: np.random.Generator) -> LoopedMachine:  # type: ignore[override]
        """A machine off nominal by normal draws from the tolerances, and by some per cent in its masses."""
        return LoopedMachine.nominal(robot).drawn(rng)

    @cached_property
    def loops(self) -> Loops:
        """Its loops, with the joints where they really are."""
        return replace(self.robot.loops, joints=self.joints)

    def bodies(
        self, q: Floats, deviation: ArmDeviation | None = None, near: Placed | None = None
    ) -> tuple[Placed, Bending]:
        """See :class:`~gtpin.plant.arms.machine.ArmMachine`; NaN where the loops don't close.

        Raises
        ------
        UnreachableError
            If they do without the deviation.
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
        """(J, 3) where the bodies end: what else sits on one moves with its end."""
        return np.array([self.robot.next_frame(j).p for j in range(len(self.joints))])

    def unbent(self, visits: int) -> LoopedDeviation:
        """A deviation of zero at a number of visits."""
        return LoopedDeviation.at_rest(visits, self.n_carts, len(self.joints))

    @cached_property
    def region(self) -> tuple[Floats, Floats]:
        """(n,) middles and half widths of the commands that it is sent to; about home where a range has no end."""
        lower, upper = self.robot.lower, self.robot.upper
        ended = np.isfinite(upper - lower)
        lower, upper = np.where(ended, lower, -np.pi), np.where(ended, upper, np.pi)
        around = np.where(ended, (lower + upper) / 2.0, self.robot.loops.home_q)
        wide = np.where(ended, (upper - lower) / 2.0, np.where(self.robot.slides, 0.5, np.pi))
        return around, SHARE * wide
