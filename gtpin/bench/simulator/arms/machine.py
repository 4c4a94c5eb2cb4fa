"""An arm as it was really built: joints, masses and the target deviate from the nominal ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from gtpin.bench.simulator.arms.deviation import ArmDeviation
from gtpin.bench.simulator.arms.robot import Arm
from gtpin.bench.simulator.arms.tree import STRAIGHT, Bending, Placed, moved, placed
from gtpin.bench.simulator.arms.urdf import Frame, Joint
from gtpin.bench.simulator.poses import Poses
from gtpin.typing import Floats

MASS_SPREAD = 0.04
"""Standard deviation of each mass, relative to the nominal mass."""
CENTRE_SPREAD = 0.01
"""Standard deviation of each body's centre of mass, per axis, m."""
RANGE, WIDEST = 0.6, 2.4
"""Largest distance of a command from the middle of its range: as a share of half the range, and rad for a revolute joint."""
REACH = 0.8
"""Place at the end of the used range: see :meth:`ArmMachine.places`."""
PER_METRE = 5.0
"""Repeatability of a revolute joint, rad, over that of a cart, m. Small arms state 30 um (ISO 9283), which is 3 sigma."""
NUDGE = 1e-6
"""Step of the central differences from which derivatives are computed, m and rad."""
FRAME_FREE = np.array([1.0] * 3 + [1.0] * 3)
TARGET_FREE = np.array([0.3] * 3 + [1.0] * 3)
"""Prior sigmas of the pose of an unknown frame and of an unknown target, m and rad: so large that they have no influence."""


