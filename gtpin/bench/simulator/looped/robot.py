"""A nominal robot whose loops are not rods, from its URDF: its passive joints, and the ends of its links."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.bench.simulator.arms.robot import Arm, tolerance_of
from gtpin.bench.simulator.arms.urdf import Frame
from gtpin.bench.simulator.loops import Loops
from gtpin.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class LoopedArm(Arm):
    """The nominal robot: an arm with passive joints, which close its loops.

    Parameters
    ----------
    loops
        The tree, its driven and passive joints, and the points that coincide.
    """

    loops: Loops

    @staticmethod
    def of(robot: Robot) -> LoopedArm:
        """The robot. Names and the choice of joints are from ``robot``, numbers from the URDF's text.

        Raises
        ------
        RobotError
            If a joint mimics another one.
        """
        loops = Loops.of(robot, {})
        gravity = np.array(robot.description.gravity)
        return LoopedArm(robot.name, loops.joints, loops.driven, loops.tcp, gravity, tolerance_of(robot), loops)

    @cached_property
    def closing(self) -> tuple[int, ...]:
        """Indices of the joints that move the TCP: those between base and TCP, and those of the loops."""
        return tuple(sorted({*self.way, *self.loops.closing}))

    @property
    def placed(self) -> tuple[int, ...]:
        """See :class:`~gtpin.bench.simulator.arms.robot.Arm`; passive joints are included."""
        return self.closing

    @cached_property
    def acting(self) -> tuple[int, ...]:
        """See :class:`~gtpin.bench.simulator.arms.robot.Arm`."""
        return tuple(c for c, j in enumerate(self.counted) if j in self.closing)

    @cached_property
    def linked(self) -> tuple[int, ...]:
        """As in :class:`Arm`; without links that carry no joint, on which a loop closes directly."""
        return tuple(c for c in self.acting if self.counted[c] == self.tcp.joint or self._beyond(self.counted[c]))

    @cached_property
    def pins(self) -> tuple[int, ...]:
        """Indices of the passive revolute joints."""
        return tuple(j for j in self.loops.passive if not self.joints[j].slides)

    @property
    def pin_sites(self) -> tuple[str, ...]:
        """Names of the passive revolute joints."""
        return tuple(self.joints[j].name for j in self.pins)

    def _beyond(self, joint: int) -> tuple[int, ...]:
        return tuple(j for j, other in enumerate(self.joints) if other.parent == joint)

    def onward(self, joint: int) -> tuple[int, ...]:
        """As in :class:`Arm`; for a joint that is not on the way, those up to the end of its loop."""
        if joint in self.way:
            return super().onward(joint)
        found = [joint]
        while beyond := self._beyond(found[-1]):
            found.append(beyond[0])
        return tuple(found)

    def next_frame(self, joint: int) -> Frame:
        """As in :class:`Arm`; the last body of a loop ends at the point at which the loop closes."""
        line = self.onward(joint)
        if len(line) > 1 or joint == self.tcp.joint:
            return super().next_frame(joint)
        ends = [end for pair in self.loops.pairs for end in pair if end.joint == joint]
        return ends[0] if ends else Frame(joint, np.eye(3), np.zeros(3))
