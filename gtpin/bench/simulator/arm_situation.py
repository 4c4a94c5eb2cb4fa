"""Posture, loads and motion of a machine without rods at every visit. Forces in its loops act where the loops close."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.situation import Postures
from gtpin.bench.simulator.tree import Bending, Placed
from gtpin.bench.simulator.visits import VirtualVisits
from gtpin.typing import Floats

SLIDING = 0.3
"""Error of a prismatic joint, m, over that of a revolute one, rad: both then move a TCP at 0.3 m from the axis equally."""


@dataclass(frozen=True, eq=False)
class ArmSituation(Postures):
    """N postures of an arm."""

    machine: ArmMachine
    # `bodies`, `bending`: Positions and rotations of its bodies; deviations of its joints' axes and of its bodies'
    # ends
    bodies: Placed
    bending: Bending
    tcp: VirtualPoses  # The TCP's poses, base frame

    @staticmethod
    def of(
        machine: ArmMachine, visits: VirtualVisits, deviation: Deviation | None = None, near: Placed | None = None
    ) -> ArmSituation:
        """The postures with a deviation; ``near``: nearby postures to start from, where they are known."""
        bodies, bending = machine.bodies(visits.q, deviation, near)
        tcp, target = bodies.at(machine.tcp, bending), machine.target
        seen = VirtualPoses(tcp.T + tcp.R @ target.p, tcp.R @ target.R)
        return ArmSituation(machine, visits, seen, bodies, bending, tcp)

    def settled_by(self, deviation: Deviation) -> ArmSituation:
        """The postures with another deviation."""
        return ArmSituation.of(self.machine, self.visits, deviation, self.bodies)

    def seen(self, read: tuple[str, ...]) -> VirtualPoses:
        """The target's poses, with the coordinates of the joints ``read``."""
        return self.poses.with_joints(self.machine.coordinates_of(self.bodies, read))

    def driven(self, cart: int, error: Floats) -> Deviation:
        """The error of a joint by an angle (N,), rad; of a prismatic joint by ``SLIDING`` times as many m."""
        return self.off(travel=(cart, error * (SLIDING if self.machine.robot.slides[cart] else 1.0)))

    @property
    def looped(self) -> bool:
        """Whether the machine has loops."""
        return bool(self.machine.loops.pairs)

    # --------------------------------------------------------------------------------------------------- loads

    @cached_property
    def _loads(self) -> tuple[Floats, Floats]:
        """(N, J, 3) sums of the forces on everything that each joint carries, N, and of their moments about the base's origin,
        N m; base frame. In loops with the forces that hold the passive joints."""
        force, moment = self._own()
        if self.looped:
            loops = self.machine.loops
            whole = self._carried(force.copy(), moment.copy())
            pushes = np.column_stack([self._along(j, *whole) for j in loops.passive])
            pulls, at = loops.pulls(self.bodies, self.bending, pushes)
            turning = np.cross(at, pulls)
            for i, (one, other) in enumerate(loops.pairs):
                for end, sign in ((one, 1.0), (other, -1.0)):
                    if end.joint >= 0:
                        force[:, end.joint] += sign * pulls[:, i]
                        moment[:, end.joint] += sign * turning[:, i]
        return self._carried(force, moment)

    def _own(self) -> tuple[Floats, Floats]:
        """(N, J, 3) forces and moments on each body itself: its weight, and on the last one payload and force on the tool."""
        machine, tool = self.machine, self.machine.robot.tcp.joint
        force, moment = np.zeros_like(self.bodies.p), np.zeros_like(self.bodies.p)
        for j in range(len(machine.joints)):
            force[:, j] = machine.masses[j] * machine.gravity
            moment[:, j] = np.cross(self._centre(j), force[:, j])
        if tool >= 0:
            force[:, tool] += self._on_tool
            moment[:, tool] += np.cross(self.tcp.T, self._on_tool)
        return force, moment

    @property
    def _on_tool(self) -> Floats:
        return np.asarray(self.visits.payload[:, None] * self.machine.gravity + self.visits.force)

    def _centre(self, joint: int) -> Floats:
        """(N, 3) centre of mass of a joint's body, base frame, m."""
        return np.asarray(self.bodies.p[:, joint] + self.bodies.R[:, joint] @ self.machine.centres[joint])

    def _carried(self, force: Floats, moment: Floats) -> tuple[Floats, Floats]:
        """Forces and moments on each body and on all bodies that it carries, from those on the bodies themselves."""
        for j in reversed(range(len(self.machine.joints))):
            parent = self.machine.joints[j].parent
            if parent >= 0:
                force[:, parent] += force[:, j]
                moment[:, parent] += moment[:, j]
        return force, moment

    def _along(self, joint: int, force: Floats, moment: Floats) -> Floats:
        """(N,) load of a joint along its coordinate, N m or N, from forces and moments about the base's origin."""
        one, push = self.machine.joints[joint], force[:, joint]
        if not one.slides:
            push = moment[:, joint] - np.cross(self.bodies.p[:, joint], push)
        return np.asarray(np.einsum("ni,ni->n", push, self.bodies.seats[:, joint] @ one.axis))

    def carried_by(self, joint: int) -> tuple[Floats, Floats]:
        """(N, 3) force, N, and moment about a joint's origin, N m, base frame, on everything that the joint carries."""
        force, moment = self._loads
        return force[:, joint], moment[:, joint] - np.cross(self.bodies.p[:, joint], force[:, joint])

    def borne(self, cart: int) -> tuple[Floats, Floats]:
        """As :meth:`carried_by`, of a commanded joint."""
        return self.carried_by(self.machine.robot.counted[cart])

    def load(self, cart: int) -> Floats:
        """(N,) load of a commanded joint along its coordinate: torque, N m, or force, N."""
        return self._along(self.machine.robot.counted[cart], *self._loads)

    def tip_load(self, cart: int) -> tuple[Floats, Floats]:
        """(N, 3) force, N, and moment, N m, at the end of the link of a commanded joint, link's frame.

        They come from everything that the link carries, and from the loops; its own weight is not included.
        """
        machine, j = self.machine, self.machine.robot.counted[cart]
        if self.looped:
            weight = machine.masses[j] * machine.gravity
            end = self.bodies.at(machine.robot.next_frame(j), self.bending).T
            force = self._loads[0][:, j] - weight
            moment = self._loads[1][:, j] - np.cross(self._centre(j), weight) - np.cross(end, force)
        elif beyond := machine.robot.onward(j)[1:]:
            force, moment = self.carried_by(beyond[0])
        else:
            force = self._on_tool
            moment = np.zeros_like(force)
        R = self.bodies.R[:, j]
        return np.einsum("nji,nj->ni", R, force), np.einsum("nji,nj->ni", R, moment)

    # ---------------------------------------------------------------------------------------------------- base

    @property
    def _standing(self) -> list[int]:
        return [j for j, joint in enumerate(self.machine.joints) if joint.parent < 0]

    @property
    def leaning(self) -> Floats:
        """(N, 3) moment on the base, base frame, over the usual load there, no unit: about the first joint and of that joint;
        with loops about the base's origin and of all joints on the base."""
        if not self.looped:
            return np.asarray(self.borne(0)[1] / self.machine.usual_load(0))
        usual = sum(self.machine.robot.usual_moment(j) for j in self._standing)
        return np.asarray(self._loads[1][:, self._standing].sum(axis=1) / usual)

    def tilted(self, angle: Floats, about: Floats) -> Deviation:
        """Deviation that rotates everything on the base by small angles (N,), rad, about a direction (3,), base frame: about
        the first joint's origin; with loops about the base's origin."""
        deviation, joints = self.unbent(), self.machine.joints
        if not self.looped:
            seat = self.bodies.seats[:, self.machine.robot.counted[0]]
            deviation.axis[:, 0, 3:] = angle[:, None] * np.einsum("nji,j->ni", seat, about)
            return deviation
        turn = np.multiply.outer(angle, about)
        for j in self._standing:
            deviation.seat[:, j] = np.hstack([np.cross(turn, joints[j].p), turn]) @ np.kron(np.eye(2), joints[j].R)
        return deviation
