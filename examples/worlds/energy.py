"""Instruments, and the energy of an effect: the whitened displacement that geometry within its tolerance can't absorb."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mechanisms import Machine
from motion import Array, Motion, Poses, rotations, seen
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Tracker:
    """Positions and, with `orientation_sigma`, orientations; `free`: in a frame of its own, turned by `turn`."""

    station: tuple[float, float, float]
    position_sigma: float
    orientation_sigma: float | None
    free: bool
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    declared: bool = True  # the sigmas are told

    @property
    def unknowns(self) -> Array:
        return np.full(6 if self.free else 0, 1.0)

    def read(self, poses: Poses, motion: Motion, unknown: Array) -> Poses:
        p, R = seen(poses, motion, np.array(self.station))
        if len(unknown):
            F = rotations(unknown[3:])
            p, R = (p - self.station) @ F.T + self.station + unknown[:3], F @ R
        if self.free:
            Q = rotations(np.array(self.turn))
            p, R = (p - self.station) @ Q.T, Q @ R
        return p, R

    def whitened(self, value: Poses, reference: Poses) -> Array:
        parts = [(value[0] - reference[0]) / self.position_sigma]
        if self.orientation_sigma is not None:
            turned = Rotation.from_matrix(value[1] @ reference[1].transpose(0, 2, 1)).as_rotvec()
            parts.append(turned / self.orientation_sigma)
        return np.concatenate(parts, axis=1).ravel()


@dataclass(frozen=True)
class Ranges:
    """Distances from stations to the TCP; the stations' places are known to `station_sigma`."""

    stations: tuple[tuple[float, float, float], ...]
    sigma: float
    station_sigma: float = 5e-3

    @property
    def unknowns(self) -> Array:
        return np.full(3 * len(self.stations), self.station_sigma)

    def read(self, poses: Poses, motion: Motion, unknown: Array) -> Poses:
        """Distances (N, stations) in place of positions; the rotations are not read."""
        still = Motion(motion.drive, motion.body, motion.rod, motion.frame, motion.target, 0.0 * motion.scale)
        p, R = seen(poses, still, np.array(self.stations[0]))
        centres = np.array(self.stations) + (unknown.reshape(-1, 3) if len(unknown) else 0.0)
        return np.linalg.norm(p[:, None] - centres, axis=2) * (1.0 + motion.scale[:, None]), R

    def whitened(self, value: Poses, reference: Poses) -> Array:
        return ((value[0] - reference[0]) / self.sigma).ravel()


Instrument = Tracker | Ranges


class Absorption:
    """What geometry and the instrument's unknowns can absorb at the given commands, from finite differences."""

    def __init__(self, machine: Machine, instrument: Instrument, q: Array) -> None:
        self.machine, self.instrument, self.q = machine, instrument, q
        self.still = Motion.none(len(q), q.shape[1], len(machine.links))
        g = len(machine.tolerance)
        self.start = machine.poses(q, np.zeros(g), self.still)
        nothing = np.zeros(len(instrument.unknowns))
        self.reference = instrument.read(self.start, self.still, nothing)
        columns, step = [], 1e-6
        for k in range(g + len(nothing)):
            x = np.zeros(g + len(nothing))
            x[k] = step
            poses = machine.poses(q, x[:g], self.still, self.start) if k < g else self.start
            columns.append(instrument.whitened(instrument.read(poses, self.still, x[g:]), self.reference) / step)
        spread = np.concatenate([machine.tolerance, instrument.unknowns])
        J = np.array(columns).T * spread  # in units of the tolerances
        self.solve = np.linalg.inv(J.T @ J + np.eye(J.shape[1]))
        self.J = J

    def displacement(self, motion: Motion) -> Array:
        """Whitened readings with the motion less those without."""
        poses = self.machine.poses(self.q, np.zeros(len(self.machine.tolerance)), motion, self.start)
        nothing = np.zeros(len(self.instrument.unknowns))
        return self.instrument.whitened(self.instrument.read(poses, motion, nothing), self.reference)

    def energy(self, motion: Motion) -> float:
        """E = r^T (1 + J J^T)^-1 r: the squares left where each unknown may move within its tolerance."""
        r = self.displacement(motion)
        b = self.J.T @ r
        return float(r @ r - b @ self.solve @ b)

    def moved(self, motion: Motion) -> float:
        """How far the motion moves the TCP, m, rms."""
        poses = self.machine.poses(self.q, np.zeros(len(self.machine.tolerance)), motion, self.start)
        away = seen(poses, motion, np.array(self.machine.station))[0] - self.start[0]
        return float(np.sqrt((away**2).sum(1).mean()))

    def scaled(self, motion: Motion, energy: float, largest: float) -> tuple[Motion, float]:
        """The motion with a factor that gives it `energy`, but at most `largest` (m, rms) at the TCP; and its energy."""
        size = max(np.abs(getattr(motion, name)).max(initial=0.0) for name in motion.__dataclass_fields__)
        motion = motion.times(1e-5 / size)
        for _ in range(4):
            motion = motion.times(float(np.sqrt(energy / max(self.energy(motion), 1e-12))))
            rms = self.moved(motion)
            if not rms <= largest:
                motion = motion.times(largest / rms if np.isfinite(rms) else 1e-3)
        return motion, self.energy(motion)
