"""Commands from the recorded travel of the drives, which have any order, sign and zero."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from gtpin.errors import DatasetError
from gtpin.typing import Floats

ALIKE = 0.05
"""Largest root mean square (rms) difference of the nominal robot's commands from the recorded travel, over the rms travel. It
is smaller where the dimensions are known to a few per cent; for wrongly assigned drives it is about 1. Assumed."""
FEWEST = 3
"""Fewest touches from which order and sign of the drives are determined."""


def by_travel(q: Floats, travel: Floats, file: Path, robot: str) -> Floats:
    """Commands (N, n) from the drives' travel (N, n): order, signs and zeros are found by comparison with the commands ``q``.

    Parameters
    ----------
    q
        (N, n) commands of the nominal robot at the same touches, m.
    travel
        (N, n) recorded travel, m.
    file, robot
        File and robot for error messages.

    Raises
    ------
    DatasetError
        If the travel of a drive agrees with no actuator: the robot is another machine.
    """
    if len(q) < FEWEST or q.shape != travel.shape:
        what = f"{len(q)} touches with {travel.shape[1]} drives, for a robot of {q.shape[1]} actuators"
        raise DatasetError(what, file=file, hint=f"give the robot of this printer, and {FEWEST} touches at least")
    commanded, moved = q - q.mean(axis=0), travel - travel.mean(axis=0)
    spread = np.sqrt((moved**2).mean())
    same = np.sqrt(((commanded[:, :, None] - moved[:, None, :]) ** 2).mean(axis=0))
    other = np.sqrt(((commanded[:, :, None] + moved[:, None, :]) ** 2).mean(axis=0))
    apart = np.minimum(same, other)
    actuator, drive = linear_sum_assignment(apart)
    worst = float(apart[actuator, drive].max())
    if not worst <= ALIKE * spread:
        what = f"the carriages of {robot} would travel otherwise than those of this printer, by {1e3 * worst:.3g} mm"
        raise DatasetError(what, file=file, hint="give a robot with the dimensions that this file has")
    sign = np.where(same <= other, 1.0, -1.0)[actuator, drive]
    found: Floats = q.mean(axis=0) + sign * moved[:, drive]
    return found
