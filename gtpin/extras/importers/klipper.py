"""Touches that Klipper reports: of DELTA_CALIBRATE and of a bed mesh in printer.cfg, and single ones in klippy.log.

Formats and meanings: klippy/extras/delta_calibrate.py, bed_mesh.py and probe.py, and klippy/kinematics/delta.py, of
github.com/Klipper3d/klipper.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.data.ids import normal_ids
from gtpin.errors import DatasetError, warn
from gtpin.extras.importers.klipper_config import Option, Sections, needed, read_config
from gtpin.extras.importers.lines import decimal, decimals, text_lines
from gtpin.extras.importers.touches import FARTHEST, MILLIMETRE, Touches, check_size, touched
from gtpin.extras.importers.towers import ANGLES, Towers
from gtpin.typing import Floats

TOWERS = ("stepper_a", "stepper_b", "stepper_c")
FULL_STEPS = 200.0
"""Klipper's default number of full steps per turn."""

STRAIGHT = ("cartesian", "corexy")
"""Kinematics whose commands are x, y and z."""

_HEIGHT = re.compile(r"height(\d+)")
_OTHER = re.compile(r"(?:manual_height|distance)\d+")
EDGE = 1e-3
"""Largest distance, mm, by which a point at the edge of a round bed can be outside its radius, because the file is rounded."""
_BEGIN = re.compile(r"\bprobe:? at\s+[^\s,]*,")
_OLD = re.compile(r"\bprobe at\s+([^\s,]+),([^\s,]+)\s+is\s+z=(\S+)\s*$")
_NEW = re.compile(r"\bprobe: at\s+([^\s,]+),([^\s,]+)\s+bed will contact at\s+z=(\S+)\s*$")


def read_klipper_delta(file: Path | str) -> Touches:
    """Read the touches of DELTA_CALIBRATE from a printer.cfg, as SAVE_CONFIG writes them under ``[delta_calibrate]``.

    ``heightN`` is the nozzle's height over the bed at the touch (the probe's ``z_offset``), mm. ``heightN_pos`` are the steps
    of the drives of towers a, b and c down from their end stops; they do not depend on the geometry in the firmware.

    Raises `DatasetError` if the file is no configuration of a delta printer, has no such touches, or a touch is damaged.
    Warns: if there are heights measured by hand, or distances on a printed object: they are left out.
    """
    file = Path(file)
    sections = read_config(file)
    check_delta(sections, file)
    saved = sections.get("delta_calibrate", {})
    numbers = sorted(int(match[1]) for name in saved if (match := _HEIGHT.fullmatch(name)))
    if not numbers:
        hint = "run DELTA_CALIBRATE and SAVE_CONFIG, and give the printer.cfg"
        raise DatasetError("there are no touches (height0, height0_pos) in [delta_calibrate]", file=file, hint=hint)
    heights = [saved[f"height{number}"] for number in numbers]
    steps = np.array([needed(sections, "delta_calibrate", f"height{n}_pos", file).numbers(3) for n in numbers])
    if others := sorted(name for name in saved if _OTHER.fullmatch(name)):
        warn(f"{file}: left out, as they are no touches: {', '.join(others)}")
    row = np.array([saved[f"height{number}_pos"].row for number in numbers], dtype=np.int64)
    travel = MILLIMETRE * steps * [_step(sections, tower, file) for tower in TOWERS]
    check_size(travel, file, row)
    return Touches(
        file,
        row,
        normal_ids(numbers),
        position=_positions(tower_dimensions(sections, file), travel, file, row),
        travel=travel,
        height=MILLIMETRE * np.array([option.number() for option in heights]),
        bed=True,
    )


