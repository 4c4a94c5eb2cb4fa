"""A machine on six rods as it was really built: geometry and masses deviate from the nominal ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from gtpin.bench.simulator.machine import CONDITIONED, MASS_SPREAD, REACH, Deviation, collected, gain, rounded
from gtpin.bench.simulator.poses import VirtualPoses, across, exp
from gtpin.bench.simulator.rods import NUDGE, Rods, VirtualRodEnds, closed
from gtpin.bench.simulator.tree import read_urdf, way_from
from gtpin.errors import RobotError, UnreachableError
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Mask

STRIDES, STEPS = 12, 8
"""Equal steps from the rod's direction at the URDF's zero to the wanted one, and Newton's steps at the end."""
CLOSED = 1e-12
"""Largest difference of two unit vectors that count as equal."""


@dataclass(frozen=True, eq=False)
class Universal:
    """Two axes that intersect: at angles x the rod has the direction R1 exp(a1 x1) R2 exp(a2 x2) t in the TCP frame."""

    name: str  # Name of the joint of the first axis, whose angle an encoder reads
    # `R1`, `R2`: (3, 3) rotations of the first joint's frame to the TCP frame, and of the second's to the first's
    R1: Floats
    R2: Floats
    # `a1`, `a2`, `t`: (3,) unit vectors: each axis in its joint's frame, and the rod's direction in the second joint's
    # frame
    a1: Floats
    a2: Floats
    t: Floats

    @staticmethod
    def of(robot: Chain) -> Universal:
        """The joint of the first rod. Names are from ``robot``, numbers from the URDF's text.

        Raises RobotError if the rod is not connected to the platform by two revolute joints.
        """
        urdf = read_urdf(robot.description.xml, still=("floating",))
        rod = robot.rods[0]
        loop = robot.description.loops[rod.loop]
        end = (loop.anchor1, loop.anchor2)[rod.rod_end]
        on = urdf.links[end.link]
        way = way_from(urdf.joints, on.joint)
        driven = {actuator.joint for actuator in robot.actuators}
        free = [j for j in reversed(way) if urdf.joints[j].name not in driven]
        tcp = urdf.links[robot.tcp_frame]
        if len(free) != 2 or any(urdf.joints[j].slides for j in free) or urdf.joints[free[0]].parent != tcp.joint:
            raise RobotError(f"rod {rod.name} hangs on no universal joint", hint="read another instrument")
        first, second = (urdf.joints[j] for j in free)
        tip = on.p + on.R @ np.array(end.xyz)
        for j in way[: way.index(free[1])]:
            tip = urdf.joints[j].p + urdf.joints[j].R @ tip
        t = tip / np.linalg.norm(tip)
        return Universal(first.name, tcp.R.T @ first.R, second.R, first.axis, second.axis, t)

    def coordinate(self, poses: VirtualPoses, ends: VirtualRodEnds) -> Floats:
        """(N,) angle about the first axis, rad, at poses with the rods' ends; NaN where the rod is parallel to the axis."""
        return self._angles(self._direction(poses, ends))[:, 0]

    def by_motion(
        self, poses: VirtualPoses, ends: VirtualRodEnds, J: Floats, moved: list[tuple[VirtualRodEnds, VirtualRodEnds]]
    ) -> Floats:
        """(N, 1, m) derivative of the angle by m numbers; J (N, 6, m) is the derivative of the poses by them.

        ``moved`` has the rods' ends with each number larger, and smaller, by ``NUDGE``.
        """
        u = self._direction(poses, ends)
        x = self._angles(u)
        found = []
        for way, (more, less) in zip(NUDGE * np.moveaxis(J, 2, 0), moved, strict=True):
            turn = exp(way[:, 3:])
            ahead = self._direction(VirtualPoses(poses.T + way[:, :3], turn @ poses.R), more)
            behind = self._direction(VirtualPoses(poses.T - way[:, :3], np.swapaxes(turn, 1, 2) @ poses.R), less)
            found.append(self._step(x, (ahead - behind) / (2.0 * NUDGE))[:, 0])
        return np.stack(found, axis=1)[:, None]

    def _direction(self, poses: VirtualPoses, ends: VirtualRodEnds) -> Floats:
        """(N, 3) unit vector along the rod, away from the platform, TCP frame."""
        away = -np.einsum("nji,nj->ni", poses.R, ends.rods(poses)[0][:, 0])
        return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True))

    def _points(self, x: Floats) -> Floats:
        """(N, 3) direction of the rod at angles (N, 2), rad, TCP frame."""
        turned = exp(x[:, :1] * self.a1) @ self.R2 @ exp(x[:, 1:] * self.a2)
        return np.asarray(turned @ self.t @ self.R1.T)

    def _step(self, x: Floats, change: Floats) -> Floats:
        """(N, 2) change of the angles, rad, that changes the direction by ``change`` (N, 3)."""
        first = exp(x[:, :1] * self.a1)
        inner = exp(x[:, 1:] * self.a2) @ self.t
        ways = (np.cross(self.a1, (first @ self.R2 @ inner[..., None])[..., 0]), np.cross(self.a2, inner))
        slopes = np.stack([ways[0], (first @ self.R2 @ ways[1][..., None])[..., 0]], axis=2)
        return np.asarray((np.linalg.pinv(self.R1 @ slopes) @ change[..., None])[..., 0])

    def _angles(self, u: Floats) -> Floats:
        """(N, 2) angles, rad, at which the rod has the directions u (N, 3): the solution connected to the URDF's zero."""
        x = np.zeros((len(u), 2))
        start = self._points(x)
        for s in np.arange(1, STRIDES + 1) / STRIDES:
            goal = start + s * (u - start)
            goal = goal / np.linalg.norm(goal, axis=1, keepdims=True)
            for _ in range(1 if s < 1.0 else STEPS):
                x = x + np.clip(self._step(x, goal - self._points(x)), -0.5, 0.5)
        x[np.abs(self._points(x) - u).max(axis=1) > CLOSED] = np.nan
        return x


