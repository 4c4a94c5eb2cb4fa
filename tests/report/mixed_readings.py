"""A dataset of a wire, a cup and a level, and the residuals of a model to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import gtpin
from gtpin.data import Dataset
from gtpin.instruments.readings import Readings, single
from gtpin.report.residuals import Residuals

NOMINAL = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
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
    lines = [f"pose,q1,q2,q3,{names},payload"]
    for i, (command, values) in enumerate(zip(q, read.tolist(), strict=True)):
        lines.append(",".join([f"{mark}{i}", *(f"{v:.17g}" for v in command), *map(str, values), f"{i % 5}"]))
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def mixed(folder: Path) -> Residuals:
    """What the nominal model leaves of them."""
    write(folder)
    dataset = single(Dataset.read(folder), NOMINAL.robot)
    readings = Readings.of(dataset, NOMINAL.robot)
    left = readings.minus(NOMINAL.kinematics.forward(dataset.q))
    return Residuals(dataset, len(dataset), NOMINAL, NOMINAL, left, left, np.full_like(left, 2e-5), readings)
