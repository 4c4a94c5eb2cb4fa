"""What RepRapFirmware writes: heights of the bed (heightmap.csv of G29, reports of G32), and a delta's dimensions.

Sources, in src/Movement of github.com/Duet3D/RepRapFirmware: BedProbing/Grid.cpp (HeightMap::SaveToFile and LoadFromFile),
BedProbing/RandomProbePointSet.cpp (ReportProbeHeights), Kinematics/LinearDeltaKinematics.cpp (Configure, Recalc).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from gtpin.errors import DatasetError
from gtpin.extras.importers.lines import decimal, gcode_commands, text_lines
from gtpin.extras.importers.touches import Touches, touched
from gtpin.extras.importers.towers import ANGLES, Towers
from gtpin.typing import Floats

MAP = "RepRapFirmware height map file v"
LABELS = {
    "xmin,xmax,ymin,ymax,radius,spacing,xnum,ynum": "xmin xmax ymin ymax radius spacing xnum ynum",
    "xmin,xmax,ymin,ymax,radius,xspacing,yspacing,xnum,ynum": "xmin xmax ymin ymax radius xspacing yspacing xnum ynum",
    "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1": "axis0 axis1 xmin xmax ymin ymax radius "
    "xspacing yspacing xnum ynum",
}
"""The line with names, of three versions of the firmware, and gtpin's names of these numbers."""
ROUNDING = 0.01
"""Largest error of a bound or a spacing by rounding, mm: they have two decimals, and older files one."""
MOST = 10_000
"""Largest number of points; with more, the line with the grid is assumed to be damaged."""
HEIGHTS = "G32 bed probe heights:"
FAILED = "probing failed"
LETTERS = "PXYZHKS"
"""Letters of G30's parameters."""
_POINT = re.compile(r"\s*G30\s+P(\d+\b|\{[^}]*\})(.*)", re.IGNORECASE)
_WORD = re.compile(r"([A-Z])\s*([^\sA-Z;]+)", re.IGNORECASE)
_ONE_HEIGHT = re.compile(rf"{FAILED}|not set|\S+")
AXES = "XYZ"
_COMMAND = re.compile(r"\s*M(665|666|92)(?![\d.])(.*)", re.IGNORECASE)
_LENGTHS = re.compile(r"([A-Z])\s*([^\sA-Z]+)", re.IGNORECASE)