ACROSS = 0.3
"""Repeatability across a track, as a share of that along it."""
BOX = (0.232, 0.159, 0.147)
"""Half the sides of a gantry's box of TCP positions, in rod lengths, base frame; x along the tracks."""
CENTER = (-0.012, -0.011, 0.0)
"""Centre of this box relative to home, in rod lengths, base frame."""
WIDE, TURNED = 0.25, 0.25
"""Half the side of a hexapod's box about the middle of its ranges, in rod lengths, and its largest rotation per axis, rad."""
PARALLEL = 0.99
"""Smallest absolute cosine of the angle between parallel tracks."""


@dataclass(frozen=True)
class RodMachine(Rods):
    """A robot on six rods as it was really built.

    A cart moves along a track, or is an arm about an axis, or the foot of a leg, which does not move when the leg's length
    changes. On a machine without rods it is a joint with its link.

    Raises `RobotError` if the robot does not have six rods, has a rod without a drive, or a drive without a rod.
    """

    plate_mass: float  # Of the platform, kg
    plate_center: Floats  # (3,) the platform's centre of mass, TCP frame, m
    rod_masses: Floats  # (k,) kg; the centre of mass of a rod of fixed length is at its middle

    def __post_init__(self) -> None:
        robot = self.robot
        if len(robot.rods) != 6 or set(self.driver.tolist()) != set(range(robot.n_actuators)):
            what = f"{robot.name} has not six rods that its actuators move"
            raise RobotError(what, hint="the simulator makes machines of that kind")

    @staticmethod
    def draw(robot: Chain, rng: np.random.Generator) -> RodMachine:
        """A machine whose parameters deviate from nominal by normal draws from the tolerances, its masses by some per cent."""
        geometry = Geometry.nominal(robot)
        built = geometry.values + geometry.tolerance * rng.standard_normal(len(geometry.values))
        plate = robot.tcp_placement.inverse() * robot.model.inertias[robot.tcp_joint]
        factors = 1.0 + MASS_SPREAD * rng.standard_normal(1 + len(robot.rods))
        center = np.array(plate.lever) + 0.005 * rng.standard_normal(3)
        nominal = np.array([_rod_mass(robot, i) for i in range(len(robot.rods))])
        return RodMachine(geometry.with_values(built), float(plate.mass * factors[0]), center, nominal * factors[1:])

    def nominal(self) -> Rods:
        """The nominal robot as a machine without effects."""
        return Rods(Geometry.nominal(self.robot))

    @property
    def n_carts(self) -> int:
        return self.robot.n_actuators

    @property
    def per_metre(self) -> float:
        """() or (n,) repeatability of a drive, m or rad, over that of a cart on a track, m."""
        return 1.0

    @property
    def readable(self) -> tuple[str, ...]:
        """Name of the passive joint that an encoder reads; empty where there is none."""
        return (self.universal.name,)

    @property
    def parameters(self) -> dict[str, float]:
        """Deviations of the geometry's parameters from nominal, by name, m and rad."""
        return dict(zip(self.geometry.names, self.geometry.deviation.tolist(), strict=True))

    @cached_property
    def is_leg(self) -> Mask:
        """(n,) whether the drive changes a leg's length."""
        return np.array([any(rod.extension == c for rod in self.robot.rods) for c in range(self.n_carts)])

    @cached_property
    def slides(self) -> Mask:
        """(n,) whether it moves a cart along a track."""
        return np.asarray(~self.is_leg & ~self.robot.revolute)

    @cached_property
    def tracks(self) -> Floats:
        """(n, 3) unit directions of the tracks, of the arms' axes, and of the legs at the URDF's zero, base frame."""
        along = [self.v[self.driver == c][0] for c in range(self.n_carts)]
        return np.where(self.is_leg[:, None], [actuator.axis for actuator in self.robot.actuators], along)

    @cached_property
    def across(self) -> Floats:
        """(n, 2, 3) two unit vectors across each track, base frame."""
        return np.array([across(v) for v in self.tracks])

    @cached_property
    def levers(self) -> Floats:
        """(k, 3) vectors from the mean of a cart's joints to each of them, with all commands zero, base frame, m."""
        C0 = self.C0
        means = np.array([C0[self.driver == c].mean(axis=0) for c in range(self.n_carts)])
        return np.asarray(C0 - means[self.driver])

    @cached_property
    def zoom(self) -> Floats:
        """(n,) place over command, 1/m or 1/rad: the largest power of two (no rounding) with which places stay within REACH."""
        half = (self.robot.upper - self.robot.lower) / 2.0
        return np.asarray(2.0 ** np.floor(np.log2(REACH / np.where(np.isfinite(half), half, REACH))))

    def places(self, q: Floats) -> Floats:
        """(N, n) places of commands (N, n) in their ranges: no unit, from about -REACH to REACH. Effects depend on them."""
        middle = (self.robot.upper + self.robot.lower) / 2.0
        return np.asarray((q - np.round(np.where(np.isfinite(middle), middle, 0.0), 1)) * self.zoom)

    @cached_property
    def leg_masses(self) -> Floats:
        """(k, 2) a rod's centre of mass from the platform at command zero, m; the share of its mass that a leg moves."""
        robot, found = self.robot, []
        for i, rod in enumerate(robot.rods):
            if rod.extension is None:
                found.append((rod.L / 2.0, 0.0))
                continue
            moment = sliding = 0.0
            placement = pin.SE3.Identity()
            for joint in _bodies(robot, i):
                if joint != rod.joint_id:
                    placement = placement * robot.model.jointPlacements[joint]
                inertia = robot.model.inertias[joint]
                moment += inertia.mass * float(np.linalg.norm(placement.act(inertia.lever)))
                if joint >= robot.actuators[rod.extension].joint_id:
                    sliding += inertia.mass
            mass = _rod_mass(robot, i)
            found.append((moment / mass, sliding / mass))
        return np.array(found)

    def unbent(self, visits: int) -> Deviation:
        return Deviation.none(visits, self.n_carts, len(self.robot.rods))

    def jitter(self, sigmas: Floats, visits: int, rng: np.random.Generator) -> Deviation:
        """Random deviations at every visit, by the repeatabilities ``sigmas`` (n,), m or rad."""
        deviation = self.unbent(visits)
        deviation.travel[:] = sigmas * rng.standard_normal((visits, self.n_carts))
        sideways = ACROSS * sigmas[:, None] * rng.standard_normal((visits, self.n_carts, 2))
        deviation.shift[:] = np.einsum("nca,cai->nci", sideways, self.across)
        return deviation

    @cached_property
    def universal(self) -> Universal:
        """The universal joint of the first rod, at which an encoder can be."""
        return Universal.of(self.robot)

    # ---------------------------------------------------------------------------------------------------- poses

    def command_jacobian(self, q: Floats, poses: VirtualPoses) -> Floats:
        return self._answer(q, poses, self.commanded(q))

    def by_tolerance(self, q: Floats, poses: VirtualPoses) -> Floats:
        """(N, 6 + k, p) derivative of the poses, and of the k joints whose coordinates they have, by everything that a
        calibration identifies, in units of tolerances."""
        return np.asarray(self._answer(q, poses, self.changed(q)) * self.geometry.tolerance)

    def _answer(self, q: Floats, poses: VirtualPoses, moved: list[tuple[VirtualRodEnds, VirtualRodEnds]]) -> Floats:
        """As :meth:`~gtpin.bench.simulator.rods.Rods.answer`, followed by the joint that is read, where there is one."""
        J = self.answer(q, poses, moved)
        if not poses.joints:
            return J
        return np.concatenate([J, self.universal.by_motion(poses, self.ends(q), J, moved)], axis=1)

    def ends(self, q: Floats, deviation: Deviation | None = None) -> VirtualRodEnds:
        """The rods' ends at commands q (N, n); without a deviation those of the true geometry."""
        if deviation is None:
            return super().ends(q)
        arms = ~self.is_leg & ~self.slides
        straight = super().ends(q + deviation.travel * arms if arms.any() else q)
        moved = deviation.shift + (deviation.travel * self.slides)[..., None] * self.tracks
        turned = np.asarray(exp(deviation.turn) - np.eye(3))[:, self.driver]
        swung = np.einsum("ncij,nj->nci", turned.transpose(1, 0, 2, 3), self.levers)
        C = straight.C + moved[:, self.driver] + swung.transpose(1, 0, 2)
        L = straight.L + deviation.length
        if self.is_leg.any():
            L = L + (deviation.travel * self.is_leg)[:, self.driver]
        return VirtualRodEnds(straight.P + deviation.joint, C, L)

    def close(self, start: VirtualPoses, ends: VirtualRodEnds) -> VirtualPoses:
        """(N) closed poses, base frame, from poses at a distance of less than some millimetres.

        Raises UnreachableError if some rods can't be closed.
        """
        poses, done = closed(start, ends, self.robot.size)
        if not done.all():
            raise UnreachableError("the deviations open the rods", hint="make the effects smaller")
        return poses

    # ------------------------------------------------------------------------------------------------- commands

    def reachable(self, count: int, rng: np.random.Generator) -> Floats:
        """(count, n) random commands all over the workspace, m or rad. Raises UnreachableError if it reaches hardly any."""
        robot, parallel = self.robot, np.abs(self.tracks @ self.tracks[0]) > PARALLEL
        draw = self._in_ranges
        if self.n_carts == 3 and (self.slides & parallel).all() and abs(self.tracks[0, 2]) < PARALLEL:
            draw = self._in_box  # a gantry: carts on parallel tracks that are not vertical
        elif self.n_carts == 6 and (self.slides | self.is_leg).all():
            draw = self._turned  # each rod has its own drive, so that the platform can rotate

        def inside() -> Floats:
            q = rounded(draw(count, rng))
            return np.asarray(q[((q >= robot.lower) & (q <= robot.upper)).all(axis=1)])  # NaN is not inside

        found = collected(inside, count)
        if found is None:
            raise UnreachableError(f"{robot.name} reaches hardly any of its box", hint="widen the ranges in the URDF")
        return found

    def _in_box(self, count: int, rng: np.random.Generator) -> Floats:
        """(count, n) commands for random positions in home's orientation, which the machine nearly keeps; NaN out of reach."""
        home = self.home
        size = float(self.L0.mean())
        T = home.T[0] + size * (np.array(CENTER) + np.array(BOX) * rng.uniform(-1.0, 1.0, (count, 3)))
        q = self._carts(T[:, None, :] + self.P @ home.R[0].T)
        return np.column_stack([q[:, self.driver == c].mean(axis=1) for c in range(self.n_carts)])

    def _turned(self, count: int, rng: np.random.Generator) -> Floats:
        """(count, 6) commands for random poses about the middle of the ranges; NaN out of reach."""
        middle, pose = self._middle
        size = float(self.ends(middle).L.mean())
        T = pose.T[0] + size * WIDE * rng.uniform(-1.0, 1.0, (count, 3))
        R = exp(TURNED * rng.uniform(-1.0, 1.0, (count, 3))) @ pose.R[0]
        joints = T[:, None, :] + self.P @ np.swapaxes(R, 1, 2)
        legs = np.linalg.norm(joints - self.C0, axis=2) - self.L0
        travel = np.where(self.is_leg[self.driver], legs, self._carts(joints)) / self.scale
        q = np.empty_like(travel)
        q[:, self.driver] = travel
        return q

    def _in_ranges(self, count: int, rng: np.random.Generator) -> Floats:
        """(count, n) random commands in the ranges; NaN where the machine is worse conditioned than ``CONDITIONED`` allows."""
        lower, upper = self.robot.ends
        q = rng.uniform(lower, upper, (count, self.n_carts))
        q[gain(self, q) > CONDITIONED * gain(self, self._middle[0])] = np.nan
        return q

    @cached_property
    def _middle(self) -> tuple[Floats, VirtualPoses]:
        """(1, n) commands in the middle of the ranges and the pose there; home where that can't be reached."""
        robot = self.robot
        middle = (robot.lower + robot.upper) / 2.0
        q = np.where(np.isfinite(middle), middle, robot.home_q)[None]
        pose = self.predict(q)
        return (q, pose) if pose.reached.all() else (robot.home_q[None], self.home)

    def _carts(self, joints: Floats) -> Floats:
        """(N, k) travel of each rod's cart, m, for the platform's joints (N, k, 3), base frame; NaN out of reach."""
        # |T + R P - C0 - q v|^2 = L^2, a quadratic in q; the carts stay on home's side of the platform.
        a = joints - self.C0
        along = np.einsum("nki,ki->nk", a, self.v)
        with np.errstate(invalid="ignore"):
            root = np.sqrt(along**2 - np.einsum("nki,nki->nk", a, a) + self.L0**2)
        home_side = np.sign(np.einsum("ki,ki->k", self.home.T[0] - self.C0, self.v))
        return np.asarray(along - home_side * root)


def _bodies(robot: Chain, rod: int) -> list[int]:
    """The Pinocchio joints of a rod, from the platform to its end."""
    constraint = robot.constraints[robot.rods[rod].loop]
    tip = constraint.joint1_id if robot.rods[rod].rod_end == 0 else constraint.joint2_id
    chain = list(robot.model.supports[tip])
    return chain[chain.index(robot.rods[rod].joint_id) :]


def _rod_mass(robot: Chain, rod: int) -> float:
    return float(sum(robot.model.inertias[joint].mass for joint in _bodies(robot, rod)))
