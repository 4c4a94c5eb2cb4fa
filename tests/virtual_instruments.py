"""Instruments of the tests' own, which read the tests' own Gantry-Tau.

What each one reads is written down here a second time; nothing of gtpin's equations or kinematics is used.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from closures import Closures
from scipy.spatial.transform import Rotation
from virtual_gantry import GANTRY, ROBOT, RODS, commands

import gtpin

Floats = np.ndarray

WIRE, TOUCH, SEAT, LEVEL, LASER, SPARE = 2e-5, 1e-5, 2e-5, 5e-5, 1.5e-5, 2e-5
"""Usual sigmas, m and rad."""
CENTRE = GANTRY.poses(np.zeros((1, 3)))[0][0]
"""Where the TCP is at zero commands, m."""
TARGETS = {
    "A": (0.06, 0.0, 0.01),
    "B": (-0.03, 0.05, 0.02),
    "C": (-0.03, -0.05, 0.06),
    "D": (0.05, 0.08, -0.06),
}
"""Points on the platform, TCP frame, m."""


@dataclass(frozen=True)
class Seen:
    """What one instrument read, and the true values of its unknowns."""

    said: dict[str, Any]
    q: Floats
    columns: dict[str, Any]
    truth: dict[str, float] = field(default_factory=dict)
    prefix: str = "p"

    def table(self) -> str:
        columns = {"pose": [f"{self.prefix}{i}" for i in range(len(self.q))]}
        columns |= {f"q{i + 1}": self.q[:, i] for i in range(self.q.shape[1])} | self.columns
        rows = zip(*(map(str, column) for column in columns.values()), strict=True)
        return "\n".join([",".join(columns), *(",".join(row) for row in rows)])

    def saying(self, **said: Any) -> Seen:
        """The same readings under another description; None takes a key away."""
        return replace(self, said={key: value for key, value in (self.said | said).items() if value is not None})

    def reading(self, **columns: Any) -> Seen:
        """Other readings under the same description."""
        return replace(self, columns=self.columns | columns)


def read(folder: Path, *seen: Seen, robot: str = "gantry_tau") -> gtpin.Dataset:
    """The dataset of some instruments, as it is read from a folder."""
    folder.mkdir(exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    toml = {"schema": "gtpin-dataset/2", "robot": robot, "instrument": [one.said for one in seen]}
    (folder / "dataset.toml").write_text(tomli_w.dumps(toml))
    for one in seen:
        (folder / f"{one.said['name']}.csv").write_text(one.table())
    return gtpin.Dataset.read(folder)


def wire(
    machine: Closures,
    rng: np.random.Generator,
    count: int,
    *,
    sigma: float = WIRE,
    away: float = 0.05,
    offset: float = 0.0,
) -> Seen:
    """Ranges from four stations, each so far away (sigma per axis) from where it is declared."""
    declared = CENTRE + np.array([[2.0, 0.3, 0.5], [-1.5, 1.5, 0.2], [0.2, -2.0, 1.0], [0.3, 0.2, 2.2]])
    true = declared + rng.normal(0.0, away, (4, 3))
    offsets = rng.normal(0.0, offset, 4)
    q, of = commands(rng, count), rng.integers(0, 4, count)
    T, _ = machine.poses(q)
    ranges = np.sqrt(((T - true[of]) ** 2).sum(axis=1)) + offsets[of] + rng.normal(0.0, sigma, count)
    said = {"name": "wire", "kind": "range", "sigma": sigma, "station_sigma": away, "stations": named(declared)}
    truth = {f"wire.station[{name}].{x}": at[i] for name, at in named(true).items() for i, x in enumerate("xyz")}
    if offset:
        said["offset_sigma"] = offset
        truth |= {f"wire.offset[{name}]": float(value) for name, value in zip("ABCD", offsets, strict=True)}
    return Seen(said, q, {"station": ["ABCD"[i] for i in of], "range": ranges}, truth)


def bed(
    machine: Closures, rng: np.random.Generator, count: int, *, heights: bool = False, near: float | None = None
) -> Seen:
    """Touches of three planes by a tip; with ``heights``, a gauge reads how far the tip is over them instead.

    ``near``: m, about as far the tip is from the planes where a gauge reads; None: anywhere.
    """
    points = CENTRE + np.array([[0.0, 0.0, -0.1], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0]])
    normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [np.sin(0.35), 0.0, np.cos(0.35)]])
    tip, turn, height, sigma = np.array([0.02, -0.03, 0.05]), 1e-3, 3e-3, TOUCH
    shifts, tilts = rng.normal(0.0, height, 3), rng.normal(0.0, turn, (3, 2))
    true = np.array([tilted(n, tilt) for n, tilt in zip(normals, tilts, strict=True)])
    of = rng.integers(0, 3, count)

    def over(q: Floats) -> Floats:
        T, R = machine.poses(q)
        return ((T + R @ tip - points[of]) * true[of]).sum(axis=1) - shifts[of]

    q, noise = commands(rng, count), rng.normal(0.0, sigma, count)
    columns: dict[str, Any] = {"plane": ["PQR"[i] for i in of]}
    if not heights or near is not None:
        q = _moved(lambda q: (over(q) + noise)[:, None], 0.7 * q)
    if heights:
        q = q if near is None else q + rng.normal(0.0, near, q.shape)
        columns["height"] = over(q) + noise
    said = {
        "name": "bed",
        "kind": "plane",
        "sigma": sigma,
        "target": list(map(float, tip)),
        "plane_sigma": height,
        "normal_sigma": turn,
        "planes": {
            name: {"point": list(map(float, p)), "normal": list(map(float, n))}
            for name, p, n in zip("PQR", points, normals, strict=True)
        },
    }
    unknown = zip("PQR", shifts, *tilts.T, strict=True)
    truth = {
        f"bed.plane[{name}].{what}": float(value)
        for name, *values in unknown
        for what, value in zip(("height", "a", "b"), values, strict=True)
    }
    return Seen(said, q, columns, truth, "t")


def cup(machine: Closures, rng: np.random.Generator, count: int, *, sockets: int = 6) -> Seen:
    """Four targets seated in some sockets, of which the distances of two pairs are known."""
    points = CENTRE + rng.uniform(-1.0, 1.0, (sockets, 3)) * [0.2, 0.1, 0.1]
    targets = np.array(list(TARGETS.values()))
    of, ball = np.arange(count) % sockets, (np.arange(count) // sockets) % 4
    noise, distance = rng.normal(0.0, SEAT, (count, 3)), 5e-5

    def missed(q: Floats) -> Floats:
        T, R = machine.poses(q)
        return T + np.einsum("nij,nj->ni", R, targets[ball]) + noise - points[of]

    q = _moved(missed, np.zeros((count, 3)))
    known = [
        [f"S{a}", f"S{b}", float(np.linalg.norm(points[a] - points[b]) + rng.normal(0.0, distance)), distance]
        for a, b in ((0, 1), (2, 3))
    ]
    said = {"name": "cup", "kind": "socket", "sigma": SEAT, "distances": known}
    said["targets"] = {name: list(at) for name, at in TARGETS.items()}
    columns = {"socket": [f"S{i}" for i in of], "target": ["ABCD"[i] for i in ball]}
    truth = {f"cup.point[S{i}].{x}": float(at[k]) for i, at in enumerate(points) for k, x in enumerate("xyz")}
    return Seen(said, q, columns, truth, "s")


def level(machine: Closures, rng: np.random.Generator, count: int) -> Seen:
    """A tilt sensor: the vertical, seen in its frame."""
    sigma, mount = LEVEL, 5e-3
    turn = rng.normal(0.0, mount, 3)
    q = commands(rng, count)
    sensor = machine.poses(q)[1] @ Rotation.from_rotvec(turn).as_matrix()
    seen = sensor[:, 2, :2] + rng.normal(0.0, sigma, (count, 2))
    said = {"name": "level", "kind": "tilt", "sigma": sigma, "mount_sigma": mount}
    truth = {f"level.mount.r{x}": float(v) for x, v in zip("xyz", turn, strict=True)}
    return Seen(said, q, {"tilt_x": seen[:, 0], "tilt_y": seen[:, 1]}, truth, "l")


def spare(machine: Closures, rng: np.random.Generator, count: int, joint: str) -> Seen:
    """An encoder at a joint by which a rod hangs on the platform: the rod is along z, turned about y, then about x."""
    rod, turns = joint.removeprefix("link").split("_")
    i, rpy = RODS.index(rod), re.search(f'name="link{rod}_pitch".*?rpy="(.*?)"', ROBOT.description.xml, re.DOTALL)
    q = commands(rng, count)
    T, R = machine.poses(q)
    along = np.einsum("nji,nj->ni", R, machine.C(q)[:, i] - T) - machine.P[i]
    along = Rotation.from_euler("xyz", [float(v) for v in rpy[1].split()]).inv().apply(along)
    along /= np.linalg.norm(along, axis=1)[:, None]
    angle = np.arcsin(along[:, 0]) if turns == "yaw" else np.arctan2(-along[:, 1], along[:, 2])
    zero = 1e-2
    off = rng.normal(0.0, zero)
    said = {"name": joint, "kind": "encoder", "joint": joint, "sigma": SPARE, "zero_sigma": zero}
    return Seen(said, q, {"reading": angle + off + rng.normal(0.0, SPARE, count)}, {f"{joint}.zero": off}, joint)


def laser(machine: Closures, rng: np.random.Generator, count: int, *, sigma: float = LASER) -> Seen:
    """A tracker anywhere, which sees a target known in the TCP frame."""
    turn, at = Rotation.from_rotvec(rng.normal(0.0, 0.7, 3)), rng.uniform(-3.0, 3.0, 3)
    q = commands(rng, count)
    T, R = machine.poses(q)
    seen = turn.apply(T + R @ TARGETS["D"]) + at + rng.normal(0.0, sigma, (count, 3))
    said = {"name": "laser", "kind": "tracker", "position_sigma": sigma, "frame": "free", "target": list(TARGETS["D"])}
    truth = {f"laser.frame.{x}": float(v) for x, v in zip("xyz", at, strict=True)}
    truth |= {f"laser.frame.r{x}": float(v) for x, v in zip("xyz", turn.as_rotvec(), strict=True)}
    return Seen(said, q, dict(zip("xyz", seen.T, strict=True)), truth, "m")


def camera(machine: Closures, rng: np.random.Generator, count: int) -> Seen:
    """A tracker whose rows tell their own sigmas: along its line of sight, z, four times those across."""
    one = laser(machine, rng, count, sigma=0.0)
    sigma = rng.uniform(1.0, 4.0, (count, 1)) * np.array([2e-5, 2e-5, 8e-5])
    noise = rng.normal(0.0, 1.0, (count, 3)) * sigma
    seen = {x: one.columns[x] + noise[:, i] for i, x in enumerate("xyz")}
    said = {"name": "eye", "kind": "tracker", "frame": "free", "target": list(TARGETS["D"])}
    truth = {name.replace("laser", "eye"): value for name, value in one.truth.items()}
    return Seen(said, one.q, seen | dict(zip(("sx", "sy", "sz"), sigma.T, strict=True)), truth, "c")


def named(points: Floats) -> dict[str, list[float]]:
    return {name: list(map(float, at)) for name, at in zip("ABCD", points, strict=True)}


def tilted(n: Floats, tilt: Floats) -> Floats:
    """A normal turned by a about the base axis least aligned with it (less its part along it) and by b about n x a."""
    least = np.eye(3)[np.argmin(np.abs(n))]
    a = least - (least @ n) * n
    a /= np.sqrt(a @ a)
    return Rotation.from_rotvec(tilt[0] * a + tilt[1] * np.cross(n, a)).apply(n)


def _moved(missed: Callable[[Floats], Floats], q: Floats) -> Floats:
    """Commands (N, 3) moved as little as it takes until what is ``missed`` (N, k) is zero."""
    for number in range(20):
        at = missed(q)
        if np.abs(at).max() < 1e-12:
            return q
        if number < 3:
            J = np.stack([(missed(q + 1e-6 * way) - at) / 1e-6 for way in np.eye(3)], axis=2)
        q = q - (np.linalg.pinv(J) @ at[..., None])[..., 0]
    raise AssertionError("no commands bring it there")
