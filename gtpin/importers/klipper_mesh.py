"""Klipper's bed mesh, as SAVE_CONFIG writes it into printer.cfg: ``[bed_mesh default]`` with ``points`` on a grid.

Source: klippy/extras/bed_mesh.py of github.com/Klipper3d/klipper. The first line of ``points`` is at ``min_y``, its first
number at ``min_x``. Each number is the nozzle's command in z, mm, at which the nozzle itself would touch the bed: it includes
the probe's offset. On a round bed Klipper fills the corners of the grid with the outermost probed number of their line; these
points are left out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gtpin.errors import DatasetError
from gtpin.importers.klipper_config import Option, Sections, needed, read_config
from gtpin.importers.lines import decimal
from gtpin.importers.touches import Touches, touched

ROUNDING = 1e-3
"""Largest distance, mm, by which a point at the edge of a round bed can be outside its radius, because the file is rounded."""


def read_klipper_mesh(
    file: Path | str, profile: str = "default", offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Touches:
    """Read the touches of a saved bed mesh.

    Parameters
    ----------
    file
        printer.cfg, with ``[bed_mesh]`` and ``[bed_mesh PROFILE]``.
    profile
        The name of the mesh.
    offset
        ``x_offset y_offset z_offset`` of the printer's ``[probe]``, mm.

    Raises
    ------
    DatasetError
        If there is no such mesh, it is damaged, or the section ``[bed_mesh]``, from which it is known whether the bed is
        round, is missing.
    """
    file = Path(file)
    sections = read_config(file)
    name = f"bed_mesh {profile}"
    if name not in sections:
        known = ", ".join(sorted(key for key in sections if key.startswith("bed_mesh "))) or "none"
        raise DatasetError(f"there is no [{name}]", file=file, column="bed_mesh", hint=f"saved are: {known}")
    if "bed_mesh" not in sections:
        hint = "give the whole printer.cfg: [bed_mesh] says whether the bed is round"
        raise DatasetError("[bed_mesh] is missing", file=file, column="bed_mesh", hint=hint)
    nx, ny = (_count(needed(sections, name, f"{axis}_count", file)) for axis in "xy")
    (low, high) = zip(*(_bounds(sections, name, axis, file) for axis in "xy"), strict=True)
    radius, origin = _round(sections)
    lines = [line for line in needed(sections, name, "points", file).lines if line.text]
    if len(lines) != ny:
        what = f"{len(lines)} lines of points where y_count is {ny}"
        raise DatasetError(
            what, file=file, row=lines[0].row if lines else None, column="points", hint="restore the file"
        )
    rows, xyz = [], []
    for line, y in zip(lines, np.linspace(low[1], high[1], ny), strict=True):
        texts = line.text.split(",")
        if len(texts) != nx:
            what = f"{len(texts)} points in the line where x_count is {nx}"
            raise DatasetError(what, file=line.file, row=line.row, column="points", hint="restore the file")
        for text, x in zip(texts, np.linspace(low[0], high[0], nx), strict=True):
            z = decimal(text, line.file, line.row, "points")
            if np.hypot(x - origin[0], y - origin[1]) <= radius + ROUNDING:
                rows.append(line.row)
                xyz.append([x - offset[0], y - offset[1], z + offset[2]])
    if not rows:
        raise DatasetError(
            "no point of the mesh is on the bed", file=file, column="mesh_radius", hint="check its unit, mm"
        )
    return touched(file, rows, xyz, offset)


def _round(sections: Sections) -> tuple[float, list[float]]:
    """Radius and middle of a round bed, mm; for any other bed the radius is infinite."""
    options = sections["bed_mesh"]
    radius = options["mesh_radius"].number() if "mesh_radius" in options else np.inf
    return radius, options["mesh_origin"].numbers(2) if "mesh_origin" in options else [0.0, 0.0]


def _bounds(sections: Sections, name: str, axis: str, file: Path) -> tuple[float, float]:
    """Smallest and largest x or y of a mesh, mm."""
    low, high = (needed(sections, name, f"{end}_{axis}", file) for end in ("min", "max"))
    if high.number() <= low.number():
        what = f"max_{axis} = {high.text[:40]} is not above min_{axis} = {low.text[:40]}"
        raise DatasetError(what, file=high.file, row=high.row, column=high.name, hint="restore the file")
    return low.number(), high.number()


def _count(option: Option) -> int:
    value = option.number()
    if value != int(value) or not 2 <= value <= 1000:
        what, hint = f"{option.text[:40]} can't be", "restore the file"
        raise DatasetError(what, file=option.file, row=option.row, column=option.name, hint=hint)
    return int(value)
