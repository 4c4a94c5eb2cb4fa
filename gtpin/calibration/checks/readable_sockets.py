"""Sockets that can't be right: each visited once, or with other distances between them than those that are declared."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gtpin.calibration.checks.read_otherwise import UNITS
from gtpin.calibration.checks.suspected import refuse
from gtpin.data import Dataset
from gtpin.errors import DatasetError, warn
from gtpin.instruments.readings import Readings, instruments_of
from gtpin.instruments.socket import Socket
from gtpin.kinematics.poses import Poses
from gtpin.robot.robot import Robot


def check_sockets(dataset: Dataset, robot: Robot) -> None:
    """Refuse sockets that are visited once each, and warn of some that are.

    A visit of a socket whose point is declared, or whose distance from another one is known, says something by itself.

    Raises `DatasetError` if no socket is visited twice, and nothing is known of any.
    """
    rows = dataset.readings
    assert rows is not None
    for i, one in enumerate(instruments_of(rows, robot)):
        if not isinstance(one, Socket):
            continue
        counts = np.bincount(one.socket, minlength=len(one.names))
        known = {*one.table.sockets, *(name for distance in one.table.distances for name in distance[:2])}
        once = [name for k, name in enumerate(one.names) if counts[k] == 1 and name not in known]
        if once and (counts <= 1).all() and not known:
            hint = "visit each socket from several poses: a point that is unknown takes the first visit"
            raise DatasetError("every socket is visited once", file=rows.files[i], column="socket", hint=hint)
        if once:
            warn(f"{rows.files[i]}: visited once, so that they say nothing: sockets {', '.join(once)}")


def check_distances(dataset: Dataset, readings: Readings, poses: Poses, reach: float) -> None:
    """Refuse known distances of sockets that are far from those of the nominal robot.

    ``dataset``: the data. ``readings``: the readings, with the sockets' points from the nominal robot. ``poses``,
    ``reach``: as in :func:`check_readable`.

    Raises `DatasetError` if there are such distances; it names the unit that fits, where there is one.
    """
    for i, one in enumerate(readings.instruments):
        if not isinstance(one, Socket):
            continue
        for k, (a, b, given, _) in enumerate(one.table.distances):
            if {a, b} & set(one.table.sockets):  # their declared points may be wrong instead
                continue
            found = float(np.linalg.norm(one.at(readings.own(i), a) - one.at(readings.own(i), b)))
            if abs(given - found) <= reach or _missed(readings, poses, i, one, (a, b)) > reach:
                continue
            file = readings.rows.files[i]
            toml = None if file is None else Path(file).parent / "dataset.toml"
            like = [(unit, factor) for unit, factor in UNITS if abs(given * factor - found) < min(reach, 0.2 * found)]
            hint = (
                f"it looks like {like[0][0]}: multiply by {like[0][1]:g}" if like else "check it, and the rows' sockets"
            )
            what = f"{one.name}: {a} and {b} are {given:.6g} m apart here, for the nominal robot {found:.3g} m"
            column = f"instrument.{i}.distances.{k}"
            refuse(DatasetError(what, file=toml, column=column, hint=hint), dataset)


def _missed(readings: Readings, poses: Poses, index: int, one: Socket, names: tuple[str, str]) -> float:
    """Median error of the rows of two sockets: where it is large, something else is wrong than their distance."""
    rows = readings.rows
    mine = rows.rows_of(index)[np.isin(one.socket, [one.names.index(name) for name in names])]
    left = np.abs(readings.minus(poses)[mine])
    own = left[rows.component[mine] < 3, 0] if readings.components == 1 else left[:, :3]
    return float(np.median(own)) if own.size else 0.0
