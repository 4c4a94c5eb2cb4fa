"""Posture, forces and motion of a machine at every visit. Effects depend on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.rods import VirtualRodEnds, by_pose, each_solved
from gtpin.bench.simulator.visits import VirtualVisits
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class Postures:
    """N postures of a machine of any kind, in the order of time."""

    # `machine`, `visits`: The machine, and its commands and conditions
    machine: Any
    visits: VirtualVisits
    poses: VirtualPoses  # Poses of the platform or of the target, base frame

    def __len__(self) -> int:
        return len(self.visits)

    @property
    def q(self) -> Floats:
        """(N, n) commands, m or rad."""
        return self.visits.q

    @cached_property
    def places(self) -> Floats:
        """(N, n) places of the commands: see :meth:`~gtpin.bench.simulator.machine.Machine.places`."""
        return np.asarray(self.machine.places(self.q))

    def unbent(self) -> Deviation:
        """Deviations of zero, to be filled in."""
        deviation: Deviation = self.machine.unbent(len(self))
        return deviation

    def off(self, **changes: tuple[Any, Floats]) -> Deviation:
        """The deviation with some fields filled in: for each, (N, ...) values, and their index after the visit's."""
        deviation = self.unbent()
        for name, (at, values) in changes.items():
            getattr(deviation, name)[:, at] = values
        return deviation

    def driven(self, cart: int, error: Floats) -> Deviation:
        """The error (N,) of a drive: of a cart along its track, m, of an arm or a joint about its axis, rad, of a leg, m."""
        return self.off(travel=(cart, error))

    @cached_property
    def motion(self) -> Floats:
        """(N, 3) unit vectors of the last move of the platform or the target, base frame."""
        by_command = self.machine.command_jacobian(self.q, self.poses)[:, :3]
        step = np.einsum("nij,nj->ni", by_command, self.q - self.visits.before)
        return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12))


@dataclass(frozen=True, eq=False)
class RodSituation(Postures):
    """N closed postures of a machine on rods; ``ends``: the rods' ends there."""

    machine: RodMachine
    ends: VirtualRodEnds

    @staticmethod
    def of(machine: RodMachine, visits: VirtualVisits) -> RodSituation:
        """The machine with errors of its geometry alone."""
        ends = machine.ends(visits.q, machine.unbent(len(visits)))
        return RodSituation(machine, visits, machine.predict(visits.q), ends)

    def settled_by(self, deviation: Deviation) -> RodSituation:
        """The postures with a deviation, solved from the present ones."""
        ends = self.machine.ends(self.visits.q, deviation)
        return RodSituation(self.machine, self.visits, self.machine.close(self.poses, ends), ends)

    def seen(self, read: tuple[str, ...]) -> VirtualPoses:
        """The platform's poses, with the angle of the first rod's universal joint where ``read`` names it."""
        return self.poses.with_joints({name: self.machine.universal.coordinate(self.poses, self.ends) for name in read})

    @cached_property
    def _rods(self) -> tuple[Floats, Floats]:
        """See :meth:`~gtpin.bench.simulator.rods.VirtualRodEnds.rods`."""
        return self.ends.rods(self.poses)

    @cached_property
    def along(self) -> Floats:
        """(N, k, 3) unit vectors along the rods, from cart to platform, base frame."""
        d = self._rods[0]
        return np.asarray(d / np.linalg.norm(d, axis=2, keepdims=True))

    def held(self, wrench: Floats) -> Floats:
        """(N, k) rod forces, tension positive, N, that balance a wrench (N, 6) on the platform: force, N, and moment about the
        TCP, N m, base frame."""
        return each_solved(np.swapaxes(by_pose(*self._rods), 1, 2), wrench)

    @cached_property
    def forces(self) -> Floats:
        """(N, k) rod forces, tension positive, N, by all weights, the payload and the force on the tool."""
        machine, visits = self.machine, self.visits
        gravity = np.array(machine.robot.model.gravity.linear)
        wrench = np.zeros((len(self), 6))
        wrench[:, :3] = (machine.plate_mass + visits.payload[:, None]) * gravity + visits.force
        wrench[:, 3:] = np.cross(self.poses.R @ machine.plate_center, machine.plate_mass * gravity)
        # The platform carries half of a rod's weight, and less of an extended leg's. A rod's force is that at its middle.
        for i, mass in enumerate(machine.rod_masses):
            hanging: Floats | float = 0.5
            if machine.robot.rods[i].extension is not None:
                (centre, sliding), length = machine.leg_masses[i], self.ends.L[:, i]
                hanging = 1.0 - (centre + sliding * (length - machine.kinematics.L0[i])) / length
            weight = np.multiply.outer(mass * hanging, gravity)
            wrench[:, :3] += weight
            wrench[:, 3:] += np.cross(self._rods[1][:, i], weight)
        return self.held(wrench)

    def pull(self, cart: int, forces: Floats | None = None) -> Floats:
        """(N, 3) force of the rods on a cart, base frame, N; ``forces`` (N, k): rod forces to use instead of :attr:`forces`."""
        mine = self.machine.driver == cart
        forces = self.forces if forces is None else forces
        return np.asarray(np.einsum("nk,nki->ni", forces[:, mine], self.along[:, mine]))

    def pressing(self, cart: int, forces: Floats | None = None) -> Floats:
        """(N,) force of the rods on a drive, N: along its track, along the arc of its arm, or along its leg."""
        machine = self.machine
        if machine.slides[cart]:
            return np.asarray(self.pull(cart, forces) @ machine.tracks[cart])
        mine = machine.driver == cart
        forces = self.forces if forces is None else forces
        if machine.is_leg[cart]:
            return np.asarray(forces[:, mine].sum(axis=1))
        lever = np.cross(machine.tracks[cart], self.ends.C[:, mine] - machine.robot.actuators[cart].origin)
        torque = np.einsum("nk,nki,nki->n", forces[:, mine], self.along[:, mine], lever)
        return np.asarray(torque / np.linalg.norm(lever, axis=2).mean(axis=1))

    def moment(self, cart: int) -> Floats:
        """(N, 3) moment of the rods on a cart about the mean of its joints, base frame, N m."""
        mine = self.machine.driver == cart
        pulls = self.forces[:, mine, None] * self.along[:, mine]
        return np.asarray(np.cross(self.machine.levers[mine], pulls).sum(axis=1))