def read_rrf_heightmap(file: Path | str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Touches:
    """Read the touches of a height map.

    A line with the version, a line with names in one of three forms, a line with the grid, then the heights, mm, first line at
    the smallest Y, first number at the smallest X. A height is the command of Z, without bed compensation, at which the nozzle
    itself would touch the bed: the firmware has subtracted the trigger height. At a ``0`` without decimals nothing was probed.

    ``file``: ``heightmap.csv``. ``offset``: ``X Y Z`` of G31 in the printer's config.g, mm: the probe's position relative
    to the nozzle, and its trigger height.

    Raises `DatasetError` if the file is no height map, or damaged.
    """
    file = Path(file)
    lines = [line.strip() for line in text_lines(file)]
    if not lines[0].startswith(MAP):
        hint = "give a heightmap.csv that G29 of RepRapFirmware wrote"
        raise DatasetError(f"the first line does not begin with {MAP!r}", file=file, row=1, hint=hint)
    label = lines[1] if len(lines) > 1 else ""
    if label not in LABELS:
        raise DatasetError("the line of names is none of a height map", file=file, row=2, hint="restore the file")
    grid = _grid(file, LABELS[label].split(), lines[2] if len(lines) > 2 else "")
    nx, ny = int(grid["xnum"]), int(grid["ynum"])
    heights = lines[3:]
    while heights and not heights[-1]:
        heights.pop()
    if len(heights) != ny:
        what = f"{len(heights)} lines of heights where the third line has {ny}"
        raise DatasetError(what, file=file, row=len(heights) + 3, hint="restore the file")
    rows, xyz = [], []
    for i, line in enumerate(heights):
        row, texts = i + 4, line.split(",")
        if len(texts) != nx:
            what = f"{len(texts)} heights where the third line has {nx}"
            raise DatasetError(what, file=file, row=row, hint="restore the file")
        for j, text in enumerate(texts):
            if text.strip() == "0":
                continue
            x, y = grid["xmin"] + j * grid["xspacing"], grid["ymin"] + i * grid["yspacing"]
            z = decimal(text, file, row, str(j + 1))
            rows.append(row)
            xyz.append([x - offset[0], y - offset[1], z + offset[2]])
    if not rows:
        raise DatasetError("no point of the map was probed", file=file, hint="run G29, and give the new file")
    return touched(file, rows, xyz, offset)


def _grid(file: Path, names: list[str], line: str) -> dict[str, float]:
    """The numbers of the third line by name, mm; raises `DatasetError` where they do not agree."""

    def check(right: bool, what: str, column: str | None = None, hint: str = "restore the file") -> None:
        if not right:
            raise DatasetError(what, file=file, row=3, column=column, hint=hint)

    texts = line.split(",")
    check(len(texts) == len(names), f"{len(texts)} values of the grid for {len(names)} names")
    given = dict(zip(names, texts, strict=True))
    axes = [given.pop(name).strip() for name in ("axis0", "axis1") if name in given]
    only = "gtpin reads maps over X and Y"
    check(axes in ([], ["X", "Y"]), f"a map over {' and '.join(axes)[:20]}", "axis0", only)
    grid = {name: decimal(text, file, 3, name) for name, text in given.items()}
    if "spacing" in grid:
        grid["xspacing"] = grid["yspacing"] = grid["spacing"]
    for name in ("xnum", "ynum"):
        some = grid[name] == int(grid[name]) and grid[name] >= 1 and grid["xnum"] * grid["ynum"] <= MOST
        check(some, f"{grid[name]:g} points can't be", name)
    for axis in "xy":
        low, high, spacing = grid[f"{axis}min"], grid[f"{axis}max"], grid[f"{axis}spacing"]
        check(low < high, f"{axis} goes from {low:g} to {high:g}", f"{axis}max")
        check(spacing > 0.0, f"a spacing of {spacing:g} can't be", f"{axis}spacing")
        # The firmware takes as many points as the spacing has room for: the last one can be below the upper bound.
        count = int(grid[f"{axis}num"])
        rounded = ROUNDING * (count + 2)
        agree = (count - 1) * spacing - rounded <= high - low <= count * spacing + rounded
        check(agree, f"{count} points {spacing:g} apart do not go from {low:g} to {high:g}", f"{axis}spacing")
    return grid


def read_rrf_g32(file: Path | str, points: Path | str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Touches:
    """Read the touches of all reports ``G32 bed probe heights: 0.012 -0.031 ...`` in a text, without failed points.

    They are printed where the last ``G30`` of bed.g has ``S-1``. Heights are in the order of the points P0, P1, ..., mm, and
    have the same meaning as those of a height map. X and Y are in bed.g: ``G30 P0 X0 Y115 Z-99999``.

    ``file``: the console's text; other text before a report in its line is ignored. ``points``: bed.g, or any file with its
    ``G30 P...`` commands. ``offset``: ``X Y Z`` of G31 in the printer's config.g, mm.

    Raises `DatasetError` if there is no report, or a report is damaged or has another number of points.
    """
    file, points = Path(file), Path(points)
    places = _places(points)
    rows, xyz, reports = [], [], 0
    for row, line in enumerate(text_lines(file), 1):
        at = line.find(HEIGHTS)
        if at < 0:
            continue
        reports += 1
        told, comma, _ = line[at + len(HEIGHTS) :].partition(", mean ")
        if not comma:
            raise DatasetError("the report is not whole", file=file, row=row, hint="delete the line, or run G32 again")
        heights = _ONE_HEIGHT.findall(told)
        if len(heights) != len(places):
            what = f"{len(heights)} heights for the {len(places)} points of {points.name}"
            raise DatasetError(what, file=file, row=row, hint="give the bed.g that was run")
        for number, (text, (x, y)) in enumerate(zip(heights, places, strict=True), 1):
            if text == FAILED:
                continue
            rows.append(row)
            xyz.append([x - offset[0], y - offset[1], decimal(text, file, row, str(number)) + offset[2]])
    if not rows:
        what = f"no line has {HEIGHTS!r}" if not reports else "probing failed at all points"
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


def read_rrf_delta(file: Path | str) -> tuple[Towers, Floats]:
    """Read the dimensions of a delta in config.g, or config-override.g: M665, M666, and (3,) steps per mm, M92.

    A later command changes only the parameters that it names.

    Raises `DatasetError` if a dimension is missing or impossible, is set inside a condition or by an expression, or M666
    tilts the bed.
    """
    file = Path(file)
    found: dict[str, tuple[list[float], int]] = {}
    for row, match in gcode_commands(file, _COMMAND):
        for letter, text in _LENGTHS.findall(match[2]):
            name = f"M{match[1]} {letter.upper()}"
            found[name] = ([decimal(part, file, row, name) for part in text.split(":")], row)
    needed = ["M665 R", "M665 L", "M665 H", *(f"M92 {axis}" for axis in AXES)]
    for name in needed:
        if name not in found:
            hint = "give the config.g of a delta with M665 (L, R, H) and M92 (X, Y, Z)"
            raise DatasetError(f"{name.replace(' ', ' has no ', 1)}", file=file, column=name, hint=hint)
    if any(found[name][0][0] for name in ("M666 A", "M666 B") if name in found):
        what, hint = "M666 tilts the bed", "set A and B to 0: the table of heights holds a tilt"
        raise DatasetError(what, file=file, row=found.get("M666 A", found.get("M666 B", ([], 0)))[1], hint=hint)

    def of(name: str) -> float:
        return found[name][0][0] if name in found else 0.0

    arms = found["M665 L"][0]
    arms = arms * 3 if len(arms) == 1 else arms
    if len(arms) != 3 or min(arms) <= of("M665 R") or min(of(f"M92 {axis}") for axis in AXES) <= 0.0:
        what, hint = "a dimension can't be", "three arms or one (L), longer than the radius (R), and steps above 0"
        raise DatasetError(what, file=file, row=found["M665 L"][1], column="M665 L", hint=hint)
    angles = [angle + of(f"M665 {axis}") for angle, axis in zip(ANGLES, AXES, strict=True)]
    towers = Towers.in_file(of("M665 R"), arms, angles, [of("M665 H") + of(f"M666 {axis}") for axis in AXES])
    return towers, np.array([of(f"M92 {axis}") for axis in AXES])
