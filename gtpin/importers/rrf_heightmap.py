"""RepRapFirmware's height map, ``heightmap.csv`` of G29: heights of the bed on a grid.

Source: src/Movement/BedProbing/Grid.cpp of github.com/Duet3D/RepRapFirmware (HeightMap::SaveToFile and LoadFromFile). A
line with the version, a line with names in one of three forms, a line with the grid, then the heights, mm, first line at
the smallest Y, first number at the smallest X. A height is the command of Z, without bed compensation, at which the nozzle
itself would touch the bed: the firmware has subtracted the trigger height. At a ``0`` without decimals nothing was probed.
"""

from __future__ import annotations

from pathlib import Path

from gtpin.errors import DatasetError
from gtpin.importers.lines import decimal, text_lines
from gtpin.importers.touches import Touches, touched

BEGIN = "RepRapFirmware height map file v"
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


def read_rrf_heightmap(file: Path | str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Touches:
    """Read the touches of a height map.

    Parameters
    ----------
    file
        ``heightmap.csv``.
    offset
        ``X Y Z`` of G31 in the printer's config.g, mm: the probe's position relative to the nozzle, and its trigger height.

    Raises
    ------
    DatasetError
        If the file is no height map, or damaged.
    """
    file = Path(file)
    lines = [line.strip() for line in text_lines(file)]
    if not lines[0].startswith(BEGIN):
        hint = "give a heightmap.csv that G29 of RepRapFirmware wrote"
        raise DatasetError(f"the first line does not begin with {BEGIN!r}", file=file, row=1, hint=hint)
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
    texts = line.split(",")
    if len(texts) != len(names):
        what = f"{len(texts)} values of the grid for {len(names)} names"
        raise DatasetError(what, file=file, row=3, hint="restore the file")
    given = dict(zip(names, texts, strict=True))
    axes = [given.pop(name).strip() for name in ("axis0", "axis1") if name in given]
    if axes not in ([], ["X", "Y"]):
        hint = "gtpin reads maps over X and Y"
        raise DatasetError(f"a map over {' and '.join(axes)[:20]}", file=file, row=3, column="axis0", hint=hint)
    grid = {name: decimal(text, file, 3, name) for name, text in given.items()}
    if "spacing" in grid:
        grid["xspacing"] = grid["yspacing"] = grid["spacing"]
    for name in ("xnum", "ynum"):
        if grid[name] != int(grid[name]) or grid[name] < 1 or grid["xnum"] * grid["ynum"] > MOST:
            raise DatasetError(
                f"{grid[name]:g} points can't be", file=file, row=3, column=name, hint="restore the file"
            )
    for axis in "xy":
        _check_axis(file, axis, grid[f"{axis}min"], grid[f"{axis}max"], grid[f"{axis}spacing"], int(grid[f"{axis}num"]))
    return grid


def _check_axis(file: Path, axis: str, low: float, high: float, spacing: float, count: int) -> None:
    """Check that the bounds, the spacing and the number of points of an axis agree.

    The firmware takes as many points as the spacing has room for from the lower bound: the last one can be below the upper.
    """
    if high <= low:
        what = f"{axis} goes from {low:g} to {high:g}"
        raise DatasetError(what, file=file, row=3, column=f"{axis}max", hint="restore the file")
    if spacing <= 0.0:
        what = f"a spacing of {spacing:g} can't be"
        raise DatasetError(what, file=file, row=3, column=f"{axis}spacing", hint="restore the file")
    rounded = ROUNDING * (count + 2)
    if not (count - 1) * spacing - rounded <= high - low <= count * spacing + rounded:
        what = f"{count} points {spacing:g} apart do not go from {low:g} to {high:g}"
        raise DatasetError(what, file=file, row=3, column=f"{axis}spacing", hint="restore the file")
