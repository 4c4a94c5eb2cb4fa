"""A five-bar of the tests' own, whose elbows have encoders: its loop, its manufacturing errors, its readings.

What a parameter means and how the loop closes is written down here a second time; nothing of gtpin's kinematics is used.
The loop is planar: play takes up what its gap has across the plane of the first far link.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import tomli_w
from scipy.spatial.transform import Rotation

import gtpin

Floats = np.ndarray

JOINTS = ("drive1", "elbow1", "drive2", "elbow2")
"""In the order of the URDF; each of the last three hangs on the base or on the one before it."""
ENDS = ("pin.left_far", "pin.right_far")
"""Where the far links meet, on each of them."""
XYZ = ((-0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (0.1, 0.0, 0.0), (0.2, 0.0, 0.0))
YAW = (2.2, -1.44, 0.94, 1.44)
FAR = 0.3
"""Length of the far links, m."""
TOLERANCE = 5e-4
"""1 sigma, m and rad: gtpin's where the URDF has none."""
SIGMA, ZERO = 2e-5, 1e-2
"""Of readings, and of the encoders' zeros, rad."""
NEAR = 0.6
"""Commands are within so much of zero, rad."""


def urdf(kind: str = "revolute") -> str:
    """The nominal five-bar, its elbows ``revolute`` or ``continuous``."""
    links = (("base", "left"), ("left", "left_far"), ("base", "right"), ("right", "right_far"))
    joints = "".join(
        f'<link name="{child}"/><joint name="{name}" type="{kind if "elbow" in name else "revolute"}">'
        f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{x} {y} {z}" rpy="0 0 {yaw}"/><axis xyz="0 0 1"/>'
        '<limit lower="-0.6" upper="0.6" effort="1" velocity="1"/></joint>'
        for name, (parent, child), (x, y, z), yaw in zip(JOINTS, links, XYZ, YAW, strict=True)
    )
    ends = "".join(f'<link{i} link="{side}_far" xyz="{FAR} 0 0"/>' for i, side in ((1, "left"), (2, "right")))
    own = '<actuator joint="drive1"/><actuator joint="drive2"/><platform link="left_far"/>'
    loop = f'<loop_joint name="pin">{ends}</loop_joint><gtpin>{own}</gtpin>'
    return f'<robot name="five_bar"><link name="base"/>{joints}{loop}</robot>'


@dataclass(frozen=True)
class FiveBar:
    """Joints off by twists (4, 6), m and rad, in their own placement frames: T -> T exp(twist); far ends off by (2, 3), m."""

    twists: Floats = field(default_factory=lambda: np.zeros((4, 6)))
    ends: Floats = field(default_factory=lambda: np.zeros((2, 3)))

    @staticmethod
    def off(deviations: Mapping[str, float]) -> FiveBar:
        twists = np.zeros((4, 6))
        for i, joint in enumerate(JOINTS):
            for c, axis in enumerate(("x", "y", "z", "rx", "ry", "rz")):
                twists[i, c] = deviations.get(f"placement[{joint}].{axis}", 0.0)
        ends = [[deviations.get(f"anchor[{end}].{axis}", 0.0) for axis in "xyz"] for end in ENDS]
        return FiveBar(twists, np.array(ends))

    def elbows(self, q: Floats) -> Floats:
        """(N, 2) coordinates of the two elbows at commands (N, 2), by Newton's method from zero."""
        x = np.zeros((len(q), 2))
        for s in np.linspace(0.0, 1.0, 9):  # from zero, step by step, so that the elbows stay on their sides
            for _ in range(12):
                gap, step = self._gap(s * q, x), 1e-7
                slope = np.stack(
                    [(self._gap(s * q, x + h) - self._gap(s * q, x - h)) / (2.0 * step) for h in step * np.eye(2)]
                )
                x = x - np.linalg.solve(np.moveaxis(slope, 0, 2), gap[..., None])[..., 0]
        assert np.abs(self._gap(q, x)).max() < 1e-14
        return x

    def tip(self, q: Floats) -> Floats:
        """(N, 3) origin of the first far link, which carries the platform's frame, m."""
        return self._frame(q, self.elbows(q), 0)[1]

    def _gap(self, q: Floats, x: Floats) -> Floats:
        """(N, 2) from the end of the first far link to that of the second, in the plane of the first, m."""
        (R, p), (S, r) = (self._frame(q, x, side) for side in (0, 1))
        first, second = self.ends + np.array([FAR, 0.0, 0.0])
        between = r + S @ second - p - R @ first
        return np.einsum("nji,nj->ni", R, between)[:, :2]

    def _frame(self, q: Floats, x: Floats, side: int) -> tuple[Floats, Floats]:
        """Rotation and origin of a side's far link."""
        R, p = np.eye(3)[None], np.zeros((1, 3))
        for joint, angle in ((2 * side, q[:, side]), (2 * side + 1, x[:, side])):
            turn, shift = _exp(self.twists[joint])
            own = Rotation.from_euler("z", YAW[joint]).as_matrix()
            p = p + R @ (np.array(XYZ[joint]) + own @ shift)
            R = R @ (own @ turn) @ Rotation.from_euler("z", angle[:, None]).as_matrix()
        return R, p