@dataclass(frozen=True, eq=False)
class ArmMachine:
    """An arm with n commanded joints.

    Parameters
    ----------
    robot
        The nominal robot.
    twists, tool
        (k, 6) twists of the robot's ``placed`` joints, and (6,) twist of the tool: each placement is the nominal one times the
        exponential of its twist, m and rad.
    masses, centres
        (J,) masses, kg, and (J, 3) centres of mass, m, in their own frames, of the bodies of all moving joints.
    target
        Placement of the measured target in the TCP frame.
    free
        Whether the pose of the instrument's frame is unknown to the user, and whether that of the target is.
    """

    robot: Arm
    twists: Floats
    tool: Floats
    masses: Floats
    centres: Floats
    target: Frame
    free: tuple[bool, bool] = (False, False)

    @staticmethod
    def nominal(robot: Arm) -> ArmMachine:
        """The machine that the URDF describes."""
        masses, centres = [j.mass for j in robot.joints], [j.centre for j in robot.joints]
        at_tcp = Frame(-1, np.eye(3), np.zeros(3))
        twists = np.zeros((len(robot.placed), 6))
        return ArmMachine(robot, twists, np.zeros(6), np.array(masses), np.array(centres), at_tcp)

    @staticmethod
    def draw(robot: Arm, rng: np.random.Generator) -> ArmMachine:
        """A machine whose parameters deviate from nominal by normal draws from the tolerances, its masses by some per cent."""
        return ArmMachine.nominal(robot).drawn(rng)

    def drawn(self, rng: np.random.Generator) -> Self:
        """Another machine of the same robot: see :meth:`draw`."""
        twists = self.robot.tolerance * rng.standard_normal((len(self.robot.placed) + 1, 6))
        return replace(
            self,
            twists=twists[:-1],
            tool=twists[-1],
            masses=self.masses * (1.0 + MASS_SPREAD * rng.standard_normal(len(self.masses))),
            centres=self.centres + CENTRE_SPREAD * rng.standard_normal(self.centres.shape),
        )

    def with_twists(self, twists: Floats, tool: Floats) -> Self:
        """The machine with other twists (k, 6) of its joints and (6,) of its tool."""
        return replace(self, twists=twists, tool=tool)

    @property
    def n_carts(self) -> int:
        """Number of commanded joints."""
        return self.robot.n_actuators

    @cached_property
    def per_metre(self) -> Floats:
        """(n,) repeatability of each joint, rad or m, over that of a cart, m."""
        return np.where(self.robot.slides, 1.0, PER_METRE)

    def usual_load(self, cart: int) -> float:
        """Usual load of a commanded joint, N m or N, as a scale of its stiffness; that of the first joint where the commanded
        one is not between base and TCP."""
        return float(self._usual[cart])

    @cached_property
    def _usual(self) -> Floats:
        robot = self.robot
        first = robot.usual_moment(robot.way[0]) if robot.way else 1.0
        usual = [robot.usual_moment(j) if c in robot.acting else first for c, j in enumerate(robot.counted)]
        return np.array(usual)

    def flexibility(self, cart: int) -> float:
        """1/EI of a link made for its load, 1/(N m^2): its end turns by 0.1 mrad under half the usual load of its joint."""
        return 1e-4 / (self.robot.length(self.robot.counted[cart]) * 0.5 * float(self._usual[cart]))

    @cached_property
    def common_flexibility(self) -> float:
        """1/EI of links with the same cross section, 1/(N m^2): that of the stiffest link."""
        return min(self.flexibility(cart) for cart in self.robot.linked)

    # -------------------------------------------------------------------------------------------------- motion

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """The joints with their true placements."""
        found = list(self.robot.joints)
        for twist, j in zip(self.twists, self.robot.placed, strict=True):
            R, p = moved(found[j].R, found[j].p, twist)
            found[j] = replace(found[j], R=R, p=p)
        return tuple(found)

    @cached_property
    def tcp(self) -> Frame:
        """The true TCP frame."""
        return Frame(self.robot.tcp.joint, *moved(self.robot.tcp.R, self.robot.tcp.p, self.tool))

    @cached_property
    def seen(self) -> Frame:
        """The frame of the measured target."""
        tcp = self.tcp
        return Frame(tcp.joint, tcp.R @ self.target.R, tcp.p + tcp.R @ self.target.p)

    def coordinates(self, q: Floats) -> Floats:
        """(N, J) coordinates of all joints at commands q (N, n). Joints without a command mimic another one, or are at zero."""
        x = np.zeros((len(q), len(self.joints)))
        x[:, list(self.robot.counted)] = q
        for j, joint in enumerate(self.joints):
            if joint.follows is not None:
                leader, factor, offset = joint.follows
                x[:, j] = factor * x[:, leader] + offset
        return x

    def bodies(
        self, q: Floats, deviation: ArmDeviation | None = None, near: Placed | None = None
    ) -> tuple[Placed, Bending]:
        """The bodies at commands q (N, n), and their bending; ``near``: nearby postures to start from, where they are known."""
        if deviation is None:
            return placed(self.joints, self.coordinates(q)), STRAIGHT
        bending = Bending(self._on_all(deviation.axis), self._on_all(deviation.tip))
        return placed(self.joints, self.coordinates(q + deviation.travel), bending), bending

    def _on_all(self, counted: Floats) -> Floats | None:
        if not counted.any():
            return None
        whole = np.zeros((len(counted), len(self.joints), 6))
        whole[:, list(self.robot.counted)] = counted
        return whole

    def forward(self, q: Floats, near: Placed | None = None, read: Sequence[str] = ()) -> Poses:
        """Poses of the target at commands q (N, n), base frame, without any effect; ``near`` as in :meth:`bodies`.

        The coordinates of the joints that ``read`` names are returned with the poses.
        """
        bodies = self.bodies(q, near=near)[0]
        return bodies.at(self.seen).with_joints(self.coordinates_of(bodies, read))

    def coordinates_of(self, bodies: Placed, read: Sequence[str]) -> dict[str, Floats]:
        """(N,) coordinate of each of some joints, rad or m, by name."""
        names = [joint.name for joint in self.joints]
        return {name: bodies.x[:, names.index(name)] for name in read}

    def unbent(self, visits: int) -> ArmDeviation:
        """Deviations of zero at a number of visits."""
        return ArmDeviation.none(visits, self.n_carts)

    def jitter(self, sigmas: Floats, visits: int, rng: np.random.Generator) -> ArmDeviation:
        """Random deviations at every visit, of joints with the repeatabilities ``sigmas`` (n,), rad or m."""
        deviation = self.unbent(visits)
        deviation.travel[:] = sigmas * rng.standard_normal((visits, self.n_carts))
        return deviation

    # ------------------------------------------------------------------------------------------------- commands

    @cached_property
    def region(self) -> tuple[Floats, Floats]:
        """(n,) middles and half widths of the ranges from which commands are drawn, rad or m."""
        lower, upper = self.robot.lower, self.robot.upper
        open_ended = ~np.isfinite(upper - lower)
        middle = np.where(open_ended, 0.0, (np.where(open_ended, 0.0, lower) + np.where(open_ended, 0.0, upper)) / 2.0)
        half = np.where(open_ended, np.where(self.robot.slides, 0.5, np.pi), np.where(open_ended, 0.0, upper - middle))
        return middle, np.where(self.robot.slides, RANGE * half, np.minimum(RANGE * half, WIDEST))

    def places(self, q: Floats) -> Floats:
        """(N, n) places of commands (N, n) in the used range: no unit, from -REACH to REACH. Effects depend on places."""
        middle, half = self.region
        return np.asarray(REACH * (q - middle) / half)

    # ---------------------------------------------------------------------------------------------- derivatives

    def command_jacobian(self, q: Floats, read: Sequence[str] = ()) -> Floats:
        """(N, 6 + k, n) derivative of the target's pose, position and rotation vector, base frame, and of the k joints
        ``read``, by the commands.
        """
        steps, near = NUDGE * np.eye(self.n_carts), self.bodies(q)[0]
        pairs = [(self.forward(q + step, near, read), self.forward(q - step, near, read)) for step in steps]
        return np.stack([one.change(other) / (2.0 * NUDGE) for one, other in pairs], axis=2)

    def by_tolerance(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6 + k, p) derivative of the target's poses by everything that a calibration identifies, in units of tolerances:
        all placements, the tool, and the instrument's frame and the target where they are free.

        The k joints are those whose coordinates ``poses`` have.
        """
        columns, near, count = [], self.bodies(q)[0], len(self.twists) + 1
        for i in range(count):
            for c in range(6):
                step = np.zeros((count, 6))
                step[i, c] = NUDGE
                pair = [
                    replace(self, twists=self.twists + s * step[:-1], tool=self.tool + s * step[-1]).forward(
                        q, near, tuple(poses.joints)
                    )
                    for s in (1.0, -1.0)
                ]
                columns.append(pair[0].change(pair[1]) / (2.0 * NUDGE) * self.robot.tolerance[c])
        found = [np.stack(columns, axis=2)]
        if self.free[0]:
            turning = np.zeros((len(q), found[0].shape[1], 6))
            turning[:, :6] = np.eye(6)
            turning[:, :3, 3:] = np.cross(np.eye(3), poses.T[:, None]).transpose(0, 2, 1)
            found.append(turning * FRAME_FREE)
        if self.free[1]:
            own = np.zeros((len(q), found[0].shape[1], 6))
            own[:, :3, :3] = own[:, 3:6, 3:] = poses.R
            found.append(own * TARGET_FREE)
        return np.concatenate(found, axis=2)
