"""Poses of a ROS topic as CSV, as ``rostopic echo -p`` writes them: PoseStamped, Odometry, one AprilTag detection.

The header names each field of the message: ``%time, field.header.seq, ..., field.pose.position.x, ...,
field.pose.orientation.w``. Positions are metres (REP 103) and times are nanoseconds. The parts of the quaternion, in the order
x, y, z, w in ROS's messages, are found by their names.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.data import Commands, Dataset, Instrument
from gtpin.errors import DatasetError
from gtpin.importers.lines import decimal, text_lines
from gtpin.importers.matched import Match, matched

Floats = npt.NDArray[np.float64]

TIMES = ("field.header.stamp", "%time")
"""Columns of the time, of which the first that is present is used: the message's own stamp, then the time of reception."""
NANOSECOND = 1e-9
PARTS = {
    **{axis: f"position.{axis}" for axis in "xyz"},
    **{f"q{axis}": f"orientation.{axis}" for axis in "wxyz"},
}


def read_ros_poses(
    file: Path | str,
    robot: str,
    commands: Commands,
    match: Match,
    *,
    within: float | None = None,
    prefix: str | None = None,
    instrument: Instrument | None = None,
    tcp: str | None = None,
) -> Dataset:
    """Read the poses of a topic, each with the command that belongs to it.

    Parameters
    ----------
    file
        CSV with the header of ``rostopic echo -p``.
    robot, tcp
        As in dataset.toml.
    commands, match, within
        The commands, and how they are matched: by ``time`` (s, of the same clock) or ``row``; see
        :func:`~gtpin.importers.matched.matched`.
    prefix
        Prefix of the pose's columns, where the message has several poses: ``field.detections0.pose.pose.pose``.
    instrument
        The instrument; by default with unknown noise, a free frame and a free target.

    Raises
    ------
    DatasetError
        If a column is missing or there twice, or a row is damaged or has no command.
    """
    file = Path(file)
    cells = [(row, line.split(",")) for row, line in enumerate(text_lines(file), 1) if line.strip()]
    names = [name.strip() for name in cells[0][1]]
    place = {part: _place(file, names, suffix, prefix) for part, suffix in PARTS.items()}
    time_at = next((names.index(name) for name in TIMES if name in names), None)
    rows, poses, times = [], [], []
    for row, texts in cells[1:]:
        if len(texts) != len(names):
            what = f"the row has {len(texts)} cells, the header {len(names)}"
            raise DatasetError(what, file=file, row=row, hint="delete the row, or export it again")
        poses.append([decimal(texts[at], file, row, names[at]) for at in place.values()])
        if time_at is not None:
            times.append(NANOSECOND * decimal(texts[time_at], file, row, names[time_at]))
        rows.append(row)
    if not rows:
        raise DatasetError("no rows under the header", file=file, hint="it needs at least one")
    line, found = np.array(rows, dtype=np.int64), np.array(poses)
    time = np.array(times) if time_at is not None else None
    at = matched(commands, match, file=file, row=line, time=time, within=within)
    covariates = {name: values[at] for name, values in commands.covariates.items()}
    if time is not None:
        covariates["time"] = time - time[0]
    return Dataset(
        robot=robot,
        pose=commands.pose[at],
        q=commands.q[at],
        position=found[:, :3],
        orientation=found[:, 3:],
        covariates=covariates,
        instrument=instrument or Instrument(frame="free", target="free"),
        tcp=tcp,
        row=line,
        file=file,
    )


def _place(file: Path, names: list[str], suffix: str, prefix: str | None) -> int:
    """Index of the only column that holds a part of the pose."""
    wanted = [f"{prefix}.{suffix}"] if prefix else [name for name in names if name.endswith(f".{suffix}")]
    found = [at for at, name in enumerate(names) if name in wanted]
    if len(found) == 1:
        return found[0]
    what = f"{len(found)} columns end in {suffix}" if found else f"there is no column {wanted[0] if prefix else suffix}"
    hint = "name the pose that is meant (prefix)" if found else "give what rostopic echo -p wrote of a topic with poses"
    raise DatasetError(what, file=file, row=1, column=suffix, hint=hint)