def check_delta(sections: Sections, file: Path) -> None:
    """Check that a configuration is that of a printer with three sliding carriages; raises `DatasetError`."""
    kinematics = needed(sections, "printer", "kinematics", file)
    if kinematics.text == "delta":
        return
    what = f"the printer's kinematics are {kinematics.text[:40]}, not delta"
    hint = "give the printer.cfg of a delta printer"
    if kinematics.text == "rotary_delta":
        what = "a rotary_delta: its drives turn the arms, and a step is an angle; gtpin reads steps of sliding carriages only"
        hint = "give single touches: gtpin import klipper-probe"
    raise kinematics.error(what, hint)


def _step(sections: Sections, tower: str, file: Path) -> float:
    """Travel of a drive per step, mm: see parse_step_distance in klippy/stepper.py."""
    options = sections.get(tower, {})
    if "step_distance" in options:  # Klipper's configurations until 2021
        return _positive(options["step_distance"])
    microsteps = _positive(needed(sections, tower, "microsteps", file))
    full = _positive(options["full_steps_per_rotation"]) if "full_steps_per_rotation" in options else FULL_STEPS
    ratio = 1.0  # such as 80:20; several, separated by commas, are multiplied
    if option := options.get("gear_ratio"):
        for pair in option.text.split(","):
            values = [decimal(text, option.file, option.row, option.name) for text in pair.split(":")]
            if len(values) != 2 or min(values) <= 0.0:
                raise option.error(f"{pair.strip()[:40]!r} is no gear ratio", "write it as 80:20")
            ratio *= values[0] / values[1]
    return _positive(needed(sections, tower, "rotation_distance", file)) / (full * microsteps * ratio)


def _positive(option: Option) -> float:
    value = option.number()
    if value <= 0.0:
        raise option.error(f"{option.text[:40]} can't be", "it is above 0")
    return value


def tower_dimensions(sections: Sections, file: Path) -> Towers:
    """The delta's dimensions.

    Raises `DatasetError` if an option is missing, or a dimension is impossible.
    """
    check_delta(sections, file)
    radius = _positive(needed(sections, "printer", "delta_radius", file))
    arms, ends, angles = np.empty(3), np.empty(3), np.empty(3)
    for i, tower in enumerate(TOWERS):
        options = sections.get(tower, {})
        # Lengths that are not given for a later tower are those of the first, as in Klipper.
        first = needed(sections, TOWERS[0], "arm_length", file), needed(sections, TOWERS[0], "position_endstop", file)
        arms[i] = _positive(options.get("arm_length", first[0]))
        ends[i] = options.get("position_endstop", first[1]).number()
        angles[i] = options["angle"].number() if "angle" in options else ANGLES[i]
        if not max(arms[i], abs(ends[i])) < FARTHEST / MILLIMETRE:
            raise DatasetError("a length that can't be", file=file, column=tower, hint="lengths are mm")
        if arms[i] <= radius:
            what, hint = f"arm_length {arms[i]:g} is not above delta_radius {radius:g}", "correct the configuration"
            raise DatasetError(what, file=file, column=f"{tower}.arm_length", hint=hint)
    return Towers.in_file(radius, arms, angles, ends)


def _positions(towers: Towers, travel: Floats, file: Path, rows: npt.NDArray[np.int64]) -> Floats:
    """(N, 3) nozzle, m, by the geometry of the file: the lower of the two points at arm's length from the three carriages."""
    feet, heights = np.broadcast_to(towers.feet, (*travel.shape, 2)), towers.tops - travel
    center = np.concatenate([feet, heights[:, :, None]], axis=2)
    # Differences of the equations of the three spheres are two planes. Their line intersects the first sphere in two points.
    normal = center[:, 1:] - center[:, :1]
    squares = towers.arms**2 - (center**2).sum(axis=2)
    right = 0.5 * (squares[:, :1] - squares[:, 1:])
    along = np.cross(normal[:, 0], normal[:, 1])
    point = np.einsum("nij,nj->ni", np.linalg.pinv(normal), right)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    away = point - center[:, 0]
    half = (away * along).sum(axis=1)
    inside = half**2 - (away**2).sum(axis=1) + towers.arms[0] ** 2
    if not (inside >= 0.0).all():
        row = int(rows[np.argmin(inside >= 0.0)])
        what = "the arms do not reach one another at these steps"
        raise DatasetError(what, file=file, row=row, hint="correct the line, or delete it")
    down = np.where(along[:, 2] > 0.0, -1.0, 1.0)
    found: Floats = point + (-half + down * np.sqrt(inside))[:, None] * along
    return found


