"""Instruments that read at any pose: trackers, cameras, ranges, encoders, tilt sensors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gtpin.bench.simulator.instruments.gauge import (
    ONE,
    THREE,
    Gauge,
    Hidden,
    Layout,
    Place,
    Targeted,
    drawn_targets,
    hidden,
)
from gtpin.bench.simulator.poses import VirtualPoses, exp, log
from gtpin.bench.simulator.recipe import SimulatedNoise
from gtpin.data.table import Column
from gtpin.errors import GtpinError
from gtpin.typing import Floats, Ints

STATION_SIGMA = 0.5
"""Prior sigma of a station's position, per axis, m, that a dataset has by default."""
PIVOT_SIGMA = 5e-3
"""Standard deviation of the pivot's position, per axis, m: it is set up by the machine's coordinates."""
READING_SIGMA = 2e-5
"""Noise of an encoder's reading, rad or m, and of a tilt sensor's."""
ZERO_SIGMA, MOUNT_SIGMA = 1e-2, 1e-2
"""Standard deviations of an encoder's zero, rad or m, and of a tilt sensor's mounting, rad: a dataset's default priors."""
STEEP = 0.1
"""Smallest absolute third component of the unit vector that a tilt sensor measures. Below it the sensor does not read: the two
others then hardly depend on the tilt, and noise can make their squares sum to more than 1."""


@dataclass(frozen=True, eq=False)
class VirtualTracker(Gauge):
    """z: the pose of the TCP in the instrument's frame."""

    kind: ClassVar[str] = "tracker"

    free: bool  # Whether the instrument's frame is unknown: ``frame = "free"`` in the dataset

    @staticmethod
    def drawn(
        _: Layout, poses: VirtualPoses, stops: Ints, noise: SimulatedNoise, rng: np.random.Generator
    ) -> VirtualTracker:
        """A tracker with the noise of a tracker's dataset: of poses, or of positions alone."""
        T, R = noise.elsewhere(rng) if noise.free else (np.zeros(3), np.eye(3))
        frame = hidden("tracker.frame", (*T, *log(R)), np.inf if noise.free else 0.0)
        sigma = np.tile(noise.sigma[: 6 if noise.orientations else 3], (len(stops), 1))
        sigma[:, :3] *= noise.growth(poses.T)[:, None]
        return VirtualTracker("tracker", stops, tuple(frame), noise.declared, sigma, noise.free)

    def seen(self, poses: VirtualPoses, u: Floats) -> VirtualPoses:
        """(M) poses in the instrument's frame."""
        return poses.moved(u[:3], exp(u[3:]))

    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        """Orientations as rotation vectors. Use :meth:`change` for differences of orientations."""
        return self.change(poses, VirtualPoses(np.zeros_like(poses.T), np.tile(np.eye(3), (len(poses), 1, 1))), u, u)

    def change(self, one: VirtualPoses, other: VirtualPoses, u: Floats, v: Floats) -> Floats:
        return self.seen(one, u).minus(self.seen(other, v))[:, : self.sigma.shape[1]]

    def stated(self) -> dict[str, float]:
        middle = np.median(self.sigma, axis=0)
        turns = {"orientation_sigma": float(middle[3])} if len(middle) == 6 else {}
        return {"position_sigma": float(middle[0]), **turns}

    def table(self) -> dict[str, Any]:
        return {"frame": "free"} if self.free else {}

    def recorded(self, poses: VirtualPoses, errors: Floats) -> dict[str, Column]:
        seen = self.seen(poses, self.truth)
        position = dict(zip("xyz", (seen.T + errors[:, :3]).T, strict=True))
        if errors.shape[1] == 3:
            return {**position}
        turned = VirtualPoses(seen.T, exp(errors[:, 3:]) @ seen.R)
        return {**position, **dict(zip(("qw", "qx", "qy", "qz"), turned.quaternions.T, strict=True))}


