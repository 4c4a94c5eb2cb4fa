"""The dimensions of a delta in RepRapFirmware's config.g, or config-override.g: M665, M666 and M92.

Source: src/Movement/Kinematics/LinearDeltaKinematics.cpp (Configure, Recalc) of github.com/Duet3D/RepRapFirmware. A later
command changes only the parameters that it names.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gtpin.errors import DatasetError
from gtpin.importers.gcode import gcode_commands
from gtpin.importers.lines import decimal
from gtpin.typing import Floats

ANGLES = (210.0, 330.0, 90.0)
"""Angles of the towers X, Y and Z, degrees, to which X, Y and Z of M665 are corrections."""
AXES = "XYZ"

_COMMAND = re.compile(r"\s*M(665|666|92)(?![\d.])(.*)", re.IGNORECASE)
_WORD = re.compile(r"([A-Z])\s*([^\sA-Z]+)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class RrfDelta:
    """Dimensions of a delta, mm and degrees.

    Parameters
    ----------
    radius
        R of M665.
    arms, angles, ends
        (3,) for the towers: L of M665, mm; angle about the middle of the bed from the x axis, degrees; H of M665 plus the
        tower's adjustment by M666, mm.
    steps
        (3,) steps per mm of M92.
    """

    radius: float
    arms: Floats
    angles: Floats
    ends: Floats
    steps: Floats


def read_rrf_delta(file: Path | str) -> RrfDelta:
    """Read the dimensions of a delta.

    Raises
    ------
    DatasetError
        If a dimension is missing or impossible, is set inside a condition or by an expression, or M666 tilts the bed.
    """
    file = Path(file)
    found: dict[str, tuple[list[float], int]] = {}
    for row, match in gcode_commands(file, _COMMAND):
        for letter, text in _WORD.findall(match[2]):
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
    return RrfDelta(
        of("M665 R"),
        np.array(arms),
        np.array([angle + of(f"M665 {axis}") for angle, axis in zip(ANGLES, AXES, strict=True)]),
        np.array([of("M665 H") + of(f"M666 {axis}") for axis in AXES]),
        np.array([of(f"M92 {axis}") for axis in AXES]),
    )
