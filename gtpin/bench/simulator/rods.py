"""Kinematics of a platform on six rods, for many poses at once, from the numbers of its URDF."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.closing import RodEnds, by_pose, closed, each_solved, led
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import across, exp
from gtpin.errors import UnreachableError
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import Kind
from gtpin.typing import Floats

CHUNK = 4096
"""Largest number of poses that are solved together."""
NUDGE = 1e-5
"""Step of the central differences from which derivatives are computed, m or rad: small, as gaps have curvatures of about
1/m."""


@dataclass(frozen=True)
class Rods:
    """Kinematics of a platform on six rods.

    Parameters
    ----------
    geometry
        The true values of the geometry's parameters, with the meaning that docs/conventions.md gives them.
    """

    geometry: Geometry

    @cached_property
    def driver(self) -> npt.NDArray[np.int_]:
        """(k,) the actuator that moves a rod's joint on its carrier, or changes its length; -1 where none does."""
        found = [rod.carrier if rod.carrier is not None else rod.extension for rod in self.geometry.robot.rods]
        return np.array([-1 if actuator is None else actuator for actuator in found])

    @cached_property
    def is_leg(self) -> npt.NDArray[np.bool_]:
        """(k,) whether the actuator changes the rod's length."""
        return np.array([rod.extension is not None for rod in self.geometry.robot.rods])

    @cached_property
    def P(self) -> Floats:
        """(k, 3) joints on the platform, TCP frame, m."""
        return np.array([rod.P for rod in self.geometry.robot.rods]) + self._off("platform_joint", 3)

    @cached_property
    def C0(self) -> Floats:
        """(k, 3) joints on the carriers with all commands zero, base frame, m."""
        return np.array([rod.C for rod in self.geometry.robot.rods]) + self._off("carrier_joint", 3)

    @cached_property
    def L0(self) -> Floats:
        """(k,) lengths with all commands zero, m."""
        return np.array([rod.L for rod in self.geometry.robot.rods]) + self._off("length", 1)[:, 0]

    @cached_property
    def scale(self) -> Floats:
        """(k,) travel over command; no unit."""
        return np.asarray(1.0 + self._off("scale", 1)[:, 0])

    @cached_property
    def v(self) -> Floats:
        """(k, 3) directions of the carriers' tracks or axes, unit vectors, base frame; zero where nothing moves them."""
        robot, off = self.geometry.robot, self._off("direction", 3)
        axes = [None if rod.carrier is None else robot.actuators[rod.carrier].axis for rod in robot.rods]
        vectors = [np.zeros(3) if axis is None else off[i, :2] @ across(axis) for i, axis in enumerate(axes)]
        turns = exp(vectors)  # of all rods at once: derivatives by the geometry build many machines
        return np.array([np.zeros(3) if axis is None else turns[i] @ axis for i, axis in enumerate(axes)])

    def _off(self, kind: Kind, components: int) -> Floats:
        """(k, components) deviations of each rod: its own, and those that it shares with all rods of its actuator."""
        robot = self.geometry.robot
        own = self.geometry.deviations(kind, "rod", (len(robot.rods), components))
        shared = self.geometry.deviations(kind, "actuator", (robot.n_actuators, components))
        return np.asarray(own + np.where(self.driver[:, None] >= 0, shared[self.driver], 0.0))

    @cached_property
    def size(self) -> float:
        """Largest length or coordinate of the machine, m, which determines rounding errors."""
        return max(self.geometry.robot.size, float(np.abs(self.C0).max()), float(self.L0.max()))

    # -------------------------------------------------------------------------------------------------- motion

    def ends(self, q: Floats) -> RodEnds:
        """The ends of the rods at commands q (N, n)."""
        robot = self.geometry.robot
        travel = np.where(self.driver >= 0, q[:, self.driver], 0.0) * self.scale
        C = self.C0 + (travel * ~self.is_leg)[..., None] * self.v
        for i, rod in enumerate(robot.rods):
            if rod.carrier is not None and robot.actuators[rod.carrier].revolute:
                origin = robot.actuators[rod.carrier].origin
                C[:, i] = origin + exp(travel[:, i, None] * self.v[i]) @ (self.C0[i] - origin)
        return RodEnds(self.P, C, self.L0 + travel * self.is_leg if self.is_leg.any() else self.L0[None])

    def forward(self, q: Floats) -> Poses:
        """Poses at commands q (N, n), base frame, on the assembly mode of home; NaN where the rods can't be closed."""
        q_home, home = self.geometry.robot.home_q, self.home
        T, R = np.full((len(q), 3), np.nan), np.full((len(q), 3, 3), np.nan)
        for first in range(0, len(q), CHUNK):
            part = q[first : first + CHUNK]

            def way(s: Floats, rows: npt.NDArray[np.int_], part: Floats = part) -> RodEnds:
                return self.ends(q_home + s[:, None] * (part[rows] - q_home))

            start = Poses(np.tile(home.T, (len(part), 1)), np.tile(home.R, (len(part), 1, 1)))
            poses = led(way, start, self.size)
            T[first : first + CHUNK], R[first : first + CHUNK] = poses.T, poses.R
        return Poses(T, R)

    @cached_property
    def home(self) -> Poses:
        """(1) pose at the home commands, on the assembly mode of the home pose in the URDF."""
        robot = self.geometry.robot
        nominal = Rods(Geometry(robot, (), np.zeros(0)))
        before, after = nominal.ends(robot.home_q[None]), self.ends(robot.home_q[None])

        def way(s: Floats, _: npt.NDArray[np.int_]) -> RodEnds:
            return RodEnds(
                *(a + s[0] * (b - a) for a, b in zip(vars(before).values(), vars(after).values(), strict=True))
            )

        return led(way, _assembled(nominal, before), self.size)

    # --------------------------------------------------------------------------------------------- derivatives

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, n) derivative of the pose by the commands: position and rotation vector, base frame."""
        return self._answer(q, poses, self.commanded(q), NUDGE)

    def commanded(self, q: Floats) -> list[tuple[RodEnds, RodEnds]]:
        """The ends with each command larger, and smaller, by ``NUDGE``."""
        return [(self.ends(q + step), self.ends(q - step)) for step in NUDGE * np.eye(q.shape[1])]

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, p) derivative of the pose by the geometry's parameters: position and rotation vector, base frame."""
        return self._answer(q, poses, self.changed(q), NUDGE)

    def changed(self, q: Floats) -> list[tuple[RodEnds, RodEnds]]:
        """The ends with each parameter of the geometry larger, and smaller, by ``NUDGE``."""
        values = self.geometry.values
        steps = NUDGE * np.eye(len(values))
        return [(self._with(values + step).ends(q), self._with(values - step).ends(q)) for step in steps]

    def _with(self, values: Floats) -> Rods:
        return replace(self, geometry=self.geometry.with_values(values))

    def _answer(self, q: Floats, poses: Poses, moved: list[tuple[RodEnds, RodEnds]], nudge: float) -> Floats:
        """(N, 6, m) derivative of the pose by m numbers, from pairs of ends ``moved`` by +-``nudge`` of each number."""
        # Gaps as half the differences of squared lengths: the same at closed poses, and published cases were made with them.
        opened = [(one.squares(poses) - other.squares(poses)) / (2.0 * nudge) for one, other in moved]
        rods, arm = self.ends(q).rods(poses)
        by = np.concatenate([rods, np.cross(arm, rods)], axis=2)
        return np.asarray(-np.linalg.solve(by, np.stack(opened, axis=2)))