@dataclass(frozen=True, eq=False)
class VirtualCamera(Targeted):
    """z: the position of a target in the camera's frame, whose z axis is the line of sight."""

    kind: ClassVar[str] = "tracker"
    reads = ("x", "y", "z")
    by_row: ClassVar[dict[str, str]] = {"target": "targets"}

    target: Ints  # (M,) index of each row's target

    @staticmethod
    def drawn(
        layout: Layout, poses: VirtualPoses, stops: Ints, noise: SimulatedNoise, rng: np.random.Generator
    ) -> VirtualCamera:
        """A camera at the side of the workspace that measures three targets; its table states the noise row by row."""
        distance = 2.0 * layout.radius + 0.8
        place = np.array(layout.around(rng.uniform(-np.pi, np.pi), 0.3 * layout.radius, distance))
        sight = (layout.centre - place) / np.linalg.norm(layout.centre - place)
        level = np.cross(sight, layout.up) / np.linalg.norm(np.cross(sight, layout.up))
        R = exp(0.02 * rng.standard_normal(3)) @ np.vstack([level, np.cross(sight, level), sight])
        frame = hidden("camera.frame", (*(-R @ place), *log(R)), np.inf)
        unknown = (*drawn_targets("camera", THREE, rng), *frame)
        far = (np.linalg.norm(poses.T - place, axis=1) / distance) ** 2
        # At the workspace's centre, across and along the line of sight, m.
        sigma = np.repeat(far, len(THREE))[:, None] * np.array([3e-5, 3e-5, 1e-4])
        target = np.tile(np.arange(len(THREE)), len(stops))
        return VirtualCamera("camera", np.repeat(stops, len(THREE)), unknown, noise.declared, sigma, THREE, target)

    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        frame = self.others(u)
        return np.asarray(self.positions(poses, u, self.target) @ exp(frame[3:]).T + frame[:3])

    def stated(self) -> dict[str, float]:
        return {}

    def table(self) -> dict[str, Any]:
        return {**super().table(), "frame": "free"}

    def recorded(self, poses: VirtualPoses, errors: Floats) -> dict[str, Column]:
        found = super().recorded(poses, errors)
        return found | dict(zip(("sx", "sy", "sz"), self.sigma.T, strict=True)) if self.declared else found


@dataclass(frozen=True, eq=False)
class VirtualRange(Targeted):
    """z = |p - s| + o, with target p, the station's centre s and its offset o, m."""

    kind: ClassVar[str] = "range"
    reads = ("range",)
    by_row: ClassVar[dict[str, str]] = {"station": "stations"}

    stations: dict[str, Place]  # The stations as the dataset declares them: positions, m, by id
    station: Ints  # (M,) index of each row's station
    priors: tuple[float, float]  # Prior sigmas of the stations' positions, per axis, and of the offsets, m

    @staticmethod
    def wires(
        layout: Layout, _: VirtualPoses, stops: Ints, noise: SimulatedNoise, rng: np.random.Generator
    ) -> VirtualRange:
        """Wires or laser tracers: four stations around the workspace, each of which reads at all stops."""
        away = 1.2 * layout.radius + 0.3
        stations = {}
        for i, letter in enumerate("ABCD"):
            stations[letter] = layout.around(np.pi / 4.0 + i * np.pi / 2.0, (-1.0) ** i * 0.4 * layout.radius, away)
        tape = float(np.exp(rng.uniform(*np.log((5e-3, 0.1)))))  # the stations are measured with a tape, m per axis
        priors = (STATION_SIGMA, 1e-3)
        return VirtualRange._of("wire", stops, stations, tape, 2e-5, priors, noise.declared, rng)

    @staticmethod
    def bar(layout: Layout, stops: Ints, declared: bool, rng: np.random.Generator) -> VirtualRange:
        """A ball bar from a pivot at the workspace's centre, which reads at all stops."""
        pivot, priors = {"pivot": layout.at(0.0, 0.0, 0.0)}, (PIVOT_SIGMA, 1e-4)
        return VirtualRange._of("ballbar", stops, pivot, PIVOT_SIGMA, 1e-6, priors, declared, rng)

    @staticmethod
    def _of(
        name: str,
        stops: Ints,
        stations: dict[str, Place],
        tape: float,
        sigma: float,
        priors: tuple[float, float],
        declared: bool,
        rng: np.random.Generator,
    ) -> VirtualRange:
        """Stations with random errors of standard deviation ``tape``, m, and readings with noise ``sigma``, m."""
        unknown = drawn_targets(name, ONE, rng)
        for one, place in stations.items():
            unknown += hidden(f"{name}.station[{one}]", place + tape * rng.standard_normal(3), priors[0])
        for one in stations:
            unknown.append(Hidden(f"{name}.offset[{one}]", priors[1] * rng.standard_normal(), priors[1]))
        stop, station = np.repeat(stops, len(stations)), np.tile(np.arange(len(stations)), len(stops))
        noise = np.full((len(stop), 1), sigma)
        return VirtualRange(name, stop, tuple(unknown), declared, noise, ONE, stations, station, priors)

    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        centres, offsets = np.split(self.others(u), [3 * len(self.stations)])
        away = np.linalg.norm(self.positions(poses, u) - centres.reshape(-1, 3)[self.station], axis=1)
        return np.asarray(away + offsets[self.station])[:, None]

    def table(self) -> dict[str, Any]:
        stations = {name: list(place) for name, place in self.stations.items()}
        stated = {} if self.priors[0] == STATION_SIGMA else {"station_sigma": self.priors[0]}
        return {**super().table(), "stations": stations, **stated, "offset_sigma": self.priors[1]}


