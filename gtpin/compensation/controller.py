"""The kinematics of a controller: how it computes commands from positions, by its own geometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from gtpin.compensation.box import Box
from gtpin.compensation.machine import Machine
from gtpin.errors import UnreachableError
from gtpin.kinematics.inverse import commands_for
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]

STEPS = 4
"""Corrections of a position; each leaves about a thousandth, the relative error of the geometry, of the distance."""


class Controller(Protocol):
    """A controller's kinematics."""

    def commands(self, xyz: Floats) -> Floats:
        """(N, n) commands for positions (N, 3) in its own coordinates, m or rad; NaN where there are none."""
        ...


@dataclass(frozen=True, eq=False)
class ModelController:
    """A controller that has the kinematics of a model.

    Parameters
    ----------
    model
        Its geometry; its effects are ignored.
    origin
        (3,) zero of the controller's coordinates in the base frame, m.
    """

    model: Model
    origin: Floats

    def commands(self, xyz: Floats) -> Floats:
        """(N, n) commands for positions (N, 3), m or rad; NaN where there are none."""
        return commands_for(self.model.kinematics, xyz + self.origin)[0]


def positions_to_ask_for(machine: Machine, controller: Controller, box: Box, wanted: Floats) -> Floats:
    """(N, 3) positions to command so that the TCP reaches ``wanted`` (N, 3); both in the controller's coordinates, m.

    Raises
    ------
    UnreachableError
        If the machine can't bring its TCP to one of them.
    """
    asked = wanted.copy()
    for _ in range(STEPS):
        asked = asked + wanted - there(machine, controller, box, asked)
    return asked


def there(machine: Machine, controller: Controller, box: Box, asked: Floats, approach: Floats | None = None) -> Floats:
    """(N, 3) positions that the TCP reaches for commanded positions ``asked`` (N, 3), controller's coordinates, m; see
    `Machine.goes_to`."""
    q = controller.commands(asked)
    inside = np.isfinite(q).all(axis=1)
    found = np.full_like(asked, np.nan)
    found[inside] = machine.goes_to(q[inside], None if approach is None else approach[inside])
    lost = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if lost.size:
        where = ", ".join(f"{value:.4g}" for value in asked[lost[0]])
        raise UnreachableError(
            f"{machine.model.robot.name} can't bring its TCP to ({where}) of the controller",
            hint="give a smaller --box, and the --origin of the controller's coordinates",
        )
    return found - box.origin
