"""RepRapFirmware's report of heights, ``G32 bed probe heights: 0.012 -0.031 ...``, and the bed.g that names the points.

Source: src/Movement/BedProbing/RandomProbePointSet.cpp of github.com/Duet3D/RepRapFirmware (ReportProbeHeights), printed
where the last ``G30`` of bed.g has ``S-1``. Heights are in the order of the points P0, P1, ..., mm, and have the same meaning
as those of a height map. The report has no X and Y; these are in bed.g: ``G30 P0 X0 Y115 Z-99999``.
"""

from __future__ import annotations

import re
from pathlib import Path

from gtpin.errors import DatasetError
from gtpin.importers.gcode import gcode_commands
from gtpin.importers.lines import decimal, text_lines
from gtpin.importers.touches import Touches, touched

BEGIN = "G32 bed probe heights:"
FAILED = "probing failed"
LETTERS = "PXYZHKS"
"""Letters of G30's parameters."""

_POINT = re.compile(r"\s*G30\s+P(\d+\b|\{[^}]*\})(.*)", re.IGNORECASE)
_WORD = re.compile(r"([A-Z])\s*([^\sA-Z;]+)", re.IGNORECASE)
_HEIGHT = re.compile(rf"{FAILED}|not set|\S+")


def read_rrf_g32(file: Path | str, points: Path | str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Touches:
    """Read the touches of all reports in a text; points at which probing failed are left out.

    Parameters
    ----------
    file
        The console's text; other text before a report in its line is ignored.
    points
        bed.g, or any file with its ``G30 P...`` commands.
    offset
        ``X Y Z`` of G31 in the printer's config.g, mm.

    Raises
    ------
    DatasetError
        If there is no report, or a report is damaged or has another number of points.
    """
    file, points = Path(file), Path(points)
    places = _places(points)
    rows, xyz, reports = [], [], 0
    for row, line in enumerate(text_lines(file), 1):
        at = line.find(BEGIN)
        if at < 0:
            continue
        reports += 1
        told, comma, _ = line[at + len(BEGIN) :].partition(", mean ")
        if not comma:
            raise DatasetError("the report is not whole", file=file, row=row, hint="delete the line, or run G32 again")
        heights = _HEIGHT.findall(told)
        if len(heights) != len(places):
            what = f"{len(heights)} heights for the {len(places)} points of {points.name}"
            raise DatasetError(what, file=file, row=row, hint="give the bed.g that was run")
        for number, (text, (x, y)) in enumerate(zip(heights, places, strict=True), 1):
            if text == FAILED:
                continue
            rows.append(row)
            xyz.append([x - offset[0], y - offset[1], decimal(text, file, row, str(number)) + offset[2]])
    if not rows:
        what = f"no line has {BEGIN!r}" if not reports else "probing failed at all points"
        raise DatasetError(what, file=file, hint="let the last G30 of bed.g have S-1, run G32, and give what it prints")
    return touched(file, rows, xyz, offset)


def _places(file: Path) -> list[tuple[float, float]]:
    """X and Y of the points in their order, mm."""
    found: dict[int, tuple[float, float]] = {}
    for row, match in gcode_commands(file, _POINT):
        words = {letter.upper(): text for letter, text in _WORD.findall(match[2])}
        if wrong := words.keys() - set(LETTERS):
            hint = f"letters of G30 are {', '.join(LETTERS)}"
            raise DatasetError(f"G30 has no {min(wrong)}", file=file, row=row, column=min(wrong), hint=hint)
        for letter in "XY":
            if letter not in words:
                what = f"G30 P{match[1][:9]} without {letter}"
                raise DatasetError(what, file=file, row=row, column=letter, hint="give X and Y of each point")
        number, at = int(match[1][:9]), (decimal(words["X"], file, row, "X"), decimal(words["Y"], file, row, "Y"))
        if found.setdefault(number, at) != at:
            hint = "leave the G30 commands that were run, and only these"
            raise DatasetError(f"point P{number} is at another place above", file=file, row=row, column="P", hint=hint)
    if not found:
        raise DatasetError("there is no G30 P0 X... Y...", file=file, hint="give the bed.g that was run")
    if sorted(found) != list(range(len(found))):
        missing = next(number for number in range(len(found)) if number not in found)
        raise DatasetError(f"there is no G30 P{missing}", file=file, column="P", hint="give the bed.g that was run")
    return [found[number] for number in range(len(found))]
