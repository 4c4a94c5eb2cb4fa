"""Ranges along circles about a station, whose radial deviations are known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

import gtpin
from gtpin.data import Dataset
from gtpin.instruments.readings import Readings
from gtpin.report.residuals import Residuals

NOMINAL = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
MIDDLE = NOMINAL.kinematics.forward(NOMINAL.robot.home_q[None]).T[0]
RADIUS = 0.12
PLANES = {"XY": (0, 1), "YZ": (1, 2), "ZX": (2, 0)}

Floats = np.ndarray


def way(plane: str, angle: Floats) -> Floats:
    """(N, 3) places along a circle about the middle, at angles from the plane's first axis to its second."""
    first, second = PLANES[plane]
    T = np.tile(MIDDLE, (len(angle), 1))
    T[:, first] += RADIUS * np.cos(angle)
    T[:, second] += RADIUS * np.sin(angle)
    return T


def commands_to(T: Floats) -> Floats:
    """(N, 3) commands that bring the nominal TCP to places (N, 3), by Newton's method."""
    q = np.tile(NOMINAL.robot.home_q, (len(T), 1))
    for _ in range(30):
        poses = NOMINAL.kinematics.forward(q)
        J = NOMINAL.kinematics.command_jacobian(q, poses)[:, :3]
        q = q + np.linalg.solve(J, (T - poses.T)[:, :, None])[:, :, 0]
    return q


def read_ranges(
    folder: Path,
    ways: list[tuple[str, Floats, Callable[[Floats], Floats]]],
    off: tuple[float, float, float] = (0.0, 0.0, 0.0),
    offset: float = 0.0,
    order: Floats | None = None,
) -> Residuals:
    """Residuals of a ball bar's readings along some ways.

    Parameters
    ----------
    ways
        A plane, angles, and the deviation of the radius at angles.
    off, offset
        Where the station stands, from the circles' centre, and the offset of its readings, m.
    order
        Of the rows in the table; time tells in which they were measured.
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
    lines = [",".join(["pose", "q1", "q2", "q3", "range", "time"])]
    lines += [",".join(f"{v:.17g}" for v in row) for row in rows]
    (folder / "bar.csv").write_text("\n".join(lines) + "\n")
    dataset = Dataset.read(folder)
    readings = Readings.of(dataset, NOMINAL.robot)
    left = readings.minus(NOMINAL.kinematics.forward(dataset.q))
    return Residuals(dataset, len(dataset), NOMINAL, NOMINAL, left, left, np.full_like(left, 1e-6), readings)
