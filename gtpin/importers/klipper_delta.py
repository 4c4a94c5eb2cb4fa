"""Klipper's ``[delta_calibrate]``: the steps of the drives at each touch, as SAVE_CONFIG writes them into printer.cfg.

Format and meaning: klippy/extras/delta_calibrate.py and klippy/kinematics/delta.py of github.com/Klipper3d/klipper.
``heightN`` is the nozzle's height over the bed at the touch (the probe's ``z_offset``), mm. ``heightN_pos`` are the steps of
the drives of towers a, b and c down from their end stops; they do not depend on the geometry in the firmware.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.errors import DatasetError, warn
from gtpin.importers.klipper_config import Option, Sections, needed, read_config
from gtpin.importers.lines import decimal
from gtpin.importers.touches import FARTHEST, MILLIMETRE, Touches, check_size
from gtpin.typing import Floats

TOWERS = ("stepper_a", "stepper_b", "stepper_c")
ANGLES = (210.0, 330.0, 90.0)
"""Klipper's default angles of the towers about the middle of the bed, from the x axis, degrees."""
FULL_STEPS = 200.0
"""Klipper's default number of full steps per turn."""

_HEIGHT = re.compile(r"height(\d+)")
_OTHER = re.compile(r"(?:manual_height|distance)\d+")


def read_klipper_delta(file: Path | str) -> Touches:
    """Read the touches of DELTA_CALIBRATE from a printer.cfg.

    Raises
    ------
    DatasetError
        If the file is no configuration of a delta printer, has no such touches, or a touch is damaged.

    Warns
    -----
    GtpinWarning
        If there are heights measured by hand, or distances on a printed object: they are left out.
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
    travel = steps * [_step(sections, tower, file) for tower in TOWERS]
    check_size(MILLIMETRE * travel, file, row)
    return Touches(
        file,
        row,
        np.array([str(number) for number in numbers], dtype=object),
        position=MILLIMETRE * _positions(sections, travel, file, row),
        travel=MILLIMETRE * travel,
        height=MILLIMETRE * np.array([option.number() for option in heights]),
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
    raise DatasetError(what, file=kinematics.file, row=kinematics.row, column="kinematics", hint=hint)


def _step(sections: Sections, tower: str, file: Path) -> float:
    """Travel of a drive per step, mm: see parse_step_distance in klippy/stepper.py."""
    options = sections.get(tower, {})
    if "step_distance" in options:  # Klipper's configurations until 2021
        return _positive(options["step_distance"])
    microsteps = _positive(needed(sections, tower, "microsteps", file))
    full = _positive(options["full_steps_per_rotation"]) if "full_steps_per_rotation" in options else FULL_STEPS
    ratio = _ratio(options["gear_ratio"]) if "gear_ratio" in options else 1.0
    return _positive(needed(sections, tower, "rotation_distance", file)) / (full * microsteps * ratio)


def _ratio(option: Option) -> float:
    """A gear ratio such as 80:20; several, separated by commas, are multiplied."""
    ratio = 1.0
    for pair in option.text.split(","):
        values = [decimal(text, option.file, option.row, option.name) for text in pair.split(":")]
        if len(values) != 2 or min(values) <= 0.0:
            what = f"{pair.strip()[:40]!r} is no gear ratio"
            raise DatasetError(what, file=option.file, row=option.row, column=option.name, hint="write it as 80:20")
        ratio *= values[0] / values[1]
    return ratio


def _positive(option: Option) -> float:
    value = option.number()
    if value <= 0.0:
        what = f"{option.text[:40]} can't be"
        raise DatasetError(what, file=option.file, row=option.row, column=option.name, hint="it is above 0")
    return value


def tower_dimensions(sections: Sections, file: Path) -> tuple[float, Floats, Floats, Floats]:
    """The delta's radius, mm, and (3,) for the towers: arm length, mm; position of the end stop, mm; angle, degrees.

    Raises
    ------
    DatasetError
        If an option is missing, or a dimension is impossible.
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
    return radius, arms, ends, angles


def _positions(sections: Sections, travel: Floats, file: Path, rows: npt.NDArray[np.int64]) -> Floats:
    """(N, 3) nozzle, mm, by the geometry of the file: the lower of the two points at arm's length from the three carriages."""
    radius, arms, ends, angles = tower_dimensions(sections, file)
    foot = radius * np.column_stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))])
    height = ends + np.sqrt(arms**2 - radius**2) - travel
    center = np.concatenate([np.broadcast_to(foot, (*travel.shape, 2)), height[:, :, None]], axis=2)
    # Differences of the equations of the three spheres are two planes. Their line intersects the first sphere in two points.
    normal = center[:, 1:] - center[:, :1]
    squares = arms**2 - (center**2).sum(axis=2)
    right = 0.5 * (squares[:, :1] - squares[:, 1:])
    along = np.cross(normal[:, 0], normal[:, 1])
    point = np.einsum("nij,nj->ni", np.linalg.pinv(normal), right)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    away = point - center[:, 0]
    half = (away * along).sum(axis=1)
    inside = half**2 - (away**2).sum(axis=1) + arms[0] ** 2
    if not (inside >= 0.0).all():
        row = int(rows[np.argmin(inside >= 0.0)])
        what = "the arms do not reach one another at these steps"
        raise DatasetError(what, file=file, row=row, hint="correct the line, or delete it")
    down = np.where(along[:, 2] > 0.0, -1.0, 1.0)
    found: Floats = point + (-half + down * np.sqrt(inside))[:, None] * along
    return found
