"""Forward kinematics and derivatives of a robot with rods, for many poses at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from gtpin.errors import ModelError
from gtpin.kinematics.closures import FirstGuess, RodEnds, between, follow, newton, pose_jacobian, rod_vectors
from gtpin.kinematics.poses import Poses, chunks
from gtpin.kinematics.posture import home
from gtpin.kinematics.protocol import Bodies, SmallError
from gtpin.kinematics.rod_geometry import PARAMETERS, RodGeometry, rod_step
from gtpin.kinematics.rod_joints import RodJoint, direction, motion
from gtpin.kinematics.statics import rod_forces
from gtpin.robot.export import to_urdf
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

MANY = 2000
"""Number of poses from which a fitted first guess saves time."""


@dataclass(frozen=True)
class RodKinematics(RodGeometry):
    """The closures of one geometry (Dressler et al. 2010, eqs. 2 and 5) of k rods, in arrays.

    It is a :class:`~gtpin.kinematics.protocol.Kinematics`, held to Pinocchio's results by tests.
    """

    def forward(self, q: Floats, start: Poses | None = None) -> Poses:
        """Poses on the assembly mode of home. ``start``: poses of a similar geometry at the same commands.

        Raises `ModelError` if ``q`` is not (N, n).
        """
        self.geometry.robot.check_commands(q)
        near = start if start is not None and start.reached.all() else None
        guess = self._first_guess if near is None and len(q) >= MANY else None
        T, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        for rows in chunks(len(q)):
            if near is not None:
                part = self._from_neighbours(q[rows], near[rows])
            elif guess is not None:
                part = self._from_guess(q[rows], guess)
            else:
                part = self._from_home(q[rows])
            T[rows], R[rows] = part.T, part.R
        return self.with_joints(Poses(T, R), q)

    def with_joints(self, poses: Poses, q: Floats, moved: Floats | None = None) -> Poses:
        """The poses (N) with the coordinates of the robot's measured joints at commands q (N, n).

        ``moved`` (N, k, 3): the rods' joints on their carriers, base frame, m, where they are not those of the commands.
        """
        if not self._measured:
            return poses
        C = self.ends(q).C if moved is None else moved
        some = poses.reached
        joints = {one.joint.name: np.full(len(q), np.nan) for one in self._measured}
        for one in self._measured:
            joints[one.joint.name][some] = one.coordinate(direction(one, poses[some], self.P, C[some]))
        return Poses(poses.T, poses.R, joints)

    def joint_motion(self, q: Floats, poses: Poses, moved: Floats, carrier_joints: Floats | None) -> Floats:
        """(N, j, m) motion of the measured joints by a motion (N, 6, m) of the platform and, (N, k, 3, m), of the rods' joints
        on their carriers, base frame.
        """
        found = np.zeros((len(q), len(self._measured), moved.shape[2]))
        for row, one in enumerate(self._measured):
            dC = np.zeros((len(q), 3, 1)) if carrier_joints is None else carrier_joints[:, one.rod]
            found[:, row] = motion(one, poses, self.P, self.ends(q).C, moved, dC, np.zeros((3, 1)))
        return found

    def _from_neighbours(self, q: Floats, near: Poses) -> Poses:
        before, after = self._ends_that_close(near, q), self.ends(q)
        return follow(lambda s, rows: between(before, after, s, rows), near, self.size)

    def _from_home(self, q: Floats) -> Poses:
        q_home = self.geometry.robot.home_q
        T, R = self.home.T[0], self.home.R[0]
        begin = Poses(np.tile(T, (len(q), 1)), np.tile(R, (len(q), 1, 1)))
        return follow(lambda s, rows: self.ends(q_home + s[:, None] * (q[rows] - q_home)), begin, self.size)

    def _from_guess(self, q: Floats, first_guess: FirstGuess) -> Poses:
        guess = first_guess(q)
        poses, closed = newton(guess, self.ends(q), self.size)
        # A guess that was farther off than at the nodes of the fit says nothing about the assembly mode.
        trusted = closed & (np.abs(poses.T - guess.T).max(axis=1) <= 10.0 * first_guess.error + 1e-9)
        if not trusted.all():
            again = self._from_home(q[~trusted])
            poses.T[~trusted], poses.R[~trusted] = again.T, again.R
        return poses

    @cached_property
    def _first_guess(self) -> FirstGuess | None:
        robot = self.geometry.robot
        return FirstGuess.fit(robot.lower, robot.upper, self._from_home, self.home.R[0])

    @cached_property
    def home(self) -> Poses:
        robot = self.geometry.robot
        posture = home(robot)
        nominal = RodGeometry(Geometry(robot, (), np.zeros(0)))
        q = robot.home_q[None, :]
        before, after = nominal.ends(q), self.ends(q)
        start = Poses(posture.T[None, :].copy(), posture.R[None, :, :].copy())
        return self.with_joints(follow(lambda s, rows: between(before, after, s, rows), start, self.size), q)

    def displaced(
        self, q: Floats, plain: Poses, commands: Floats, twists: Mapping[int, Floats], lengths: Floats
    ) -> Poses:
        ends = self.ends(commands)
        C = ends.C.copy()
        for i, twist in twists.items():
            C[:, i] += twist[:, :3]
        before, after = self.ends(q), RodEnds(ends.P, C, ends.L + lengths)
        poses = follow(lambda s, rows: between(before, after, s, rows), plain, self.size)
        return self.with_joints(poses, commands, C)

    def bodies(self, q: Floats, poses: Poses) -> Bodies:
        ends = self.ends(q)
        d, _ = rod_vectors(poses, ends)
        along = d / np.linalg.norm(d, axis=2)[..., None]
        moved = self._by_length(q, poses)[:, :, :, None] * along[:, None]
        if self._measured:
            joints = np.zeros((len(q), len(self._measured), self._k, 3))
            for i in range(self._k):
                dC = np.zeros((len(q), self._k, 3, 3))
                dC[:, i] = np.eye(3)
                joints[:, :, i] = self.joint_motion(q, poses, moved[:, :, i], dC)
            moved = np.concatenate([moved, joints], axis=1)
        return Bodies(moved, np.broadcast_to(np.eye(3), (*d.shape[:2], 3, 3)), ends.C)

    def carried(self, actuator: int) -> tuple[int, ...]:
        """Indices of the rods whose joints move with an actuator's carrier."""
        return tuple(i for i, rod in enumerate(self._rods) if rod.carrier == actuator)

    def axis(self, actuator: int) -> Floats:
        """(3,) unit vector of a track or axis, base frame."""
        return np.asarray(self.geometry.robot.actuators[actuator].axis)

    def loads(self, q: Floats, poses: Poses, force: Floats | None = None, payload: Floats | None = None) -> Floats:
        """(N, k, 6) force, N, and no moment, of each rod on the joint on its carrier, base frame."""
        d, _ = self.rod_vectors(q, poses)
        pulled = self.rod_forces(q, poses, force, payload) / np.linalg.norm(d, axis=2)
        return np.concatenate([pulled[..., None] * d, np.zeros_like(d)], axis=2)

    def rod_vectors(self, q: Floats, poses: Poses) -> tuple[Floats, Floats]:
        return rod_vectors(poses, self.ends(q))

    def rod_forces(self, q: Floats, poses: Poses, force: Floats | None, payload: Floats | None) -> Floats:
        return rod_forces(self, q, poses, force, payload)

    def length_response(self, q: Floats, poses: Poses) -> Floats:
        moved = self._by_length(q, poses)
        return np.concatenate([moved, self.joint_motion(q, poses, moved, None)], axis=1) if self._measured else moved

    def _by_length(self, q: Floats, poses: Poses) -> Floats:
        d, RP = rod_vectors(poses, self.ends(q))
        return np.asarray(np.linalg.inv(pose_jacobian(d, RP)) * np.linalg.norm(d, axis=2)[:, None, :])

    def singularity(self, q: Floats, poses: Poses) -> tuple[Floats, str]:
        """(N,) smallest singular value of the closures' Jacobian, relative to that at home.

        A row of the Jacobian is the rod's unit vector u and (r x u) / l, with r the vector from the mean of the joints on the
        platform to the rod's joint, and l the root mean square length of all r: the result does not depend on the TCP.
        """
        at_home = self._smallest(self.geometry.robot.home_q[None], self.home)
        return self._smallest(q, poses) / at_home, "home"

    def _smallest(self, q: Floats, poses: Poses) -> Floats:
        d, RP = rod_vectors(poses, self.ends(q))
        arm = RP - RP.mean(axis=1, keepdims=True)
        size = np.sqrt((arm**2).sum(axis=2).mean(axis=1))
        u = d / np.linalg.norm(d, axis=2)[..., None]
        rows = np.concatenate([u, np.cross(arm, u) / size[:, None, None]], axis=2)
        return np.asarray(np.linalg.svd(rows, compute_uv=False), dtype=np.float64)[:, -1]

    def small_errors(self, q: Floats, poses: Poses) -> Iterator[SmallError]:
        """Errors of the length, the joints and the track of each rod: :data:`~gtpin.kinematics.rod_geometry.PARAMETERS`."""
        ends = self.ends(q)
        d, RP = rod_vectors(poses, ends)
        response = np.linalg.inv(pose_jacobian(d, RP))
        for parameter in PARAMETERS:
            for i, rod in enumerate(self._rods):
                change = rod_step(self, q, parameter, i)
                if change is not None:
                    rate = -response[:, :, i] * change.slope(d[:, i], ends, poses)[:, None]
                    size = self.geometry.robot.size
                    after = partial(change.poses_after, ends=ends, poses=poses, size=size)
                    yield SmallError(parameter, rod.name, rate, after)

    def urdf(self) -> str:
        """See :func:`~gtpin.robot.export.to_urdf`; raises `ModelError` if the loops don't close at home."""
        if not self.home.reached.all():
            name = self.geometry.robot.name
            raise ModelError(f"the loops of {name} don't close at home", hint="check the geometry's values")
        return to_urdf(self.geometry, self.P, self.C0, self.L0, self.v, (self.home.T[0], self.home.R[0]))

    def pose_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, k, 6) derivative of the closures (|d|^2 - L^2) / 2 by the TCP's pose, base frame."""
        return pose_jacobian(*rod_vectors(poses, self.ends(q)))

    def command_jacobian(self, q: Floats, poses: Poses, at: Bodies | None = None) -> Floats:
        jacobian = np.empty((len(q), 6, q.shape[1]))
        for rows in chunks(len(q)):
            jacobian[rows] = self._by_commands(q[rows], poses[rows])
        if not self._measured:
            return jacobian
        travel, dC = self._travel(q), np.zeros((len(q), self._k, 3, q.shape[1]))
        for i, seat in enumerate(self.seats):
            if self._driver[i] >= 0 and not self._extends[i]:
                dC[:, i, :, self._driver[i]] = self.scale[i] * seat.by_travel(travel[:, i])
        return np.concatenate([jacobian, self.joint_motion(q, poses, jacobian, dC)], axis=1)

    def _by_commands(self, q: Floats, poses: Poses) -> Floats:
        ends = self.ends(q)
        d, RP = rod_vectors(poses, ends)
        gradient = np.zeros((len(q), self._k, q.shape[1]))
        rate = self.scale * self._by_travel(ends, d, self._travel(q))
        for i, actuator in enumerate(self._driver):
            if actuator >= 0:
                gradient[:, i, actuator] = rate[:, i]
        return np.asarray(-np.linalg.solve(pose_jacobian(d, RP), gradient), dtype=np.float64)

    def geometry_jacobian(self, q: Floats, poses: Poses) -> Floats:
        if not self.geometry.parameters:
            return np.zeros((len(q), 6 + len(self._measured), 0))
        ends = self.ends(q)
        d, RP = rod_vectors(poses, ends)
        slots = self._slots
        gradient = self._gradient(q, poses, ends, d, slots)
        # A parameter changes the closures of its own rods only. Its derivative is a sum over these rods: the response of the
        # pose to the rod's closure, times the derivative of the closure by the parameter.
        response = -np.linalg.inv(pose_jacobian(d, RP))
        columns, rods = np.array(slots).T
        first = np.flatnonzero(np.diff(columns, prepend=-1))
        jacobian = response[:, :, rods[first]]
        jacobian *= gradient[:, None, first]
        for slot in np.flatnonzero(np.diff(columns, prepend=-1) == 0):
            jacobian[:, :, columns[slot]] += response[:, :, rods[slot]] * gradient[:, slot, None]
        moved: Floats = np.asarray(jacobian)
        if not self._measured:
            return moved
        return np.concatenate([moved, self._joints_by_geometry(q, poses, ends, moved)], axis=1)

    def _joints_by_geometry(self, q: Floats, poses: Poses, ends: RodEnds, moved: Floats) -> Floats:
        """(N, j, p) derivative of the measured joints by the parameters; ``moved``: that of the platform's pose, (N, 6, p)."""
        found = np.empty((len(q), len(self._measured), moved.shape[2]))
        for row, one in enumerate(self._measured):
            i, dC, dP = one.rod, np.zeros((len(q), 3, moved.shape[2])), np.zeros((3, moved.shape[2]))
            seat, travel = self.seats[i], self._travel(q)[:, i]
            for column in (column for column, rod in self._slots if rod == i):
                parameter = self.geometry.parameters[column]
                c = parameter.component
                if parameter.kind == "platform_joint":
                    dP[c, column] = 1.0
                elif parameter.kind == "carrier_joint":
                    dC[:, :, column] = seat.by_joint(travel, c)
                elif parameter.kind == "direction":
                    dC[:, :, column] = seat.by_turn(travel, c)
                elif parameter.kind == "scale" and not self._extends[i]:
                    dC[:, :, column] = seat.by_travel(travel) * q[:, self._driver[i], None]
            found[:, row] = motion(one, poses, self.P, ends.C, moved, dC, dP)
        return found

    @cached_property
    def _slots(self) -> list[tuple[int, int]]:
        """Pairs of indices: a parameter, and a rod whose closure it changes."""
        parameters = self.geometry.parameters
        return [(column, i) for column, p in enumerate(parameters) for i in self._owned(p.per, p.kind, p.owner)]

    def _gradient(self, q: Floats, poses: Poses, ends: RodEnds, d: Floats, slots: list[tuple[int, int]]) -> Floats:
        """(N, s) derivative of one rod's closure by one parameter, for the s pairs of parameter and rod in ``slots``."""
        travel = self._travel(q)
        by_travel = self._by_travel(ends, d, travel)
        along = d @ poses.R  # the rods in the TCP frame
        gradient = np.empty((len(q), len(slots)))
        for slot, (column, i) in enumerate(slots):
            parameter = self.geometry.parameters[column]
            c = parameter.component
            if parameter.kind == "length":
                gradient[:, slot] = -ends.L[:, i]
            elif parameter.kind == "platform_joint":
                gradient[:, slot] = along[:, i, c]
            elif parameter.kind == "carrier_joint":
                gradient[:, slot] = -np.einsum("ni,ni->n", d[:, i], self.seats[i].by_joint(travel[:, i], c))
            elif parameter.kind == "direction":
                gradient[:, slot] = -np.einsum("ni,ni->n", d[:, i], self.seats[i].by_turn(travel[:, i], c))
            else:
                gradient[:, slot] = by_travel[:, i] * q[:, self._driver[i]]
        return gradient

    @cached_property
    def _measured(self) -> tuple[RodJoint, ...]:
        return tuple(RodJoint.of(self.geometry.robot, joint) for joint in self.geometry.robot.measured_joints)

    def _ends_that_close(self, poses: Poses, q: Floats) -> RodEnds:
        """Rods of this geometry, with the lengths at which their closures hold at ``poses``."""
        ends = self.ends(q)
        d, _ = rod_vectors(poses, ends)
        return RodEnds(ends.P, ends.C, np.linalg.norm(d, axis=2))
