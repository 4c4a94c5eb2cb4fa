"""Posture, loads and motion of an arm at every visit. Effects depend on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.arms.tree import Bending, Placed
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.visits import Visits
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class ArmSituation:
    """N postures, in the order of time.

    Parameters
    ----------
    machine, visits
        The machine, and its commands and conditions.
    bodies
        Positions and rotations of its bodies.
    bending
        Deviations of its joints' axes and of its bodies' ends.
    tcp, poses
        The TCP's poses, and those of the target, base frame.
    """

    machine: ArmMachine
    visits: Visits
    bodies: Placed
    bending: Bending
    tcp: Poses
    poses: Poses

    @classmethod
    def of(
        cls, machine: ArmMachine, visits: Visits, deviation: ArmDeviation | None = None, near: Placed | None = None
    ) -> Self:
        """The postures with a deviation; ``near``: nearby postures to start from, where they are known."""
        bodies, bending = machine.bodies(visits.q, deviation, near)
        tcp = bodies.at(machine.tcp, bending)
        target = machine.target
        seen = Poses(tcp.T + tcp.R @ target.p, tcp.R @ target.R)
        return cls(machine, visits, bodies, bending, tcp, seen)

    def settled_by(self, deviation: ArmDeviation) -> Self:
        """The postures with another deviation."""
        return self.of(self.machine, self.visits, deviation, self.bodies)

    def __len__(self) -> int:
        return len(self.visits)

    @property
    def q(self) -> Floats:
        """(N, n) commands, rad or m."""
        return self.visits.q

    @cached_property
    def places(self) -> Floats:
        """(N, n) places of the commands: see :meth:`~gtpin.bench.simulator.arms.machine.ArmMachine.places`."""
        return self.machine.places(self.q)

    def seen(self, read: Sequence[str]) -> Poses:
        """The target's poses, with the coordinates of the joints ``read``."""
        return self.poses.with_joints(self.machine.coordinates_of(self.bodies, read))

    def unbent(self) -> ArmDeviation:
        """Deviations of zero, to be filled in."""
        return self.machine.unbent(len(self))

    @cached_property
    def _loads(self) -> tuple[Floats, Floats]:
        """(N, J, 3) sums of the forces on everything that each joint carries, N, and of their moments about the base's origin,
        N m; base frame."""
        return self._carried(*self._own())

    def _own(self) -> tuple[Floats, Floats]:
        """(N, J, 3) forces and moments on each body itself: its weight, and on the last one payload and force on the tool."""
        machine, robot, visits = self.machine, self.machine.robot, self.visits
        force, moment = np.zeros_like(self.bodies.p), np.zeros_like(self.bodies.p)
        for j in range(len(machine.joints)):
            centre = self.bodies.p[:, j] + self.bodies.R[:, j] @ machine.centres[j]
            force[:, j] = machine.masses[j] * robot.gravity
            moment[:, j] = np.cross(centre, force[:, j])
        on_tool = visits.payload[:, None] * robot.gravity + visits.force
        if robot.tcp.joint >= 0:
            force[:, robot.tcp.joint] += on_tool
            moment[:, robot.tcp.joint] += np.cross(self.tcp.T, on_tool)
        return force, moment

    def _carried(self, force: Floats, moment: Floats) -> tuple[Floats, Floats]:
        """Forces and moments on each body and on all bodies that it carries, from those on the bodies themselves."""
        for j in reversed(range(len(self.machine.joints))):
            parent = self.machine.joints[j].parent
            if parent >= 0:
                force[:, parent] += force[:, j]
                moment[:, parent] += moment[:, j]
        return force, moment

    def borne(self, cart: int) -> tuple[Floats, Floats]:
        """(N, 3) force, N, and moment about the joint's origin, N m, base frame, on all bodies that a commanded joint
        carries."""
        j = self.machine.robot.counted[cart]
        force, moment = self._loads
        return force[:, j], moment[:, j] - np.cross(self.bodies.p[:, j], force[:, j])

    @property
    def leaning(self) -> Floats:
        """(N, 3) moment on the base about the first joint, base frame, over that joint's usual load; no unit."""
        return np.asarray(self.borne(0)[1] / self.machine.usual_load(0))

    def axis(self, cart: int) -> Floats:
        """(N, 3) unit vector of a commanded joint's axis, base frame."""
        j = self.machine.robot.counted[cart]
        return np.asarray(self.bodies.seats[:, j] @ self.machine.joints[j].axis)

    def load(self, cart: int) -> Floats:
        """(N,) load of a commanded joint along its coordinate: torque, N m, or force, N."""
        force, moment = self.borne(cart)
        along = force if self.machine.robot.slides[cart] else moment
        return np.asarray(np.einsum("ni,ni->n", along, self.axis(cart)))

    def tip_load(self, cart: int) -> tuple[Floats, Floats]:
        """(N, 3) force, N, and moment, N m, at the end of the link of a commanded joint on the way, link's frame.

        They come from everything that the link carries; its own weight is not included.
        """
        robot, j = self.machine.robot, self.machine.robot.counted[cart]
        place = robot.way.index(j)
        if place + 1 < len(robot.way):
            k = robot.way[place + 1]
            force, moment = self._loads[0][:, k], self._loads[1][:, k]
            moment = moment - np.cross(self.bodies.p[:, k], force)
        else:
            force = self.visits.payload[:, None] * robot.gravity + self.visits.force
            moment = np.zeros_like(force)
        R = self.bodies.R[:, j]
        return np.einsum("nji,nj->ni", R, force), np.einsum("nji,nj->ni", R, moment)

    @cached_property
    def motion(self) -> Floats:
        """(N, 3) unit vectors of the target's last move, base frame."""
        step = np.einsum("nij,nj->ni", self.machine.command_jacobian(self.q)[:, :3], self.q - self.visits.before)
        return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12))
