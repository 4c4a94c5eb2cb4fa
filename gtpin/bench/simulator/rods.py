"""Kinematics of a platform on six rods, for many poses at once: the closures |T + R P - C| = L, solved by Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from gtpin.bench.simulator.poses import VirtualPoses, across, exp
from gtpin.errors import UnreachableError
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Ints, Mask

STEPS = 12
SHORTER = 0.25
"""Largest ratio of each Newton step to the one before; with a larger one the start was not near the solution."""
FINE = 1e-8
"""Step, m or rad, below which this ratio is not checked, because rounding errors dominate it."""
SHORTEST = 1.0 / 256.0
"""Smallest stride, as a share of the path to new ends. Where shorter ones are needed, the ends can't be reached."""


@dataclass(frozen=True)
class VirtualRodEnds:
    """Ends of the rods at N poses: P on the platform, (k, 3) or (N, k, 3), TCP frame; C (N, k, 3) on the carriers, base
    frame; lengths L (N, k) or (1, k); all in m.
    """

    P: Floats
    C: Floats
    L: Floats

    def take(self, rows: Ints | Mask) -> VirtualRodEnds:
        """The ends at some of the poses."""
        P, L = self.P if self.P.ndim == 2 else self.P[rows], self.L if len(self.L) == 1 else self.L[rows]
        return VirtualRodEnds(P, self.C[rows], L)

    def rods(self, poses: VirtualPoses) -> tuple[Floats, Floats]:
        """Vectors from each rod's carrier joint, and from the TCP, to its platform joint: both (N, k, 3), base frame, m."""
        arm = self.P @ np.swapaxes(poses.R, 1, 2)
        return poses.T[:, None] + arm - self.C, arm

    def gaps(self, poses: VirtualPoses) -> Floats:
        """(N, k) distance of each rod's joints less its length, m."""
        return np.asarray(np.linalg.norm(self.rods(poses)[0], axis=2) - self.L)

    def squares(self, poses: VirtualPoses) -> Floats:
        """(N, k) half the difference of the squares of that distance and the rod's length, m^2."""
        rods = self.rods(poses)[0]
        return np.asarray((np.einsum("nki,nki->nk", rods, rods) - self.L**2) / 2.0)


def by_pose(rods: Floats, arm: Floats) -> Floats:
    """(N, k, 6) derivative of the gaps by the platform's position and rotation vector, base frame.

    A row is the wrench on the platform, at the TCP, of a unit force along the rod.
    """
    unit = rods / np.linalg.norm(rods, axis=2, keepdims=True)
    return np.concatenate([unit, np.cross(arm, unit)], axis=2)


def each_solved(matrices: Floats, right: Floats) -> Floats:
    """(N, k) solutions of N systems (N, k, k), (N, k); NaN where one is singular."""
    singular = ~(np.abs(np.linalg.det(matrices)) > 0.0)
    safe = np.where(singular[:, None, None], np.eye(matrices.shape[1]), matrices)
    solution = np.linalg.solve(safe, right[..., None])[..., 0]
    solution[singular] = np.nan
    return np.asarray(solution)


def closed(start: VirtualPoses, ends: VirtualRodEnds, size: float) -> tuple[VirtualPoses, Mask]:
    """Poses (N) at which the rods close, from nearby ones, and (N,) whether they close to the rounding error of ``size``, m."""
    T, R = start.T.copy(), start.R.copy()
    done = np.zeros(len(T), dtype=bool)
    before = np.full(len(T), np.inf)
    rows = np.arange(len(T))
    for _ in range(STEPS):
        some, here = ends.take(rows), VirtualPoses(T[rows], R[rows])
        gaps = some.gaps(here)
        done[rows] = np.abs(gaps).max(axis=1) <= 16.0 * np.finfo(float).eps * size
        step = each_solved(by_pose(*some.rods(here)), -gaps)
        length = np.linalg.norm(step, axis=1)
        going = ~done[rows] & ((length <= FINE) | (length <= SHORTER * before[rows]))  # NaN does not go on
        rows, step, length = rows[going], step[going], length[going]
        if not rows.size:
            break
        T[rows] += step[:, :3]
        R[rows] = exp(step[:, 3:]) @ R[rows]
        before[rows] = length
    return VirtualPoses(T, R), done


