"""Touches: positions of the TCP, by a controller's own geometry, at which a probe touched a surface; and their dataset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from gtpin.data import Commands
from gtpin.data.description import SECOND
from gtpin.data.folder import write_folder
from gtpin.data.ids import normal_ids
from gtpin.data.instrument_tables import describe_second, written
from gtpin.data.names import command_names
from gtpin.data.table import Column
from gtpin.errors import DatasetError, warn
from gtpin.extras.importers.matched import in_range
from gtpin.kinematics.inverse import commands_for
from gtpin.kinematics.kinematics import Kinematics, nominal
from gtpin.kinematics.poses import Poses
from gtpin.output.ownership import alone_in, recorded
from gtpin.references import seen_from
from gtpin.robot.chain import Chain
from gtpin.robot.library import load_robot
from gtpin.typing import Floats

MILLIMETRE = 1e-3
FARTHEST = 1e3
"""Length, m, or angle, rad, above which a number of a file is assumed to be damaged."""
ASIDE = (0.1, 500.0)
"""Smallest and largest distance, mm, of a probe from the axis of the nozzle: smaller ones look like metres. Assumed."""
TIP = 2.0
"""Distance of a target from the TCP, m, above which it looks like millimetres. Assumed."""
FREE, WHOLE = 3, 6
"""Numbers of actuators: with the first, positions determine the commands; with the second, positions and orientations do."""
ALIKE = 0.05
"""Largest root mean square (rms) difference of the nominal robot's commands from the recorded travel, over the rms travel. It
is smaller where the dimensions are known to a few per cent; for wrongly assigned drives it is about 1. Assumed."""
SAME = 5e-5
"""The same difference, m, above which a robot has other dimensions than a file: these can be rounded to 0.01 mm. Assumed."""
FEWEST = 3
"""Fewest touches from which order and sign of the drives are determined."""
FAR = 1e-3
"""Mean distance, m, of the touches of a bed from the controller's z = 0 above which there is a warning. Assumed."""
PLANE = "A"
"""Name of the only plane of a file of touches."""
DIGITS = 9
"""Decimals to which the plane's point, m, is written: nanometres, far below the width of its prior."""


@dataclass(frozen=True, eq=False)
class Touches:
    """N touches of one surface, as they are in a file.

    - ``file``, ``row``: the file, and the (N,) line of each touch.
    - ``pose``: (N,) ids.
    - ``position``: (N, 3) the TCP at the touch in the controller's coordinates, m; None where the file has the commands
      themselves.
    - ``q``: (N, n) commands, m or rad; None where they follow from the positions.
    - ``travel``: (N, n) travel of the drives, m, in any order and with any sign and zero; None where it was not recorded.
      Commands that are taken from it do not depend on the controller's geometry.
    - ``height``: (N,) height of the target over the surface, m, positive on the side that the normal points to; None for
      zero.
    - ``target``: (3,) the touching point, TCP frame, m.
    - ``carriages``: (N, n) heights of the carriages, m, by dimensions in the file; None where it has none. They only check the
      robot.
    - ``bed``: whether the surface is the controller's z = 0, as the bed of a printer; else its place and tilt are unknown.

    Raises `DatasetError` if a number is so large that it must be damaged, or the target is too far from the TCP.
    """

    file: Path
    row: npt.NDArray[np.int64]
    pose: npt.NDArray[np.object_]
    position: Floats | None = None
    q: Floats | None = None
    travel: Floats | None = None
    height: Floats | None = None
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    carriages: Floats | None = None
    bed: bool = False

    def __post_init__(self) -> None:
        for values in (self.position, self.q, self.travel, self.height):
            if values is not None:
                check_size(values, self.file, self.row)
        if not max(map(abs, self.target)) <= TIP:
            what = f"a target {max(map(abs, self.target)):g} m from the TCP"
            raise DatasetError(what, column="target", hint="lengths of a target are m, those of a probe's offset mm")

    def __len__(self) -> int:
        return len(self.row)


