"""Readings of a nominal machine whose errors are known: ranges along circles, and a wire, a cup and a level."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

import gtpin
from gtpin.data import Dataset
from gtpin.instruments.readings import Readings, single
from gtpin.report.residuals import Residuals

NOMINAL = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
MIDDLE = NOMINAL.kinematics.forward(NOMINAL.robot.home_q[None]).T[0]
RADIUS = 0.12
PLANES = {"XY": (0, 1), "YZ": (1, 2), "ZX": (2, 0)}
STATION, TARGET = np.array([-0.5, -3.5, 0.4]), np.array([0.02, -0.03, 0.05])
S1, S2 = np.array([-1.3, -4.3, 0.0]), np.array([-1.2, -4.3, 0.0])
DECLARED = f"""schema = "gtpin-dataset/2"
robot = "gantry_tau"
[[instrument]]
name = "wire"
kind = "range"
sigma = 2e-5
target = {TARGET.tolist()}
stations = {{A = {STATION.tolist()}}}
[[instrument]]
name = "cup"
kind = "socket"
sigma = 2e-5
sockets = {{S1 = {S1.tolist()}, S2 = {S2.tolist()}}}
socket_sigma = 1e-3
distances = [["S1", "S2", 0.1001, 5e-5]]
[[instrument]]
name = "level"
kind = "tilt"
sigma = 2e-5
"""


def write_table(file: Path, head: str, rows: Iterable[Iterable[object]]) -> None:
    file.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")


def left_by_nominal(dataset: Dataset, sigma: float) -> Residuals:
    """What the nominal model leaves of readings."""
    readings = Readings.of(dataset, NOMINAL.robot)
    residual = readings.residual_at(NOMINAL.kinematics.forward(dataset.q))
    return Residuals(
        dataset, len(dataset), NOMINAL, NOMINAL, residual, residual, np.full_like(residual, sigma), readings
    )


def way(plane: str, angle: np.ndarray) -> np.ndarray:
    """(N, 3) places along a circle about the middle, at angles from the plane's first axis to its second."""
    first, second = PLANES[plane]
    T = np.tile(MIDDLE, (len(angle), 1))
    T[:, first] += RADIUS * np.cos(angle)
    T[:, second] += RADIUS * np.sin(angle)
    return T


def commands_to(T: np.ndarray) -> np.ndarray:
    """(N, 3) commands that bring the nominal TCP to places (N, 3), by Newton's method."""
    q = np.tile(NOMINAL.robot.home_q, (len(T), 1))
    for _ in range(30):
        poses = NOMINAL.kinematics.forward(q)
        J = NOMINAL.kinematics.command_jacobian(q, poses)[:, :3]
        q = q + np.linalg.solve(J, (T - poses.T)[:, :, None])[:, :, 0]
    return q


def read_ranges(
    folder: Path,
    ways: list[tuple[str, np.ndarray, Callable[[np.ndarray], np.ndarray]]],
    off: tuple[float, float, float] = (0.0, 0.0, 0.0),
    offset: float = 0.0,
    order: np.ndarray | None = None,
) -> Residuals:
    """Residuals of a ball bar's readings along some ways: a plane, angles, and the deviation of the radius at angles.

    ``off``, ``offset``: where the station stands, from the circles' centre, and the offset of its readings, m. ``order``: of
    the rows in the table; time tells in which they were measured.
    """
    T = np.vstack([way(plane, angle) for plane, angle, _ in ways])
    extra = np.concatenate([deviation(angle) for _, angle, deviation in ways])
    moved = MIDDLE + (T - MIDDLE) * (1.0 + extra / RADIUS)[:, None]
    ranges = np.linalg.norm(moved - (MIDDLE + off), axis=1) + offset
    rows = np.column_stack([np.arange(len(T)), commands_to(T), ranges, np.arange(len(T))])
    rows = rows if order is None else rows[order]
    station = ", ".join(f"{v:.17g}" for v in MIDDLE)
    (folder / "dataset.toml").write_text(
        'schema = "gtpin-dataset/2"\nrobot = "gantry_tau"\n[[instrument]]\nname = "bar"\nkind = "range"\nsigma = 1e-6\n'
        f"stations = {{C = [{station}]}}\noffset_sigma = 1e-3\n"
    )
    write_table(folder / "bar.csv", "pose,q1,q2,q3,range,time", ([f"{v:.17g}" for v in row] for row in rows))
    return left_by_nominal(Dataset.read(folder), 1e-6)


def commands(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.3, 0.3, (count, 3))


def write(folder: Path) -> None:
    """20 ranges that are 10 µm too long, 8 rests in each of two sockets, and 12 tilts that are 30 and -40 µrad off."""
    (folder / "dataset.toml").write_text(DECLARED, encoding="utf-8")
    q = commands(20, 1)
    poses = NOMINAL.kinematics.forward(q)
    ranges = np.linalg.norm(poses.T + poses.R @ TARGET - STATION, axis=1) + 1e-5
    _table(folder / "wire.csv", "range", q, ranges[:, None])
    _table(folder / "cup.csv", "socket", commands(16, 2), np.repeat(["S1", "S2"], 8)[:, None], "c")
    q = commands(12, 3)
    up = np.swapaxes(NOMINAL.kinematics.forward(q).R, 1, 2) @ [0.0, 0.0, 1.0]
    _table(folder / "level.csv", "tilt_x,tilt_y", q, up[:, :2] + [3e-5, -4e-5], "t")


def _table(file: Path, names: str, q: np.ndarray, read: np.ndarray, mark: str = "w") -> None:
    rows = enumerate(zip(q, read.tolist(), strict=True))
    cells = ([f"{mark}{i}", *(f"{v:.17g}" for v in command), *values, i % 5] for i, (command, values) in rows)
    write_table(file, f"pose,q1,q2,q3,{names},payload", cells)


def mixed(folder: Path) -> Residuals:
    """What the nominal model leaves of them."""
    write(folder)
    return left_by_nominal(single(Dataset.read(folder), NOMINAL.robot), 2e-5)
