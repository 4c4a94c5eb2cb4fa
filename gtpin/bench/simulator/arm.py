"""A nominal robot without rods, from its URDF: commanded and passive joints, the TCP, the payload that it may carry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.bench.simulator.loops import Loops
from gtpin.bench.simulator.tree import TreeFrame, TreeJoint
from gtpin.robot.chain import Chain
from gtpin.typing import Floats, Mask

TOLERANCE = 5e-4
"""Standard deviation of every placement, per axis, m and rad, where the URDF gives none."""
CARRIES = 0.2
"""Payload over moving mass, by data sheets: a UR5 has 5 kg and 18 kg, a Panda 3 kg and 16 kg, a UR10 10 kg and 27 kg."""
SHORTEST = 0.05
"""Smallest length of a link, m: the housings of a wrist are longer than the offsets between its axes."""


@dataclass(frozen=True, eq=False)
class Arm:
    """The nominal robot: an open chain, or one with passive joints, which close its loops."""

    name: str
    # All its moving joints, parents first, the TCP frame, and the points that coincide; none on an open chain
    loops: Loops
    gravity: Floats  # (3,) acceleration of gravity, base frame, m/s^2
    tolerance: Floats  # (6,) standard deviation of the placement of each joint and of the tool, m and rad

    @staticmethod
    def of(robot: Chain) -> Arm:
        """The arm of a robot without rods. Names and the choice of joints are from ``robot``, numbers from the URDF's text.

        Raises RobotError if a joint mimics another one in a robot with loops.
        """
        position, rotation = (robot.tolerance.get(f"placement_{of}", TOLERANCE) for of in ("position", "rotation"))
        gravity = np.array(robot.description.gravity)
        return Arm(robot.name, Loops.of(robot), gravity, np.array([position] * 3 + [rotation] * 3))

    @property
    def joints(self) -> tuple[TreeJoint, ...]:
        return self.loops.joints

    @property
    def counted(self) -> tuple[int, ...]:
        """Indices of the commanded joints, in the order of q."""
        return self.loops.driven

    @property
    def tcp(self) -> TreeFrame:
        return self.loops.tcp

    @property
    def n_actuators(self) -> int:
        return len(self.counted)

    @cached_property
    def sites(self) -> tuple[str, ...]:
        return tuple(self.joints[j].name for j in self.counted)

    @cached_property
    def link_sites(self) -> tuple[str, ...]:
        """Names of the links that the commanded joints move."""
        return tuple(self.joints[j].link for j in self.counted)

    @cached_property
    def pins(self) -> tuple[int, ...]:
        """Indices of the passive revolute joints of loops."""
        return tuple(j for j in self.loops.passive if not self.joints[j].slides)

    @property
    def pin_sites(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self.joints[j].name for j in self.pins)

    @cached_property
    def lower(self) -> Floats:
        """(n,) lower ends of the ranges, rad or m."""
        return np.array([self.joints[j].lower for j in self.counted])

    @cached_property
    def upper(self) -> Floats:
        """(n,) their upper ends."""
        return np.array([self.joints[j].upper for j in self.counted])

    @cached_property
    def slides(self) -> Mask:
        """(n,) whether a commanded joint is prismatic."""
        return np.array([self.joints[j].slides for j in self.counted])

    @cached_property
    def way(self) -> tuple[int, ...]:
        """Indices of all joints from the base to the TCP, called the way below."""
        found, joint = [], self.tcp.joint
        while joint >= 0:
            found.append(joint)
            joint = self.joints[joint].parent
        return tuple(reversed(found))

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Indices of the joints that move the TCP: those on the way, and those of the loops."""
        return tuple(sorted({*self.way, *self.loops.closing}))

    @property
    def placed(self) -> tuple[int, ...]:
        """Indices of the joints whose placements a calibration identifies."""
        return self.moving if self.loops.pairs else self.counted

    @property
    def placements(self) -> tuple[str, ...]:
        """Names of these placements, and of the tool's."""
        return (*(f"placement[{self.joints[j].name}]" for j in self.placed), "platform")

    @cached_property
    def acting(self) -> tuple[int, ...]:
        """Indices of the commands that move the TCP."""
        return tuple(c for c, j in enumerate(self.counted) if j in self.moving)

    @cached_property
    def linked(self) -> tuple[int, ...]:
        """Indices of the commands whose link reaches to a next joint or the TCP, not only to where a loop closes."""
        return tuple(c for c in self.acting if self.counted[c] == self.tcp.joint or self._beyond(self.counted[c]))

    def _beyond(self, joint: int) -> tuple[int, ...]:
        return tuple(j for j, other in enumerate(self.joints) if other.parent == joint)

    def onward(self, joint: int) -> tuple[int, ...]:
        """Indices of a joint and of those beyond it: on the way, or up to the end of its loop."""
        if joint in self.way:
            return self.way[self.way.index(joint) :]
        found = [joint]
        while beyond := self._beyond(found[-1]):
            found.append(beyond[0])
        return tuple(found)

    def next_frame(self, joint: int) -> TreeFrame:
        """End of a joint's body, as a frame on that body: at the next joint, at the TCP, or where the loop closes."""
        line = self.onward(joint)
        if len(line) > 1:
            following = self.joints[line[1]]
            return TreeFrame(joint, following.R, following.p)
        if joint == self.tcp.joint:
            return self.tcp
        ends = [end for pair in self.loops.pairs for end in pair if end.joint == joint]
        return ends[0] if ends else TreeFrame(joint, np.eye(3), np.zeros(3))

    def length(self, joint: int) -> float:
        """Length of the body of a joint, m."""
        return max(float(np.linalg.norm(self.next_frame(joint).p)), SHORTEST)

    @cached_property
    def capacity(self) -> float:
        """Payload that it may carry, kg, from its moving mass, in steps of 0.5 kg."""
        mass = sum(joint.mass for joint in self.joints)
        return max(0.5, round(2.0 * CARRIES * mass) / 2.0)

    def usual_moment(self, joint: int) -> float:
        """Usual load of a joint, N m (N if prismatic): 0.4 of that with the arm stretched out and full payload."""
        g, moment, way = float(np.linalg.norm(self.gravity)) or 9.81, 0.0, 0.0
        if self.joints[joint].slides:
            behind = sum(self.joints[j].mass for j in self.onward(joint))
            return 0.4 * g * (behind + self.capacity)
        for j in self.onward(joint):
            moment += self.joints[j].mass * (way + 0.5 * self.length(j))
            way += self.length(j)
        return 0.4 * g * (moment + self.capacity * way)
