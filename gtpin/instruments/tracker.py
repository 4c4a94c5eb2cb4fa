"""Trackers: positions, and orientations, of a target in the instrument's frame."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gtpin.data.instrument_tables import TrackerTable
from gtpin.data.names import ORIENTATION, POSITION, SIGMAS
from gtpin.errors import DatasetError
from gtpin.instruments.frame_and_target import TURN, alignment, frame_and_target
from gtpin.instruments.instrument import Component, RowError, Unknown
from gtpin.instruments.targets import AXES, OfTargets, Targets, placed
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, from_quaternions, left_jacobian, log, skew
from gtpin.typing import Floats, Indices

TURNS = ("rx", "ry", "rz")
SHOWN = 10
"""Largest number of sessions that an error message lists."""


class Tracker(OfTargets):
    """Position F p + f of a target p, and where measured its orientation F R M, in the instrument's frame.

    p and R: the target's position and the platform's orientation, base frame. F and f: the base frame's orientation and origin
    in the instrument's frame. M: the target's orientation on the platform. Cameras and motion capture are trackers too.

    Unknown, in brackets the standard deviation of the prior: the targets' points on the platform (``target_sigma``). For
    ``target = "free"``: these points (0.3 m) and M (2 rad), so that what the poses do not determine of them stays as declared;
    otherwise M is the identity. For ``frame = "free"``: F and f, without a prior; with ``stations``, of each of them.
    """

    kind, Table = "tracker", TrackerTable
    table: TrackerTable

    def _unknowns(self) -> Sequence[Unknown]:
        positions = tuple(Component(axis, "m") for axis in AXES)
        self.turned = "qw" in self.read.numbers and bool(np.isfinite(self.read.numbers["qw"]).all())
        # Orientations are shown where nothing else tells of them: for a single tracker, which has no name.
        turns = tuple(Component(axis, "rad", group=1, initial_sigma=5e-5, shown=not self.table.name) for axis in TURNS)
        self.components = positions + (turns if self.turned else ())
        free_target = self.table.target == "free"
        self.targets = Targets(self.table, self.read, free=free_target)
        # A free target's orientation on the platform is free as well, where orientations are read.
        self._mounts = list(self.table.fixed_targets) if free_target and self.turned else []
        mounts = [
            Unknown(f"{self.table.name}.target{f'[{target}]' if target else ''}.{axis}", "rad", 0.0, TURN)
            for target in self._mounts
            for axis in TURNS
        ]
        stations = self._stations()
        self._n_frames = len(stations)
        frames = [
            Unknown(f"{self.table.name}.frame{station}.{axis}", "m" if axis in AXES else "rad", 0.0, np.inf)
            for station in stations
            for axis in (*AXES, *TURNS)
        ]
        return self._identified((*self.targets.unknowns, *mounts, *frames))

    def _stations(self) -> list[str]:
        """Places in the names of the free frames: ``[S1]``; sets ``of_frame``, (M,) the frame of each row."""
        self.of_frame: Indices = np.broadcast_to(np.intp(0), self.read.count)  # one number for all rows
        if self.table.stations is None:
            return [""] if self.table.frame == "free" else []
        names, sessions = self.read.known.get("session", ()), self.read.ids.get("session")
        hint = f"the fit had the sessions {', '.join(names[:SHOWN])}{', ...' if len(names) > SHOWN else ''}"
        if sessions is None:
            raise DatasetError("which station?", row=1, column="session", hint=f"add the column; {hint}")
        place = {name: i for i, name in enumerate(names)}
        for i, session in enumerate(sessions):
            if session not in place:
                raise RowError(i, f"no frame is known of a station in session {session}", "session", hint)
        self.of_frame = np.array([place[session] for session in sessions], dtype=np.intp)
        return [f"[{name}]" for name in names]

    @property
    def declared(self) -> tuple[float | None, ...]:
        """Declared sigma of the position, m, and of the orientation, rad, if that is measured; None: it is estimated."""
        both = (self.table.position_sigma or self.table.sigma, self.table.orientation_sigma)
        return both if self.turned else both[:1]

    @cached_property
    def positions(self) -> Floats:
        """(M, 3) what was read of the targets' positions, m."""
        return np.column_stack([self.read.numbers[name] for name in POSITION])

    @cached_property
    def rotations(self) -> Floats | None:
        """(M, 3, 3) what was read of their orientations; None where none was."""
        if not self.turned:
            return None
        return from_quaternions(np.column_stack([self.read.numbers[name] for name in ORIENTATION]))

    def row_sigmas(self) -> Floats | None:
        """(M, c) sigmas along the axes of the instrument's frame, m and rad, if the table has such columns; else None."""
        names = SIGMAS[: len(self.components)]
        if not all(name in self.read.numbers and np.isfinite(self.read.numbers[name]).all() for name in names):
            return None
        return np.column_stack([self.read.numbers[name] for name in names])

    def measured(self) -> Floats:
        """(M, c) measured positions, m, and zeros for the orientation: :meth:`predicted` has its residual."""
        return np.hstack([self.positions, np.zeros((len(self.positions), len(self.components) - 3))])

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        """(M, c) in the instrument's frame: position, m, and rotation vector, rad, from measured to predicted orientation."""
        found = self.measured() - self.residual_at(poses, u)
        found[:, :3] = self._read_at(poses, u).T
        return found

    def residual_at(self, poses: Poses, u: Floats) -> Floats:
        seen = self._read_at(poses, u)
        if self.rotations is None:
            return self.positions - seen.T
        return Poses(self.positions, self.rotations).minus(seen)

    def orientations(self, poses: Poses, u: Floats) -> Floats:
        """(M, 3, 3) orientations of the targets that would be read, instrument's frame."""
        return self._read_at(poses, u).R

    def _read_at(self, poses: Poses, u: Floats) -> Poses:
        """The poses of the targets in the instrument's frame."""
        t, mount, frames = self._split(u)
        R = poses.R @ exp(mount.reshape(-1, 3))[self.targets.of] if len(mount) else poses.R
        seen = Poses(self.targets.positions(poses, t), R)
        if not len(frames):
            return seen
        one = frames[self.of_frame] if len(frames) > 1 else frames[0]
        return seen.moved(one[..., :3], exp(one[..., 3:]))

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, 6) derivative, in the instrument's frame, by the TCP's position (m) and rotation vector (rad), base frame.

        For the orientation it is that at a residual of 0; residuals are small.
        """
        t, _, frames = self._split(u)
        F = self._turns(frames)
        moved = F @ self.targets.by_pose(poses, t)
        if not self.turned:
            return np.asarray(moved)
        turned = np.zeros((len(poses), 3, 6))
        turned[:, :, 3:] = F
        return np.concatenate([moved, turned], axis=1)

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        """(M, c, k) derivative by the targets, their orientations on the platform, and the frame; see :meth:`by_pose`."""
        t, mount, frames = self._split(u)
        F = self._turns(frames)
        found = np.zeros((len(poses), len(self.components), len(self._kept)))
        k = self.targets.count
        found[:, :3, :k] = F @ self.targets.by_unknown(poses)
        if len(mount):
            for i in range(len(self._mounts)):
                rows = self.targets.of == i
                own = slice(k + 3 * i, k + 3 * i + 3)
                found[rows, 3:, own] = F[rows] @ poses.R[rows] @ left_jacobian(mount[3 * i : 3 * i + 3])
        if len(frames):
            turned = left_jacobian(frames[:, 3:])[self.of_frame]
            moved = np.zeros((len(poses), len(self.components), 6))
            moved[:, :3, :3] = np.eye(3)
            moved[:, :3, 3:] = -skew(np.einsum("nij,nj->ni", F, self.targets.positions(poses, t))) @ turned
            if self.turned:
                moved[:, 3:, 3:] = turned
            found[:, :, -frames.size :] = placed(moved, self.of_frame, len(frames))
        return found[:, :, self._kept]

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess: free frames, and free targets, by fits of nominal and measured poses; all else 0."""
        u, k, count = np.zeros(len(self._kept)), self.targets.count, max(self._n_frames, 1)
        frames: list[tuple[Floats, Floats] | None] = [None if self._n_frames else (np.zeros(3), np.eye(3))] * count
        if self.table.target == "free":
            self._start_of_targets(nominal, u, frames)
        mounts = exp(u[k : k + 3 * len(self._mounts)].reshape(-1, 3))
        at = Poses(
            self.targets.positions(nominal, u[:k]), nominal.R @ mounts[self.targets.of] if self._mounts else nominal.R
        )
        for s in range(self._n_frames):
            rows, frame = self.of_frame == s, frames[s]
            if frame is None and rows.any():
                frame = alignment(
                    at[rows], self.positions[rows], None if self.rotations is None else self.rotations[rows]
                )
            if frame is not None:
                own = len(u) - 6 * (count - s)
                u[own : own + 3], u[own + 3 : own + 6] = frame[0], log(frame[1][None])[0]
        return u[self._kept]

    def _start_of_targets(self, nominal: Poses, u: Floats, frames: list[tuple[Floats, Floats] | None]) -> None:
        """Set the first guess of free targets in u, and that of the frames in which they are found.

        Each is found from the station with most of its rows; the one with most of all together with the frame of its station.
        """
        k, placed_targets = self.targets.count, set[int]()
        pairs = self.targets.of * len(frames) + self.of_frame
        for pair in np.argsort(-np.bincount(pairs, minlength=len(frames) * len(self.targets.declared)), kind="stable"):
            rows, (i, s) = pairs == pair, divmod(int(pair), len(frames))
            if i in placed_targets or not rows.any():
                continue
            shift, F = frames[s] or (np.zeros(3), np.eye(3))
            T = (self.positions[rows] - shift) @ F
            R = None if self.rotations is None else F.T @ self.rotations[rows]
            place = frame_and_target(nominal[rows], T, R, free_frame=frames[s] is None)
            frames[s] = frames[s] or (place.shift, place.turn)
            u[3 * i : 3 * i + 3] = place.at - self.targets.declared[i]
            if self._mounts:
                u[k + 3 * i : k + 3 * i + 3] = log(place.mount[None])[0]
            placed_targets.add(i)

    def _turns(self, frames: Floats) -> Floats:
        """(M, 3, 3) rotation of the base frame in the frame of each row."""
        return np.asarray((exp(frames[:, 3:]) if len(frames) else np.eye(3)[None])[self.of_frame])

    def _split(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """The parts of u: (3 n,) of n targets, (3 m,) of m mountings, and (K, 6) of the free frames: shift, rotation vector."""
        whole, k = self._whole(u), self.targets.count
        of_frames = len(whole) - 6 * self._n_frames
        return whole[:k], whole[k:of_frames], whole[of_frames:].reshape(-1, 6)
