"""A machine without rods as it was really built: joints, masses and the target deviate from the nominal ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.machine import MASS_SPREAD, REACH, Deviation, collected, rounded, well_conditioned
from gtpin.bench.simulator.poses import AXES, VirtualPoses
from gtpin.bench.simulator.tree import STRAIGHT, Bending, Placed, TreeFrame, moved, placed
from gtpin.errors import UnreachableError
from gtpin.typing import Floats, Mask

PER_METRE = 5.0
"""Repeatability of a revolute joint, rad, over that of a cart, m. Small arms state 30 um (ISO 9283), which is 3 sigma."""
NUDGE = 1e-6
"""Step of the central differences from which derivatives are computed, m and rad."""
TARGET_FREE = np.array([0.3] * 3 + [1.0] * 3)
"""Prior sigmas of the pose of an unknown target, m and rad, and 1 of an unknown frame: so large that they have no influence."""


@dataclass(frozen=True, eq=False)
class ArmMachine:
    """An arm with n commanded joints, as :class:`~gtpin.bench.simulator.rod_machine.RodMachine`.

    Its passive joints close its loops, where there are any, in spite of all deviations.
    """

    robot: Arm  # The nominal robot
    # Each placement is the nominal one times the exponential of a twist (6,), m and rad.
    twists: Floats  # (k, 6) of the robot's ``placed`` joints
    tool: Floats  # (6,) of the tool
    ends: Floats  # (2 L, 3) displacement from nominal of the points at which L loops close, their links' frames, m
    masses: Floats  # (J,) masses of the bodies of all moving joints, kg
    centres: Floats  # (J, 3) their centres of mass, own frames, m
    target: TreeFrame  # Placement of the measured target in the TCP frame
    # Whether the pose of the instrument's frame is unknown to the user, and whether that of the target is
    free: tuple[bool, bool] = (False, False)

    @staticmethod
    def of(robot: Arm, off: Mapping[str, Floats] = MappingProxyType({})) -> ArmMachine:
        """The machine that the URDF describes.

        ``off``: by the names of the parameters, twist (6,), m and rad, of ``placement[JOINT]`` and ``platform``, and
        displacement of ``anchor[END]``, of which the first three count.
        """
        twists = np.array([off.get(name, np.zeros(6)) for name in robot.placements])
        ends = [off.get(f"anchor[{name}]", np.zeros(6))[:3] for name in robot.ends]
        return ArmMachine(
            robot=robot,
            twists=twists[:-1],
            tool=twists[-1],
            ends=np.array(ends).reshape(-1, 3),
            masses=np.array([j.mass for j in robot.joints]),
            centres=np.array([j.centre for j in robot.joints]),
            target=TreeFrame(-1, np.eye(3), np.zeros(3)),
        )

    @staticmethod
    def draw(robot: Arm, rng: np.random.Generator) -> ArmMachine:
        """A machine whose parameters deviate from nominal by normal draws from the tolerances, its masses by some per cent, its
        centres of mass by 10 mm per axis."""
        built = ArmMachine.of(robot)
        twists = robot.tolerance * rng.standard_normal((len(robot.placed) + 1, 6))
        return replace(
            built,
            twists=twists[:-1],
            tool=twists[-1],
            masses=built.masses * (1.0 + MASS_SPREAD * rng.standard_normal(len(built.masses))),
            centres=built.centres + 0.01 * rng.standard_normal(built.centres.shape),
            ends=robot.tolerance[:3] * rng.standard_normal(built.ends.shape),
        )

    def nominal(self) -> ArmMachine:
        return ArmMachine.of(self.robot)

    @property
    def n_carts(self) -> int:
        return self.robot.n_actuators

    @cached_property
    def per_metre(self) -> Floats:
        return np.where(self.robot.slides, 1.0, PER_METRE)

    @property
    def readable(self) -> tuple[str, ...]:
        return tuple(self.true.joints[j].name for j in self.robot.passive[:1])

    @property
    def parameters(self) -> dict[str, float]:
        values = dict(zip(self.robot.placements, [*self.twists, self.tool], strict=True))
        values |= {f"anchor[{name}]": end for name, end in zip(self.robot.ends, self.ends, strict=True)}
        return {f"{name}.{AXES[i]}": float(x) for name, row in values.items() for i, x in enumerate(row)}

    def usual_load(self, cart: int) -> float:
        """Usual load of a commanded joint, N m or N; that of the first joint where it is not between base and TCP."""
        return float(self._usual[cart])

    @cached_property
    def _usual(self) -> Floats:
        robot = self.robot
        first = robot.usual_moment(robot.way[0]) if robot.way else 1.0
        return np.array([robot.usual_moment(j) if c in robot.acting else first for c, j in enumerate(robot.counted)])

    def flexibility(self, cart: int) -> float:
        """1/EI of a link made for its load, 1/(N m^2): its end turns by 0.1 mrad under half the usual load of its joint."""
        return 1e-4 / (self.robot.length(self.robot.counted[cart]) * 0.5 * float(self._usual[cart]))

    # -------------------------------------------------------------------------------------------------- motion

    @cached_property
    def true(self) -> Arm:
        """The robot with the true placements of the joints, of the TCP, and of the points at which the loops close."""
        robot, joints = self.robot, list(self.robot.joints)
        for twist, j in zip(self.twists, robot.placed, strict=True):
            joints[j] = moved(joints[j], twist)
        points = (end for pair in robot.pairs for end in pair)
        there = [replace(end, p=end.p + R @ d) for end, R, d in zip(points, robot.axes, self.ends, strict=True)]
        pairs = tuple(zip(there[::2], there[1::2], strict=True))
        return replace(robot, joints=tuple(joints), tcp=moved(robot.tcp, self.tool), pairs=pairs)

    @cached_property
    def seen(self) -> TreeFrame:
        """The frame of the measured target."""
        tcp = self.true.tcp
        return TreeFrame(tcp.joint, tcp.R @ self.target.R, tcp.p + tcp.R @ self.target.p)

    def bodies(
        self, q: Floats, deviation: Deviation | None = None, near: Placed | None = None
    ) -> tuple[Placed, Bending]:
        """The bodies at commands q (N, n), and their bending; NaN where loops don't close.

        ``near``: nearby postures to start from, where they are known.

        Raises UnreachableError if the loops close without the deviation but not with it.
        """
        bending, driven = STRAIGHT, q
        if deviation is not None:
            axis = self._on_all(deviation.axis)
            if deviation.seat.any():
                axis = deviation.seat if axis is None else axis + deviation.seat
            bending = Bending(axis, self._on_all(deviation.tip), self._ends)
            driven = q + deviation.travel
        if not self.robot.pairs:
            # Joints without a command mimic another one, or are at zero.
            x = np.zeros((len(q), len(self.true.joints)))
            x[:, list(self.robot.counted)] = driven
            for j, joint in enumerate(self.true.joints):
                if joint.follows is not None:
                    leader, factor, offset = joint.follows
                    x[:, j] = factor * x[:, leader] + offset
            return placed(self.true.joints, x, bending), bending
        x = self.true.led(q) if near is None else near.x
        if deviation is None:
            return placed(self.true.joints, x if near is None else self.true.closed(x, q)), bending
        closed = self.true.closed(x, driven, bending)
        if np.isnan(closed[~np.isnan(x).any(axis=1)]).any():
            raise UnreachableError("the deviations open the loops", hint="make the effects smaller")
        return placed(self.true.joints, closed, bending), bending

    @cached_property
    def _ends(self) -> Floats | None:
        """(J, 3) ends of the bodies, own frames, m: what is fixed to them moves with them; None on an open chain."""
        count = range(len(self.true.joints))
        return np.array([self.robot.next_frame(j).p for j in count]) if self.robot.pairs else None

    def _on_all(self, counted: Floats) -> Floats | None:
        """(N, J, 6) changes at all joints, from those (N, n, 6) at the commanded ones; None without any."""
        if not counted.any():
            return None
        whole = np.zeros((len(counted), len(self.true.joints), 6))
        whole[:, list(self.robot.counted)] = counted
        return whole

    def predict(self, q: Floats, near: Placed | None = None, read: tuple[str, ...] = ()) -> VirtualPoses:
        """Poses of the measured target, with the coordinates of the joints ``read``; ``near`` as in :meth:`bodies`."""
        bodies = self.bodies(q, near=near)[0]
        return bodies.at(self.seen).with_joints(self.coordinates_of(bodies, read))

    def coordinates_of(self, bodies: Placed, read: tuple[str, ...]) -> dict[str, Floats]:
        """(N,) coordinates of some joints, rad or m, by name."""
        names = [joint.name for joint in self.true.joints]
        return {name: bodies.x[:, names.index(name)] for name in read}

    def unbent(self, visits: int) -> Deviation:
        return Deviation.none(visits, self.n_carts, joints=len(self.true.joints))

    def jitter(self, sigmas: Floats, visits: int, rng: np.random.Generator) -> Deviation:
        """Random deviations at every visit, by the repeatabilities ``sigmas`` (n,), rad or m."""
        deviation = self.unbent(visits)
        deviation.travel[:] = sigmas * rng.standard_normal((visits, self.n_carts))
        return deviation

    # ---------------------------------------------------------------------------------------------- derivatives

    def command_jacobian(self, q: Floats, poses: VirtualPoses) -> Floats:
        near, read = self.bodies(q)[0], tuple(poses.joints)
        steps = NUDGE * np.eye(self.n_carts)
        pairs = [(self.predict(q + step, near, read), self.predict(q - step, near, read)) for step in steps]
        return np.stack([one.change(other) / (2.0 * NUDGE) for one, other in pairs], axis=2)

    def by_tolerance(self, q: Floats, poses: VirtualPoses) -> Floats:
        near, read, placements = self.bodies(q)[0], tuple(poses.joints), np.vstack([self.twists, self.tool])

        def by(shape: tuple[int, ...], changed: Callable[[Floats], ArmMachine]) -> Floats:
            """Derivative by deviations of a shape, which :func:`changed` adds, in units of tolerances."""
            columns = []
            for i, axis in np.ndindex(shape):
                step = np.zeros(shape)
                step[i, axis] = NUDGE
                one, other = (changed(s * step).predict(q, near, read) for s in (1.0, -1.0))
                columns.append(one.change(other) / (2.0 * NUDGE) * self.robot.tolerance[axis])
            return np.stack(columns, axis=2)

        def replaced(step: Floats) -> ArmMachine:
            twists = placements + step
            return replace(self, twists=twists[:-1], tool=twists[-1])

        found = [by(placements.shape, replaced)]
        if self.free[0]:
            turning = np.zeros((len(q), found[0].shape[1], 6))
            turning[:, :6] = np.eye(6)
            turning[:, :3, 3:] = np.cross(np.eye(3), poses.T[:, None]).transpose(0, 2, 1)
            found.append(turning)
        if self.free[1]:
            own = np.zeros((len(q), found[0].shape[1], 6))
            own[:, :3, :3] = own[:, 3:6, 3:] = poses.R
            found.append(own * TARGET_FREE)
        if len(self.ends):
            found.append(by(self.ends.shape, lambda step: replace(self, ends=self.ends + step)))
        return np.concatenate(found, axis=2)

    # ------------------------------------------------------------------------------------------------- commands

    @cached_property
    def region(self) -> tuple[Floats, Floats]:
        """(n,) middles and half widths of the ranges of drawn commands, rad or m; with loops, infinite ones about home."""
        robot = self.robot
        ended, free = np.isfinite(robot.upper - robot.lower), np.where(robot.slides, 0.5, np.pi)
        lower, upper = np.where(ended, robot.lower, -np.pi), np.where(ended, robot.upper, np.pi)
        middle = (lower + upper) / 2.0
        if robot.pairs:
            wide = np.where(ended, (upper - lower) / 2.0, free)
            return np.where(ended, middle, robot.home_q), 0.95 * wide  # bad conditioning limits it more than these ends
        half = 0.6 * np.where(ended, upper - middle, free)
        return middle, np.where(robot.slides, half, np.minimum(half, 2.4))

    def places(self, q: Floats) -> Floats:
        middle, half = self.region
        return np.asarray(REACH * (q - middle) / half)

    def reachable(self, count: int, rng: np.random.Generator) -> Floats:
        middle, half = self.region

        def drawn() -> Floats:
            return np.asarray(middle + half * rng.uniform(-1.0, 1.0, (count, self.n_carts)))

        if self.robot.pairs:
            return well_conditioned(self, self.robot.name, self.robot.home_q, drawn, count)
        last = np.zeros((0, self.n_carts))

        def in_front() -> Floats:
            nonlocal last
            last = rounded(drawn())
            return np.asarray(last[self._in_front(last)])

        found = collected(in_front, count, tries=200)
        return last if found is None else found

    def _in_front(self, q: Floats) -> Mask:
        """(N,) whether the TCP is in front of the base and above the floor, and the arm neither folded nor stretched out.

        In front: within 2 rad of the base's x axis. Heights and distances are shares of the stretched length.
        """
        robot = self.robot
        bodies = self.bodies(q)[0]
        tcp = bodies.at(self.true.tcp).T
        whole = sum(robot.length(j) for j in robot.way) if robot.way else 1.0  # stretched out
        up = -robot.gravity / (float(np.linalg.norm(robot.gravity)) or 1.0)
        heights = np.column_stack([bodies.p[:, j] @ up for j in robot.way[1:]] + [tcp @ up])
        distance = np.linalg.norm(tcp, axis=1)
        sideways = tcp - np.outer(tcp @ up, up)
        ahead = np.abs(np.arctan2(sideways[:, 1], sideways[:, 0])) <= 2.0
        clear = np.linalg.norm(sideways, axis=1) >= 0.25 * whole
        return np.asarray((heights > 0.02 * whole).all(axis=1) & (distance < 0.92 * whole) & clear & ahead)