def led(way: Callable[[Floats, Ints], VirtualRodEnds], start: VirtualPoses, size: float) -> VirtualPoses:
    """Closed poses (N) at the end of a path of the rods' ends, from the closed poses ``start``, in the same assembly mode.

    ``way`` gives the ends at fractions (m,) of the path, for m of the poses. A stride along the path is halved until Newton's
    method converges fast to the next pose without crossing a singularity; NaN where the stride becomes too short.
    """
    T, R = start.T.copy(), start.R.copy()
    at, stride = np.zeros(len(T)), np.ones(len(T))
    rows = np.arange(len(T))
    side = _side(way(at, rows), start)
    while rows.size:
        goal = np.minimum(1.0, at[rows] + stride[rows])
        ends = way(goal, rows)
        poses, good = closed(VirtualPoses(T[rows], R[rows]), ends, size)
        good[good] = _side(ends.take(good), poses[good]) == side[rows[good]]
        on, off = rows[good], rows[~good]
        T[on], R[on], at[on] = poses.T[good], poses.R[good], goal[good]
        stride[on] *= 2.0
        stride[off] /= 2.0
        lost = off[stride[off] < SHORTEST]
        T[lost], R[lost], at[lost] = np.nan, np.nan, 1.0
        rows = np.flatnonzero(at < 1.0)
    return VirtualPoses(T, R)


def _side(ends: VirtualRodEnds, poses: VirtualPoses) -> Floats:
    return np.asarray(np.sign(np.linalg.det(by_pose(*ends.rods(poses)))))


CHUNK = 4096
"""Largest number of poses that are solved together."""
NUDGE = 1e-5
"""Step of the central differences of derivatives, m or rad: small, as gaps have curvatures of about 1/m."""


@dataclass(frozen=True)
class Rods:
    """Kinematics of a platform on six rods, whose true ``geometry`` has the parameters that docs/glossary.md describes."""

    geometry: Geometry  # Its true geometry

    @property
    def robot(self) -> Chain:
        """The nominal robot."""
        return self.geometry.robot

    @cached_property
    def driver(self) -> Ints:
        """(k,) the actuator that moves a rod's joint on its carrier, or changes its length; -1 where none does."""
        found = [rod.carrier if rod.carrier is not None else rod.extension for rod in self.robot.rods]
        return np.array([-1 if actuator is None else actuator for actuator in found])

    @cached_property
    def extends(self) -> Mask:
        """(k,) whether the actuator changes the rod's length."""
        return np.array([rod.extension is not None for rod in self.robot.rods])

    @cached_property
    def P(self) -> Floats:
        """(k, 3) joints on the platform, TCP frame, m."""
        return np.array([rod.P for rod in self.robot.rods]) + self._off("platform_joint", "xyz")

    @cached_property
    def C0(self) -> Floats:
        """(k, 3) joints on the carriers with all commands zero, base frame, m."""
        C = np.array([rod.C for rod in self.robot.rods])
        return C + sum(self._off(f"{carrier}_joint", "xyz") for carrier in ("cart", "arm", "base"))

    @cached_property
    def L0(self) -> Floats:
        """(k,) lengths with all commands zero, m."""
        return np.array([rod.L for rod in self.robot.rods]) + self._off("length")[:, 0]

    @cached_property
    def scale(self) -> Floats:
        """(k,) travel over command; no unit."""
        return np.asarray(1.0 + self._off("scale")[:, 0])

    @cached_property
    def v(self) -> Floats:
        """(k, 3) directions of the carriers' tracks or axes, unit vectors, base frame; zero where nothing moves them."""
        robot, off = self.robot, self._off("track_direction", "ab") + self._off("arm_axis", "ab")
        axes = [None if rod.carrier is None else robot.actuators[rod.carrier].axis for rod in robot.rods]
        vectors = [np.zeros(3) if axis is None else off[i] @ across(axis) for i, axis in enumerate(axes)]
        turns = exp(vectors)  # of all rods at once: derivatives by the geometry build many machines
        return np.array([np.zeros(3) if axis is None else turns[i] @ axis for i, axis in enumerate(axes)])

    def _off(self, kind: str, components: str = "") -> Floats:
        """(k, c) deviations of each rod: its own, and those that it shares with all rods of its actuator."""
        robot, ends = self.robot, [f".{c}" for c in components] or [""]
        # A set: a rod whose length an actuator changes can have the actuator's name.
        owners = [
            {rod.name} | ({robot.sites[d]} if d >= 0 else set()) for rod, d in zip(robot.rods, self.driver, strict=True)
        ]
        return np.array([[sum(self.geometry.off(f"{kind}[{o}]{e}") for o in own) for e in ends] for own in owners])

    @cached_property
    def size(self) -> float:
        """Largest length or coordinate, m, which determines rounding errors."""
        return max(self.robot.size, float(np.abs(self.C0).max()), float(self.L0.max()))

    # -------------------------------------------------------------------------------------------------- motion

    def ends(self, q: Floats) -> VirtualRodEnds:
        """The ends of the rods at commands q (N, n)."""
        robot = self.robot
        travel = np.where(self.driver >= 0, q[:, self.driver], 0.0) * self.scale
        C = self.C0 + (travel * ~self.extends)[..., None] * self.v
        for i, rod in enumerate(robot.rods):
            if rod.carrier is not None and robot.actuators[rod.carrier].revolute:
                origin = robot.actuators[rod.carrier].origin
                C[:, i] = origin + exp(travel[:, i, None] * self.v[i]) @ (self.C0[i] - origin)
        return VirtualRodEnds(self.P, C, self.L0 + travel * self.extends if self.extends.any() else self.L0[None])

    def predict(self, q: Floats) -> VirtualPoses:
        """Poses at commands q (N, n), base frame, on the assembly mode of home; NaN where the rods can't be closed."""
        q_home, home = self.robot.home_q, self.home
        T, R = np.tile(home.T, (len(q), 1)), np.tile(home.R, (len(q), 1, 1))
        for first in range(0, len(q), CHUNK):
            some = slice(first, first + CHUNK)

            def way(s: Floats, rows: Ints, part: Floats = q[some]) -> VirtualRodEnds:
                return self.ends(q_home + s[:, None] * (part[rows] - q_home))

            poses = led(way, VirtualPoses(T[some], R[some]), self.size)
            T[some], R[some] = poses.T, poses.R
        return VirtualPoses(T, R)

    @cached_property
    def home(self) -> VirtualPoses:
        """(1) pose at the home commands, on the assembly mode of the home pose in the URDF."""
        robot = self.robot
        nominal = Rods(Geometry(robot, (), np.zeros(0)))
        before, after = nominal.ends(robot.home_q[None]), self.ends(robot.home_q[None])

        def way(s: Floats, _: Ints) -> VirtualRodEnds:
            pairs = zip(vars(before).values(), vars(after).values(), strict=True)
            return VirtualRodEnds(*(a + s[0] * (b - a) for a, b in pairs))

        return led(way, _assembled(nominal, before), self.size)

    # --------------------------------------------------------------------------------------------- derivatives

    def command_jacobian(self, q: Floats, poses: VirtualPoses) -> Floats:
        """(N, 6, n) derivative of the pose by the commands: position and rotation vector, base frame."""
        return self.answer(q, poses, self.commanded(q))

    def commanded(self, q: Floats) -> list[tuple[VirtualRodEnds, VirtualRodEnds]]:
        """The ends with each command larger, and smaller, by ``NUDGE``."""
        return [(self.ends(q + step), self.ends(q - step)) for step in NUDGE * np.eye(q.shape[1])]

    def changed(self, q: Floats) -> list[tuple[VirtualRodEnds, VirtualRodEnds]]:
        """The ends with each parameter of the geometry larger, and smaller, by ``NUDGE``."""

        def ends(values: Floats) -> VirtualRodEnds:
            return Rods(self.geometry.with_values(values)).ends(q)

        values = self.geometry.values
        return [(ends(values + step), ends(values - step)) for step in NUDGE * np.eye(len(values))]

    def answer(self, q: Floats, poses: VirtualPoses, moved: list[tuple[VirtualRodEnds, VirtualRodEnds]]) -> Floats:
        """(N, 6, m) derivative of the pose by m numbers, from pairs of ends ``moved`` by +-``NUDGE`` of each number."""
        # Gaps as half the differences of squared lengths: the same at closed poses, and published cases were made with them.
        opened = [(one.squares(poses) - other.squares(poses)) / (2.0 * NUDGE) for one, other in moved]
        rods, arm = self.ends(q).rods(poses)
        by = np.concatenate([rods, np.cross(arm, rods)], axis=2)
        return np.asarray(-np.linalg.solve(by, np.stack(opened, axis=2)))


