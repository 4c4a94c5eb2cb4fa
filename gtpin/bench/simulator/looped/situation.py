"""Posture, loads and motion of a machine with loops at every visit. Forces act through the points at which loops close."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.bench.simulator.arms.situation import ArmSituation
from gtpin.bench.simulator.looped.deviation import LoopedDeviation
from gtpin.bench.simulator.looped.machine import LoopedMachine
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class LoopedSituation(ArmSituation):
    """N closed postures, in the order of time; see :class:`~gtpin.bench.simulator.arms.situation.ArmSituation`."""

    machine: LoopedMachine

    @cached_property
    def _loads(self) -> tuple[Floats, Floats]:
        """As in :class:`ArmSituation`; with the forces in the loops that hold the passive joints."""
        force, moment = self._own()
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

    def _along(self, joint: int, force: Floats, moment: Floats) -> Floats:
        """(N,) load of a joint along its coordinate, N m or N, from forces and moments about the base's origin."""
        one = self.machine.joints[joint]
        push = force[:, joint]
        if not one.slides:
            push = moment[:, joint] - np.cross(self.bodies.p[:, joint], push)
        return np.asarray(np.einsum("ni,ni->n", push, self.bodies.seats[:, joint] @ one.axis))

    def carried_by(self, joint: int) -> tuple[Floats, Floats]:
        """(N, 3) force, N, and moment about a joint's origin, N m, base frame, on everything that the joint carries."""
        force, moment = self._loads
        return force[:, joint], moment[:, joint] - np.cross(self.bodies.p[:, joint], force[:, joint])

    @property
    def leaning(self) -> Floats:
        """(N, 3) moment on the base about its origin, base frame, over the usual load of the joints on the base; no unit."""
        usual = sum(self.machine.robot.usual_moment(j) for j in self._standing)
        return np.asarray(self._loads[1][:, self._standing].sum(axis=1) / usual)

    @property
    def _standing(self) -> list[int]:
        return [j for j, joint in enumerate(self.machine.joints) if joint.parent < 0]

    def unbent(self) -> LoopedDeviation:
        """Deviations of zero, to be filled in."""
        return self.machine.unbent(len(self))

    def tilted(self, turn: Floats) -> LoopedDeviation:
        """Deviation that rotates everything on the base about the base's origin, by small rotation vectors (N, 3), base frame,
        rad."""
        deviation, joints = self.unbent(), self.machine.joints
        for j in self._standing:
            deviation.seat[:, j] = np.hstack([np.cross(turn, joints[j].p), turn]) @ np.kron(np.eye(2), joints[j].R)
        return deviation

    def tip_load(self, cart: int) -> tuple[Floats, Floats]:
        """See :class:`~gtpin.bench.simulator.arms.situation.ArmSituation`; the forces of the loops are included."""
        machine, j = self.machine, self.machine.robot.counted[cart]
        force, moment = self._loads[0][:, j], self._loads[1][:, j]
        weight = machine.masses[j] * machine.robot.gravity
        centre = self.bodies.p[:, j] + self.bodies.R[:, j] @ machine.centres[j]
        end = self.bodies.at(machine.robot.next_frame(j), self.bending).T
        force, moment = force - weight, moment - np.cross(centre, weight)
        moment = moment - np.cross(end, force)
        R = self.bodies.R[:, j]
        return np.einsum("nji,nj->ni", R, force), np.einsum("nji,nj->ni", R, moment)
