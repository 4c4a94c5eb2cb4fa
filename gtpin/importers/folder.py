"""Writes the dataset folder of touches: ``dataset.toml`` in schema 2, and the table of the one instrument."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.data.dataset import FILES
from gtpin.data.files import write_table
from gtpin.data.names import command_names
from gtpin.data.second_schema import SECOND, describe_second, write_second
from gtpin.data.table import Column
from gtpin.errors import DatasetError
from gtpin.importers.touches import Touches, commands
from gtpin.kinematics.kinematics import kinematics
from gtpin.output.ownership import alone_in, recorded, refuse_foreign, was_moved_aside
from gtpin.output.results import results_folder, writing
from gtpin.references import seen_from
from gtpin.robot.geometry import Geometry
from gtpin.robot.library import load_robot

PLANE = "A"
"""Name of the only plane of a file of touches."""
DIGITS = 9
"""Decimals to which the plane's point, m, is written: nanometres, far below the width of its prior."""


def write_touches(
    touches: Touches,
    folder: Path | str,
    robot: str,
    *,
    tcp: str | None = None,
    name: str = "bed",
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    normal: Sequence[float] = (0.0, 0.0, 1.0),
    sigma: float | None = None,
    force: bool = False,
) -> int:
    """Write a dataset folder of touches of one plane, and give the number of its rows.

    ``touches``: the touches, as a reader of this package returns them. ``folder``: the folder to write. A dataset that
    gtpin wrote there is replaced. ``robot``, ``tcp``: the robot's name, or the path of its URDF or MJCF file; the link of
    its TCP, where it is not the robot's own. ``name``: name of the instrument and of its table. ``origin``: (3,) the
    controller's zero in the robot's base frame, m. ``normal``: (3,) normal of the surface, base frame, pointing to the
    touched side; any length. The plane goes through the mean of the touched points. ``sigma``: standard deviation of a
    touch along the normal, m; None: it is estimated from the data. ``force``: rename files that gtpin has not written
    (``NAME.old-1``).

    Raises `GtpinError` if the robot can't be read, is another machine or can't reach a touch, or the folder can't be
    written.
    """
    folder = Path(folder)
    nominal = kinematics(Geometry.nominal(load_robot(robot, tcp)))
    q, poses = commands(touches, nominal, _vector(origin, "origin"))
    n = _vector(normal, "normal")
    if not n.any():
        raise DatasetError("the normal has no direction", column="normal", hint="give three numbers, not all zero")
    n = n / np.abs(n).max()  # first of all, because the square of a large number overflows
    n = n / np.linalg.norm(n)
    if sigma is not None and not 0.0 < sigma < np.inf:
        raise DatasetError(f"sigma = {sigma:g} can't be", column="sigma", hint="a length in m, above 0")
    tips = poses.T + np.einsum("nij,j->ni", poses.R, np.array(touches.target))
    height = np.zeros(len(touches)) if touches.height is None else touches.height
    instrument: dict[str, Any] = {"name": name, "kind": "plane"}
    if sigma is not None:
        instrument["sigma"] = sigma
    if any(touches.target):
        instrument["target"] = [float(value) for value in touches.target]
    point = tips.mean(axis=0) - height.mean() * n
    instrument["planes"] = {PLANE: {"point": (point.round(DIGITS) + 0.0).tolist(), "normal": n.tolist()}}
    columns: dict[str, Column] = {"pose": touches.pose}
    columns |= dict(zip(command_names(q.shape[1]), q.T, strict=True))
    if touches.height is not None:
        columns["height"] = touches.height
    write_instrument(folder, seen_from(robot, folder), instrument, columns, tcp=tcp, force=force)
    return len(touches)


def write_instrument(
    folder: Path,
    robot: str,
    instrument: dict[str, Any],
    columns: dict[str, Column],
    *,
    tcp: str | None = None,
    actuators: Sequence[str] = (),
    force: bool = False,
) -> None:
    """Write ``dataset.toml`` in schema 2 with one instrument, and its table ``NAME.csv``.

    ``folder``, ``force``: as for :func:`write_touches`. ``robot``, ``tcp``, ``actuators``: as in dataset.toml.
    ``instrument``: the keys of ``[[instrument]]``. ``columns``: (N,) columns of its table, by name.
    """
    content = {"schema": SECOND, "robot": robot, "tcp": tcp, "actuators": actuators, "instrument": [instrument]}
    described = describe_second(content, None, {})
    name = described.instruments[0].name
    if not force and folder.is_dir():
        with writing(folder, DatasetError):
            there = [name for name in sorted(os.listdir(folder)) if not was_moved_aside(name)]
            refuse_foreign(folder, there, force, DatasetError)
    # Tables of the dataset that is replaced are removed: the new dataset has no instrument for them.
    tables = {name for name in recorded(folder).keys() - alone_in(folder) if name.endswith((".csv", ".parquet"))}
    table = f"{name}.csv"
    with results_folder(folder, {*FILES, *tables, table}, force=force, kind=DatasetError) as new:
        write_second(new / "dataset.toml", described.common, described.instruments)
        write_table(new / table, columns)


def _vector(values: Sequence[float], name: str) -> npt.NDArray[np.float64]:
    vector = np.array(values, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise DatasetError("these are not three finite numbers", column=name, hint="give x y z")
    return vector