def _assembled(nominal: Rods, ends: VirtualRodEnds) -> VirtualPoses:
    """(1) closed pose at the home commands, near the home pose in the URDF, by damped Newton steps.

    Raises UnreachableError if there is none near it.
    """
    robot = nominal.robot
    told = robot.description.home
    frame = robot.tcp_placement
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.with_commands(robot.neutral, np.zeros(robot.n_actuators)))
    T, R = data.oMi[robot.tcp_joint].translation.copy(), data.oMi[robot.tcp_joint].rotation.copy()
    if told is not None:
        R = exp(told.tcp_rotvec) @ robot.home_placement.rotation.T
        T = np.array(told.tcp_xyz) - R @ robot.home_placement.translation
    pose = VirtualPoses((T + R @ frame.translation)[None], (R @ frame.rotation)[None])
    for _ in range(200):
        there, done = closed(pose, ends, nominal.size)
        if done[0]:
            return there
        gap = ends.gaps(pose)
        step = each_solved(by_pose(*ends.rods(pose)), -gap)[0]
        share = 1.0
        while share > 1e-3:
            trial = VirtualPoses(pose.T + share * step[:3], exp(share * step[3:]) @ pose.R)
            if np.abs(ends.gaps(trial)).max() < np.abs(gap).max():
                break
            share /= 2.0
        else:
            break
        pose = trial
    what = f"the rods of {robot.name} don't close near its home"
    raise UnreachableError(what, hint="give its URDF the pose at <home>")
