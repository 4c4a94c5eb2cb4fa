"""Klipper's reports of single touches, on its console and in klippy.log: ``probe at 10.000,20.000 is z=2.345000``.

Source: klippy/extras/probe.py of github.com/Klipper3d/klipper. Older versions write ``probe at X,Y is z=Z``: the nozzle's
commands at the touch, mm. Newer ones write ``probe: at X,Y bed will contact at z=Z``: the point of the bed under the probe,
and the nozzle's command at which the nozzle itself would touch it; it includes the probe's offset.
"""

from __future__ import annotations

import re
from pathlib import Path

from gtpin.errors import DatasetError
from gtpin.importers.lines import decimals, text_lines
from gtpin.importers.touches import Touches, touched

_BEGIN = re.compile(r"\bprobe:? at\s+[^\s,]*,")
_OLD = re.compile(r"\bprobe at\s+([^\s,]+),([^\s,]+)\s+is\s+z=(\S+)\s*$")
_NEW = re.compile(r"\bprobe: at\s+([^\s,]+),([^\s,]+)\s+bed will contact at\s+z=(\S+)\s*$")


def read_klipper_probe(file: Path | str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Touches:
    """Read all touches that a log reports, in its order; several samples of one point are several touches.

    Parameters
    ----------
    file
        klippy.log, or the console's text; other text before a report in its line is ignored.
    offset
        ``x_offset y_offset z_offset`` of the printer's ``[probe]``, mm.

    Raises
    ------
    DatasetError
        If there is no report, or a report is damaged.
    """
    file = Path(file)
    x, y, z = offset
    rows, xyz = [], []
    for row, line in enumerate(text_lines(file), 1):
        if _BEGIN.search(line) is None:
            continue
        old, new = _OLD.search(line), _NEW.search(line)
        match = old or new
        if match is None:
            what = "the report of a touch is not whole"
            raise DatasetError(what, file=file, row=row, hint="correct the line, or delete it")
        values = decimals([match[1], match[2], match[3]], file, row)
        xyz.append(values if old else [values[0] - x, values[1] - y, values[2] + z])
        rows.append(row)
    if not rows:
        what = "no line reports a touch as 'probe at X,Y is z=Z'"
        raise DatasetError(what, file=file, hint="give klippy.log, or the console's text, of a probing")
    return touched(file, rows, xyz, offset)