def check_size(values: Floats, file: Path, row: npt.NDArray[np.int64]) -> None:
    """Raise `DatasetError` for the first of (N,) or (N, k) values, m or rad, that can only be damaged."""
    large = np.flatnonzero(~(np.abs(values.reshape(len(row), -1)) < FARTHEST).all(axis=1))
    if large.size:
        hint = "correct the row, or delete it; check the unit"
        raise DatasetError(f"a number beyond {FARTHEST:g} m", file=file, row=int(row[large[0]]), hint=hint)


def touched(file: Path, rows: list[int], xyz: list[list[float]], offset: tuple[float, float, float]) -> Touches:
    """Touches of a probe that is mounted beside the nozzle, from a file in millimetres.

    ``file``, ``rows``: the file, and the line of each touch. ``xyz``: commands of the nozzle, (N, 3), mm. ``offset``: the
    probe's offset, mm: x and y of the probe from the nozzle, and the height of the nozzle over the bed at the touch.

    Raises `DatasetError` if the offset looks like metres.
    """
    aside = float(np.hypot(*offset[:2]))
    if aside and not ASIDE[0] <= aside <= ASIDE[1]:
        what = f"a probe {aside:g} mm beside the nozzle" + (" looks like metres" if aside < ASIDE[0] else " can't be")
        raise DatasetError(what, column="probe-offset", hint="give x_offset, y_offset and z_offset in mm")
    x, y, z = (MILLIMETRE * value for value in offset)
    return Touches(
        file,
        np.array(rows, dtype=np.int64),
        normal_ids(range(1, len(rows) + 1)),
        position=MILLIMETRE * np.array(xyz).reshape(-1, 3),
        target=(x, y, 0.0 - z),
        bed=True,
    )


def commands(touches: Touches, kinematics: Kinematics, origin: Floats) -> tuple[Floats, Poses]:
    """Commands of the robot's actuators at the touches, and the poses at these commands.

    Commands that are not in the file are computed from the positions by inverse kinematics. The orientation of a robot with
    three actuators is free; a robot with six or more keeps that of its home.

    ``touches``: the touches. ``kinematics``: kinematics of the robot with the controller's geometry. ``origin``: (3,) the
    controller's zero in the base frame, m; the axes are parallel.

    Returns (N, n) commands, m or rad, and the (N) poses there. Raises `DatasetError` if the robot can't reach a position,
    or its commands do not agree with the recorded travel of the drives.
    """
    robot = kinematics.geometry.robot
    if touches.q is not None:
        q = touches.q
        if q.shape[1] != robot.n_actuators:
            what = f"{q.shape[1]} axes for the {robot.n_actuators} actuators of {robot.name}"
            hint = "name one axis for each, in the order q1 .. qn"
            raise DatasetError(what, file=touches.file, column="axes", hint=hint)
        poses = kinematics.forward(q)
    else:
        assert touches.position is not None
        if robot.n_actuators != FREE and robot.n_actuators < WHOLE:
            what = f"positions do not determine the {robot.n_actuators} commands of {robot.name}"
            raise DatasetError(what, file=touches.file, hint="give a robot of three, or of six or more actuators")
        home = kinematics.forward(robot.home_q[None])
        R = None if robot.n_actuators == FREE else np.repeat(home.R, len(touches), axis=0)
        q, poses = commands_for(kinematics, touches.position + origin, R)
        _refuse(touches, poses, robot)
        if touches.travel is None:
            known = touches.carriages
            if known is not None and len(q) >= FEWEST and q.shape == known.shape and _assigned(q, known)[2] > SAME:
                off = f"{1e3 * _assigned(q, known)[2]:.2g} mm: right only if they were changed after the probing; else correct"
                what = f"the carriages of {robot.name} move otherwise than by the dimensions in this file, by {off}"
                warn(f"{touches.file}: {what} the robot")
        else:
            q = by_travel(q, touches.travel, touches.file, robot.name)
            poses = kinematics.forward(q)
    _refuse(touches, poses, robot)
    return in_range(Commands(touches.pose, q, {}, touches.row, touches.file), robot).q, poses