def _assembled(nominal: Rods, ends: RodEnds) -> Poses:
    """(1) closed pose at the home commands, near the home pose in the URDF, by damped Newton steps.

    Raises
    ------
    UnreachableError
        If there is none near it.
    """
    robot = nominal.geometry.robot
    told = robot.description.home
    frame = robot.tcp_placement
    T, R = robot.data.oMi[robot.tcp_joint].translation.copy(), robot.data.oMi[robot.tcp_joint].rotation.copy()
    if told is not None:
        R = exp(told.tcp_rotvec) @ robot.home_placement.rotation.T
        T = np.array(told.tcp_xyz) - R @ robot.home_placement.translation
    pose = Poses((T + R @ frame.translation)[None], (R @ frame.rotation)[None])
    for _ in range(200):
        there, done = closed(pose, ends, nominal.size)
        if done[0]:
            return there
        gap = ends.gaps(pose)
        step = each_solved(by_pose(*ends.rods(pose)), -gap)[0]
        share = 1.0
        while share > 1e-3:
            trial = Poses(pose.T + share * step[:3], exp(share * step[3:]) @ pose.R)
            if np.abs(ends.gaps(trial)).max() < np.abs(gap).max():
                break
            share /= 2.0
        else:
            break
        pose = trial
    raise UnreachableError(
        f"the rods of {robot.name} don't close near its home", hint="give its URDF the pose at <home>"
    )
