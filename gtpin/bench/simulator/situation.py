"""Posture, forces and motion of a machine at every visit. Effects depend on them.

Forces in the loops of a machine without rods act where the loops close.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.rods import VirtualRodEnds, by_pose, each_solved
from gtpin.bench.simulator.tree import Bending, Placed
from gtpin.bench.simulator.visits import VirtualVisits
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

STEEL, ALUMINIUM = 11.5e-6, 23e-6
"""Coefficients of linear expansion, 1/K."""
SLIDING = 0.3
"""Error of a prismatic joint, m, over that of a revolute one, rad: both then move a TCP at 0.3 m from the axis equally."""


@dataclass(frozen=True)
class Site:
    """A site: its name, the index of its cart or commanded joint (-1: none), the indices of its rods or links, and the index of
    its passive joint (-1: none).
    """

    name: str
    cart: int
    rods: tuple[int, ...]
    pin: int = -1

    @staticmethod
    def of(robot: Chain | Arm, name: str) -> Site:
        """The site with a name. The index of an arm's link is that of the commanded joint that moves it."""
        if isinstance(robot, Arm):
            if name in robot.sites:
                return Site(name, robot.sites.index(name), ())
            if name in robot.link_sites:
                return Site(name, -1, (robot.link_sites.index(name),))
            if name in robot.pin_sites:
                return Site(name, -1, (), robot.pins[robot.pin_sites.index(name)])
            return Site(name, -1, tuple(range(robot.n_actuators)))
        if name in robot.sites:
            cart = robot.sites.index(name)
            return Site(name, cart, tuple(i for i, r in enumerate(robot.rods) if cart in (r.carrier, r.extension)))
        if name in robot.rod_sites:
            return Site(name, -1, (robot.rod_sites.index(name),))
        return Site(name, -1, tuple(range(len(robot.rods))))


@dataclass(frozen=True, eq=False)
class Postures(ABC):
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
        """(N, n) places of the commands: see :meth:`~gtpin.bench.simulator.rod_machine.RodMachine.places`."""
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

    @abstractmethod
    def grow(self, deviation: Deviation, link: int, growth: Floats) -> None:
        """Add the expansion of a link that is warmer by ``growth`` (N,), K."""

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

    def grow(self, deviation: Deviation, link: int, growth: Floats) -> None:
        deviation.length[:, link] = STEEL * self.machine.L0[link] * growth

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
        """(N, k) rod forces, tension positive, N, that balance a wrench (N, 6) at the TCP: N and N m, base frame."""
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
                hanging = 1.0 - (centre + sliding * (length - machine.L0[i])) / length
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
        tcp, target = bodies.at(machine.true.tcp, bending), machine.target
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

    def grow(self, deviation: Deviation, link: int, growth: Floats) -> None:
        robot = self.machine.robot
        if link in robot.linked:
            reach = robot.next_frame(robot.counted[link]).p
            deviation.tip[:, link, :3] = ALUMINIUM * np.multiply.outer(growth, reach)

    @property
    def looped(self) -> bool:
        """Whether the machine has loops."""
        return bool(self.machine.robot.pairs)

    # --------------------------------------------------------------------------------------------------- loads

    @cached_property
    def _loads(self) -> tuple[Floats, Floats]:
        """(N, J, 3) sums of the forces on everything that each joint carries, N, and of their moments about the base's origin,
        N m; base frame. In loops with the forces that hold the passive joints."""
        machine, tool = self.machine, self.machine.robot.tcp.joint
        force, moment = np.zeros_like(self.bodies.p), np.zeros_like(self.bodies.p)
        for j, mass in enumerate(machine.masses):
            force[:, j] = mass * machine.robot.gravity
            moment[:, j] = np.cross(self._centre(j), force[:, j])
        if tool >= 0:
            force[:, tool] += self._on_tool
            moment[:, tool] += np.cross(self.tcp.T, self._on_tool)
        if self.looped:
            loops = machine.true
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

    @property
    def _on_tool(self) -> Floats:
        return np.asarray(self.visits.payload[:, None] * self.machine.robot.gravity + self.visits.force)

    def _centre(self, joint: int) -> Floats:
        """(N, 3) centre of mass of a joint's body, base frame, m."""
        return np.asarray(self.bodies.p[:, joint] + self.bodies.R[:, joint] @ self.machine.centres[joint])

    def _carried(self, force: Floats, moment: Floats) -> tuple[Floats, Floats]:
        """Forces and moments on each body and on all bodies that it carries, from those on the bodies themselves."""
        for j in reversed(range(len(self.machine.true.joints))):
            parent = self.machine.true.joints[j].parent
            if parent >= 0:
                force[:, parent] += force[:, j]
                moment[:, parent] += moment[:, j]
        return force, moment

    def _along(self, joint: int, force: Floats, moment: Floats) -> Floats:
        """(N,) load of a joint along its coordinate, N m or N, from forces and moments about the base's origin."""
        one, push = self.machine.true.joints[joint], force[:, joint]
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
            weight = machine.masses[j] * machine.robot.gravity
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
        return [j for j, joint in enumerate(self.machine.true.joints) if joint.parent < 0]

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
        deviation, joints = self.unbent(), self.machine.true.joints
        if not self.looped:
            seat = self.bodies.seats[:, self.machine.robot.counted[0]]
            deviation.axis[:, 0, 3:] = angle[:, None] * np.einsum("nji,j->ni", seat, about)
            return deviation
        turn = np.multiply.outer(angle, about)
        for j in self._standing:
            deviation.seat[:, j] = np.hstack([np.cross(turn, joints[j].p), turn]) @ np.kron(np.eye(2), joints[j].R)
        return deviation