def _refuse(touches: Touches, poses: Poses, robot: Chain) -> None:
    lost = np.flatnonzero(~poses.reached)
    if lost.size:
        more = f" (nor {lost.size - 1} more)" if lost.size > 1 else ""
        raise DatasetError(
            f"{robot.name} can't be where this row was touched{more}",
            file=touches.file,
            row=int(touches.row[lost[0]]),
            hint="check that the robot has the machine's dimensions, the unit, and the controller's zero in the base frame",
        )


def by_travel(q: Floats, travel: Floats, file: Path, robot: str) -> Floats:
    """Commands (N, n) from the drives' travel (N, n): order, signs and zeros are found by comparison with the commands ``q``.

    ``q``: (N, n) commands of the nominal robot at the same touches, m. ``travel``: (N, n) recorded travel, m. ``file``,
    ``robot``: file and robot for error messages.

    Raises `DatasetError` if the travel of a drive agrees with no actuator: the robot is another machine.
    """
    if len(q) < FEWEST or q.shape != travel.shape:
        what = f"{len(q)} touches with {travel.shape[1]} drives, for a robot of {q.shape[1]} actuators"
        raise DatasetError(what, file=file, hint=f"give the robot of this printer, and {FEWEST} touches at least")
    drive, sign, worst = _assigned(q, travel)
    moved = travel - travel.mean(axis=0)
    if not worst <= ALIKE * np.sqrt((moved**2).mean()):
        what = f"the carriages of {robot} would travel otherwise than those of this printer, by {1e3 * worst:.3g} mm"
        raise DatasetError(what, file=file, hint="give a robot with the dimensions that this file has")
    found: Floats = q.mean(axis=0) + sign * moved[:, drive]
    return found


def _assigned(q: Floats, travel: Floats) -> tuple[npt.NDArray[np.intp], Floats, float]:
    """(n,) drive and sign of each actuator by which travel (N, n) is most like commands q (N, n), and the largest root mean
    square difference that is left, m."""
    commanded, moved = q - q.mean(axis=0), travel - travel.mean(axis=0)
    same = np.sqrt(((commanded[:, :, None] - moved[:, None, :]) ** 2).mean(axis=0))
    other = np.sqrt(((commanded[:, :, None] + moved[:, None, :]) ** 2).mean(axis=0))
    apart = np.minimum(same, other)
    actuator, drive = linear_sum_assignment(apart)
    sign = np.where(same <= other, 1.0, -1.0)[actuator, drive]
    return drive, sign, float(apart[actuator, drive].max())


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
    touched side; any length. The plane goes through the mean of the touched points; that of a bed is the controller's z = 0.
    ``sigma``: standard deviation of a
    touch along the normal, m; None: it is estimated from the data. ``force``: rename files that gtpin has not written
    (``NAME.old-1``).

    Raises `GtpinError` if the robot can't be read, is another machine or can't reach a touch, or the folder can't be
    written.
    """
    folder = Path(folder)
    own = nominal(load_robot(robot, tcp))
    q, poses = commands(touches, own, _vector(origin, "origin"))
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
    if touches.bed:
        zero = _vector(origin, "origin")
        away = float((point - zero) @ n)
        if abs(away) > FAR:
            what = f"the bed is touched at z = {1e3 * away:.3g} mm on average, where a firmware's zero is the bed"
            warn(f"{touches.file}: {what}: check the unit, --origin, and the z of the probe's offset")
        point, instrument["plane_sigma"], instrument["normal_sigma"] = zero, 0.0, 0.0
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
    common, (one,) = describe_second(content, None, {})
    # Tables of the dataset that is replaced are removed: the new dataset has no instrument for them.
    old = sorted(name for name in recorded(folder).keys() - alone_in(folder) if name.endswith((".csv", ".parquet")))
    write_folder(folder, common, [written(one)], {one.name: columns}, old=old, force=force)


def _vector(values: Sequence[float], name: str) -> npt.NDArray[np.float64]:
    vector = np.array(values, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise DatasetError("these are not three finite numbers", column=name, hint="give x y z")
    return vector