def _exp(twist: Floats) -> tuple[Floats, Floats]:
    """Rotation and shift of a motion along a constant twist: shift = (I + ...) v, by its series."""
    v, w = twist[:3], twist[3:]
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    series, term = np.eye(3), np.eye(3)
    for k in range(2, 12):
        term = term @ W / k
        series = series + term
    return Rotation.from_rotvec(w).as_matrix(), series @ v


def drawn(rng: np.random.Generator) -> dict[str, float]:
    """Deviations of all placements and of the far links' ends, as the tolerances have them."""
    names = [f"placement[{joint}].{axis}" for joint in JOINTS for axis in ("x", "y", "z", "rx", "ry", "rz")]
    names += [f"anchor[{end}].{axis}" for end in ENDS for axis in "xyz"]
    return {name: float(rng.normal(0.0, TOLERANCE)) for name in names}


def commands(rng: np.random.Generator, count: int, near: float = NEAR) -> Floats:
    return rng.uniform(-near, near, (count, 2))


def encoder(name: str, **said: object) -> dict[str, object]:
    """An ``[[instrument]]``, at the joint of its name; None takes a key away."""
    found = {"name": name, "kind": "encoder", "joint": name, "sigma": SIGMA, **said}
    return {key: value for key, value in found.items() if value is not None}


def table(q: Floats, **columns: object) -> str:
    """A table with commands (N, 2)."""
    whole = {"pose": [f"p{i}" for i in range(len(q))], "q1": q[:, 0], "q2": q[:, 1], **columns}
    rows = zip(*(map(str, column) for column in whole.values()), strict=True)
    return "\n".join([",".join(whole), *(",".join(row) for row in rows)])


def written(
    folder: Path, said: list[dict[str, object]], tables: Mapping[str, str], kind: str = "revolute", **head: object
) -> Path:
    """A dataset's folder, with its robot."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "five_bar.urdf").write_text(urdf(kind))
    toml = {"schema": "gtpin-dataset/2", "robot": "five_bar.urdf", **head, "instrument": said}
    (folder / "dataset.toml").write_text(tomli_w.dumps(toml))
    for name, text in tables.items():
        (folder / f"{name}.csv").write_text(text)
    return folder


@dataclass(frozen=True)
class Measured:
    """A drawn five-bar, its deviations and the zeros of its two encoders, and what these read."""

    deviations: dict[str, float]
    dataset: gtpin.Dataset


def measured(folder: Path, rng: np.random.Generator, count: int = 60, **said: object) -> Measured:
    """A machine whose two encoders are read at the same stops."""
    deviations, q = drawn(rng), commands(rng, count)
    x = FiveBar.off(deviations).elbows(q)
    zeros = {joint: float(rng.normal(0.0, ZERO)) for joint in ("elbow1", "elbow2")}
    readings = {
        joint: x[:, i] + zeros[joint] + rng.normal(0.0, SIGMA, count) for i, joint in enumerate(("elbow1", "elbow2"))
    }
    tables = {joint: table(q, reading=values) for joint, values in readings.items()}
    path = written(folder, [encoder(joint, **said) for joint in readings], tables)
    return Measured(deviations | {f"{joint}.zero": value for joint, value in zeros.items()}, gtpin.Dataset.read(path))
