"""Poses of a ROS topic as CSV, as ``rostopic echo -p`` writes them, or ``ros2 topic echo --csv`` of ROS 2.

The header of ROS 1 names each field of the message: ``%time, field.header.seq, ..., field.pose.position.x, ...,
field.pose.orientation.w``. Positions are metres (REP 103) and times are nanoseconds. The parts of the quaternion, in the order
x, y, z, w in ROS's messages, are found by their names.

The file of ROS 2 has no header. Its columns are the fields in the order of the message's definition, so the number of columns
tells which of the usual messages with a stamp and one pose it is. The stamp is in two columns, seconds and nanoseconds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gtpin.data import Commands, Dataset, InstrumentSection
from gtpin.errors import DatasetError
from gtpin.extras.importers.lines import decimal, text_lines
from gtpin.extras.importers.matched import Match, matched
from gtpin.extras.importers.points import NamedColumns

TIMES = ("field.header.stamp", "%time")
"""Columns of the time, of which the first that is present is used: the message's own stamp, then the time of reception."""
NANOSECOND = 1e-9
STAMP = ("sec", "nanosec", "frame_id")
"""The first columns of a message of ROS 2: its header."""
POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
MESSAGES = {
    10: ("PoseStamped", POSE),
    11: ("TransformStamped", ("child_frame_id", *POSE)),
    46: ("PoseWithCovarianceStamped", POSE),
    89: ("Odometry", ("child_frame_id", *POSE)),
}
"""By the number of columns, messages of ROS 2 and their columns after the header; covariances and speeds follow."""
NANOSECONDS, SECONDS = 10**9, 2**31
"""Upper bounds of the two parts of a stamp of ROS 2."""
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
    instrument: InstrumentSection | None = None,
    tcp: str | None = None,
) -> Dataset:
    """Read the poses of a topic, each with the command that belongs to it.

    ``file``: CSV with the header of ``rostopic echo -p``, or without one as ``ros2 topic echo --csv`` writes it. ``robot``,
    ``tcp``: as in dataset.toml. ``commands``, ``match``, ``within``: the commands, and how they are matched: by ``time``
    (s, of the same clock) or ``row``; see :func:`~gtpin.extras.importers.matched.matched`. ``prefix``: prefix of the pose's
    columns, where the message has several poses: ``field.detections0.pose.pose.pose``. ``instrument``: the instrument; by
    default with unknown noise, a free frame and a free target.

    Raises `DatasetError` if a column is missing or there twice, or a row is damaged or has no command.
    """
    file = Path(file)
    cells = [(row, line.split(",")) for row, line in enumerate(text_lines(file), 1) if line.strip()]
    names = [name.strip() for name in cells[0][1]]
    stamps: tuple[tuple[int, float], ...]  # columns that sum to the time, with their units, s
    if names[0].isdecimal():
        names = _message(file, cells, prefix)
        place = {part: names.index(part) for part in PARTS}
        stamps = ((0, 1.0), (1, NANOSECOND))
    else:
        place = {part: _place(file, names, suffix, prefix) for part, suffix in PARTS.items()}
        stamps = tuple((names.index(name), NANOSECOND) for name in TIMES if name in names)[:1]
        del cells[0]
    rows, poses, times = [], [], []
    for row, texts in cells:
        if len(texts) != len(names):
            what = f"the row has {len(texts)} cells, the {'first row' if len(stamps) == 2 else 'header'} {len(names)}"
            raise DatasetError(what, file=file, row=row, hint="delete the row, or export it again")
        poses.append([decimal(texts[at], file, row, names[at]) for at in place.values()])
        if stamps:
            times.append(sum(unit * decimal(texts[at], file, row, names[at]) for at, unit in stamps))
        rows.append(row)
    if not rows:
        raise DatasetError("no rows under the header", file=file, hint="it needs at least one")
    line, values = np.array(rows, dtype=np.int64), dict(zip(PARTS, np.array(poses).T, strict=True))
    time = np.array(times) if stamps else None
    at = matched(commands, match, file=file, row=line, time=time, within=within)
    if time is not None:
        values["time"] = time - time[0]
    return NamedColumns(file, line, None, values).dataset(robot, commands, at, instrument=instrument, tcp=tcp)


def _message(file: Path, cells: list[tuple[int, list[str]]], prefix: str | None) -> list[str]:
    """Names of the columns of a message of ROS 2; those after the pose have none."""
    width = len(cells[0][1])
    known = ", ".join(f"{name} ({columns} columns)" for columns, (name, _) in MESSAGES.items())
    what = f"the file has no names of columns, as ros2 topic echo --csv writes it, and {width} columns"
    if width not in MESSAGES or prefix is not None:
        what += ", so there is no prefix" if width in MESSAGES else ""
        hint = f"gtpin knows {known}; name the columns of any other: gtpin import points --columns=..."
        raise DatasetError(what, file=file, row=cells[0][0], hint=hint)
    names = [*STAMP, *MESSAGES[width][1]]
    for row, texts in cells:
        for at, most in ((0, SECONDS), (1, NANOSECONDS)):
            if texts[at:] and not (texts[at].strip().isdecimal() and int(texts[at].strip()[:20]) < most):
                what = f"{texts[at].strip()[:20]!r} is no {STAMP[at]} of a stamp"
                hint = f"a {MESSAGES[width][0]} of ros2 topic echo --csv begins with {', '.join(STAMP)}"
                raise DatasetError(what, file=file, row=row, column=STAMP[at], hint=hint)
        if texts[2:] and texts[2].strip().isdecimal():
            what = f"the frame is {texts[2].strip()[:20]!r}, a number"
            hint = "give the whole file: rostopic echo -p of ROS 1 writes a line of names"
            raise DatasetError(what, file=file, row=row, column="frame_id", hint=hint)
    return names + [""] * (width - len(names))


def _place(file: Path, names: list[str], suffix: str, prefix: str | None) -> int:
    """Index of the only column that holds a part of the pose."""
    wanted = [f"{prefix}.{suffix}"] if prefix else [name for name in names if name.endswith(f".{suffix}")]
    found = [at for at, name in enumerate(names) if name in wanted]
    if len(found) == 1:
        return found[0]
    what = f"{len(found)} columns end in {suffix}" if found else f"there is no column {wanted[0] if prefix else suffix}"
    hint = (
        "name the pose that is meant (--prefix)" if found else "give what rostopic echo -p wrote of a topic with poses"
    )
    raise DatasetError(what, file=file, row=1, column=suffix, hint=hint)