@dataclass(frozen=True, eq=False)
class VirtualEncoder(Gauge):
    """z = x + zero, with x the coordinate of a passive ``joint``."""

    kind: ClassVar[str] = "encoder"
    reads = ("reading",)

    joint: str

    @staticmethod
    def drawn(
        _: Layout, poses: VirtualPoses, stops: Ints, noise: SimulatedNoise, rng: np.random.Generator
    ) -> VirtualEncoder:
        """An encoder at the first joint whose coordinates the poses have. Raises GtpinError if they have none."""
        if not poses.joints:
            hint = "the simulator has encoders at joints that follow: of loops, and of rods' universal joints"
            raise GtpinError("no joint of this machine can be read by an encoder", hint=hint)
        zero = Hidden("encoder.zero", ZERO_SIGMA * rng.standard_normal(), ZERO_SIGMA)
        sigma = np.full((len(stops), 1), READING_SIGMA)
        return VirtualEncoder("encoder", stops, (zero,), noise.declared, sigma, next(iter(poses.joints)))

    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        return np.asarray(poses.joints[self.joint] + u[0])[:, None]

    def by_pose(self, poses: VirtualPoses) -> Floats:
        return np.zeros((len(poses), 1, 6))

    def by_motion(self, poses: VirtualPoses) -> Floats:
        own = [float(name == self.joint) for name in poses.joints]
        return np.tile(np.concatenate([np.zeros(6), own]), (len(poses), 1, 1))

    def table(self) -> dict[str, Any]:
        return {"joint": self.joint}


@dataclass(frozen=True, eq=False)
class VirtualTilt(Gauge):
    """z: the first two components of R_s' up, with R_s = R exp(mount) and ``up`` (3,) the unit vector against gravity, base
    frame. The sensor's axes are the TCP's, rotated by its mounting.
    """

    kind: ClassVar[str] = "tilt"
    reads = ("tilt_x", "tilt_y")

    up: Floats

    @staticmethod
    def drawn(
        layout: Layout, poses: VirtualPoses, stops: Ints, noise: SimulatedNoise, rng: np.random.Generator
    ) -> VirtualTilt:
        """A sensor that reads at those of the ``stops`` at which its z axis is not too near horizontal.

        Raises GtpinError if there are fewer than two such stops.
        """
        level = np.abs(poses.R[:, :, 2] @ layout.up) >= STEEP
        if len(stops) < 2:
            raise GtpinError("one stop alone for a tilt sensor", hint="ask for two poses or more")
        if level.sum() < 2:
            hint = "turn its TCP frame so that z is nearly upright"
            raise GtpinError("a tilt sensor on this robot is never near level", hint=hint)
        mount = hidden("level.mount", MOUNT_SIGMA * rng.standard_normal(3), MOUNT_SIGMA, ("rx", "ry", "rz"))
        sigma = np.full((int(level.sum()), 2), READING_SIGMA)
        return VirtualTilt("level", stops[level], tuple(mount), noise.declared, sigma, layout.up)

    def readings(self, poses: VirtualPoses, u: Floats) -> Floats:
        return np.asarray((np.swapaxes(poses.R @ exp(u), 1, 2) @ self.up)[:, :2])


READERS: dict[str, Callable[[Layout, VirtualPoses, Ints, SimulatedNoise, np.random.Generator], Gauge]] = {
    "tracker": VirtualTracker.drawn,
    "camera": VirtualCamera.drawn,
    "range": VirtualRange.wires,
    "tilt": VirtualTilt.drawn,
    "encoder": VirtualEncoder.drawn,
}
"""Kinds of instruments that read at any pose, and how each is drawn: at stops (M,), with poses (M), base frame."""