def read_klipper_mesh(
    file: Path | str, profile: str = "default", offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Touches:
    """Read the touches of a bed mesh, as SAVE_CONFIG writes it into printer.cfg: ``[bed_mesh default]``, ``points`` on a grid.

    The first line of ``points`` is at ``min_y``, its first number at ``min_x``. Each number is the nozzle's command in z, mm,
    at which the nozzle itself would touch the bed: it includes the probe's offset. On a round bed Klipper fills the corners of
    the grid with the outermost probed number of their line; these points are left out.

    ``file``: printer.cfg, with ``[bed_mesh]`` and ``[bed_mesh PROFILE]``. ``profile``: the name of the mesh. ``offset``:
    ``x_offset y_offset z_offset`` of the printer's ``[probe]``, mm.

    Raises `DatasetError` if there is no such mesh, it is damaged, or the section ``[bed_mesh]``, from which it is known
    whether the bed is round, is missing.
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
    low, high = [], []  # of x and y, mm
    for axis in "xy":
        least, most = (needed(sections, name, f"{end}_{axis}", file) for end in ("min", "max"))
        if most.number() <= least.number():
            what = f"max_{axis} = {most.text[:40]} is not above min_{axis} = {least.text[:40]}"
            raise most.error(what, "restore the file")
        low.append(least.number())
        high.append(most.number())
    bed = sections["bed_mesh"]
    radius = bed["mesh_radius"].number() if "mesh_radius" in bed else np.inf  # of a round bed
    origin = bed["mesh_origin"].numbers(2) if "mesh_origin" in bed else [0.0, 0.0]
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
            if np.hypot(x - origin[0], y - origin[1]) <= radius + EDGE:
                rows.append(line.row)
                xyz.append([x - offset[0], y - offset[1], z + offset[2]])
    if not rows:
        raise DatasetError(
            "no point of the mesh is on the bed", file=file, column="mesh_radius", hint="check its unit, mm"
        )
    return replace(touched(file, rows, xyz, offset), carriages=_carriages(sections, MILLIMETRE * np.array(xyz), file))


def _carriages(sections: Sections, xyz: Floats, file: Path) -> Floats | None:
    """(N, 3) heights of the carriages of a delta, m, for nozzles at xyz (N, 3), m; of a machine whose axes are straight, xyz
    itself; None where the file does not tell."""
    kinematics = sections.get("printer", {}).get("kinematics")
    if kinematics is not None and kinematics.text in STRAIGHT:
        return xyz
    if kinematics is None or kinematics.text != "delta" or "arm_length" not in sections.get(TOWERS[0], {}):
        return None
    heights = tower_dimensions(sections, file).heights(xyz)
    return heights if np.isfinite(heights).all() else None


def _count(option: Option) -> int:
    value = option.number()
    if value != int(value) or not 2 <= value <= 1000:
        raise option.error(f"{option.text[:40]} can't be", "restore the file")
    return int(value)


def read_klipper_probe(file: Path | str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Touches:
    """Read all touches that a log reports, in its order; several samples of one point are several touches.

    Older versions write ``probe at X,Y is z=Z``: the nozzle's commands at the touch, mm. Newer ones write ``probe: at X,Y bed
    will contact at z=Z``: the point of the bed under the probe, and the nozzle's command at which the nozzle itself would touch
    it; it includes the probe's offset.

    ``file``: klippy.log, or the console's text; other text before a report in its line is ignored. ``offset``: ``x_offset
    y_offset z_offset`` of the printer's ``[probe]``, mm.

    Raises `DatasetError` if there is no report, or a report is damaged.
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
