"""Trackers: the laser tracker of datasets of schema 1, and a camera that measures several targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import Gauge, Hidden
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.instruments.targets import Targets, labels
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import exp, log
from gtpin.bench.simulator.tracker import Noise
from gtpin.data.table import Column
from gtpin.typing import Floats, Ints

AWAY, CLEAR = 2.0, 0.8
"""Distance of a camera from the centre: the first number times the workspace's radius, plus the second, m."""
SIDEWAYS, ALONG = 3e-5, 1e-4
"""A camera's sigmas, m, at the workspace's centre, across and along the line of sight. They are proportional to the square of
the distance."""


@dataclass(frozen=True, eq=False)
class Tracker(Gauge):
    """z: the pose of the TCP in the instrument's frame.

    Parameters
    ----------
    sigmas
        (M, 6) noise, m and rad, or (M, 3) where only positions are measured.
    free
        Whether the instrument's frame is unknown: ``frame = "free"`` in the dataset.
    """

    kind: ClassVar[str] = "tracker"

    sigmas: Floats
    free: bool

    @staticmethod
    def drawn(poses: Poses, stops: Ints, noise: Noise, rng: np.random.Generator) -> Tracker:
        """A tracker that reads at all ``stops``, with ``poses`` (M), base frame, and with the noise of a tracker's dataset."""
        T, R = noise.elsewhere(rng) if noise.free else (np.zeros(3), np.eye(3))
        frame = (*T, *log(R))
        prior = np.inf if noise.free else 0.0
        hidden = tuple(
            Hidden(f"tracker.frame.{axis}", float(value), prior)
            for axis, value in zip(("x", "y", "z", "rx", "ry", "rz"), frame, strict=True)
        )
        distance = np.linalg.norm(poses.T - np.array(noise.station), axis=1)
        sigmas = np.tile(noise.sigma[: 6 if noise.orientations else 3], (len(stops), 1))
        sigmas[:, :3] *= np.maximum(1.0 + noise.by_range * (distance / distance.mean() - 1.0), 0.1)[:, None]
        return Tracker("tracker", stops, hidden, noise.declared, sigmas, noise.free)

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return self.sigmas

    def seen(self, poses: Poses, u: Floats) -> Poses:
        """(M) poses in the instrument's frame."""
        return poses.moved(u[:3], exp(u[3:]))

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`; orientations as rotation vectors. Use :meth:`change` for differences of orientations."""
        return self.change(poses, Poses(np.zeros_like(poses.T), np.tile(np.eye(3), (len(poses), 1, 1))), u, u)

    def change(self, one: Poses, other: Poses, u: Floats, v: Floats) -> Floats:
        """See :class:`Gauge`."""
        return self.seen(one, u).minus(self.seen(other, v))[:, : self.sigmas.shape[1]]

    def _stated(self) -> dict[str, Any]:
        if not self.declared:
            return {}
        middle = np.median(self.sigmas, axis=0)
        turns = {"orientation_sigma": float(middle[3])} if len(middle) == 6 else {}
        return {"position_sigma": float(middle[0]), **turns}

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        return {"frame": "free"} if self.free else {}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        seen = self.seen(poses, self.truth)
        turned = errors.shape[1] == 6
        read = Poses(seen.T + errors[:, :3], exp(errors[:, 3:]) @ seen.R if turned else seen.R)
        columns: dict[str, Column] = dict(zip("xyz", read.T.T, strict=True))
        return (
            {**columns, **dict(zip(("qw", "qx", "qy", "qz"), read.quaternions.T, strict=True))} if turned else columns
        )

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """See :class:`Gauge`."""
        return "stop", "sigmas"


@dataclass(frozen=True, eq=False)
class Camera(Gauge):
    """z: the position of a target in the camera's frame, whose z axis is the line of sight.

    Parameters
    ----------
    targets
        The targets as the dataset declares them.
    target
        (M,) index of each row's target.
    sigmas
        (M, 3) noise along the camera's axes, m: the table states it row by row.
    """

    kind: ClassVar[str] = "tracker"

    targets: Targets
    target: Ints
    sigmas: Floats

    @staticmethod
    def drawn(layout: Layout, poses: Poses, stops: Ints, declared: bool, rng: np.random.Generator) -> Camera:
        """A camera at the side of the workspace that measures three targets at all ``stops``, with ``poses`` (M), base
        frame."""
        name, targets = "camera", Targets.three()
        distance = AWAY * layout.radius + CLEAR
        place = np.array(layout.around(rng.uniform(-np.pi, np.pi), 0.3 * layout.radius, distance))
        sight = (layout.centre - place) / np.linalg.norm(layout.centre - place)
        level = np.cross(sight, layout.up) / np.linalg.norm(np.cross(sight, layout.up))
        R = exp(0.02 * rng.standard_normal(3)) @ np.vstack([level, np.cross(sight, level), sight])
        frame = zip(("x", "y", "z", "rx", "ry", "rz"), (*(-R @ place), *log(R)), strict=True)
        hidden = (
            *targets.drawn(name, rng),
            *(Hidden(f"{name}.frame.{axis}", float(value), np.inf) for axis, value in frame),
        )
        target = np.tile(np.arange(len(targets)), len(stops))
        far = (np.linalg.norm(poses.T - place, axis=1) / distance) ** 2
        sigmas = np.repeat(far, len(targets))[:, None] * np.array([SIDEWAYS, SIDEWAYS, ALONG])
        return Camera(name, np.repeat(stops, len(targets)), hidden, declared, targets, target, sigmas)

    @property
    def sigma(self) -> Floats:
        """See :class:`Gauge`."""
        return self.sigmas

    def readings(self, poses: Poses, u: Floats) -> Floats:
        """See :class:`Gauge`."""
        frame = u[3 * len(self.targets) :]
        return np.asarray(self.targets.positions(poses, u, self.target) @ exp(frame[3:]).T + frame[:3])

    def _stated(self) -> dict[str, Any]:
        return {}

    def table(self) -> dict[str, Any]:
        """See :class:`Gauge`."""
        return {**self.targets.table(), "frame": "free"}

    def columns(self, poses: Poses, errors: Floats) -> dict[str, Column]:
        """See :class:`Gauge`."""
        read = self.readings(poses, self.truth) + errors
        columns: dict[str, Column] = {"target": labels(self.targets.names, self.target)}
        columns |= dict(zip("xyz", read.T, strict=True))
        return columns | dict(zip(("sx", "sy", "sz"), self.sigmas.T, strict=True)) if self.declared else columns

    def ids(self) -> dict[str, tuple[str, ...]]:
        """See :class:`Gauge`."""
        return {"target": self.targets.names}

    @classmethod
    def by_row(cls) -> tuple[str, ...]:
        """See :class:`Gauge`."""
        return "stop", "target", "sigmas"
