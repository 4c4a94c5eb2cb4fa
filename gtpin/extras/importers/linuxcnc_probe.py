"""LinuxCNC's log of probe touches, as ``(PROBEOPEN file)`` makes it: nine numbers per line, X Y Z A B C U V W.

Source: src/emc/task/emccanon.cc (GET_EXTERNAL_PROBE_POSITION) and docs/src/gcode/g-code.adoc of
github.com/LinuxCNC/linuxcnc. The numbers are the position at the touch in the program's coordinates (offsets of G54 ...,
G92 and of the tool are subtracted), in the program's unit: millimetres after G21, inches after G20; A, B and C are degrees.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from gtpin.data.ids import normal_ids
from gtpin.errors import DatasetError
from gtpin.extras.importers.lines import decimals, text_lines
from gtpin.extras.importers.touches import Touches

AXES = "XYZABCUVW"
TURNING = "ABC"

Unit = Literal["mm", "inch"]
METRES: dict[Unit, float] = {"mm": 1e-3, "inch": 0.0254}


def read_linuxcnc_probe(
    file: Path | str,
    unit: Unit,
    axes: str = "",
    zero: tuple[float, float, float] = (0.0, 0.0, 0.0),
    target: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Touches:
    """Read the touches of a probe log.

    ``file``: the log. ``unit``: unit of lengths in the program that made the log. ``axes``: the letters that are the
    commands of the robot's actuators, in the order of q: ``XYZ`` or ``XYZAC`` for a machine whose drives are its axes
    (trivkins). Empty: X Y Z is the TCP, and the commands are computed with the robot's geometry. ``zero``: with ``axes``:
    the machine coordinates of the program's zero, m. ``target``: (3,) the tip of the probe in the TCP frame, m.

    Raises `DatasetError` if there is no touch, or a line that is not nine numbers.
    """
    file = Path(file)
    if unit not in METRES:
        raise DatasetError(f"the unit {unit!r} is not known", column="unit", hint=f"one of {', '.join(METRES)}")
    letters = axes.upper()
    if set(letters) - set(AXES) or len(set(letters)) != len(letters):
        raise DatasetError(f"axes {axes[:20]!r} can't be", column="axes", hint=f"letters of {AXES}, each once")
    rows, values = [], []
    for row, line in enumerate(text_lines(file), 1):
        texts = line.split()
        if not texts:
            continue
        if len(texts) != len(AXES):
            what = f"the line has {len(texts)} numbers, and a probe log {len(AXES)}"
            raise DatasetError(
                what, file=file, row=row, hint="give the file of (PROBEOPEN file); delete a damaged line"
            )
        values.append(decimals(texts, file, row))
        rows.append(row)
    if not rows:
        raise DatasetError("there is no touch", file=file, hint="give the file of (PROBEOPEN file)")
    scale = np.array([np.pi / 180.0 if letter in TURNING else METRES[unit] for letter in AXES])
    found = np.array(values) * scale
    machine = found + np.array([*zero, *np.zeros(len(AXES) - 3)])
    return Touches(
        file,
        np.array(rows, dtype=np.int64),
        normal_ids(range(1, len(rows) + 1)),
        position=None if letters else found[:, :3],
        q=machine[:, [AXES.index(letter) for letter in letters]] if letters else None,
        target=target,
    )
