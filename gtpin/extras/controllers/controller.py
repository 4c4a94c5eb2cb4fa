"""A controller: how it computes commands from positions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gtpin.compensation.machine import CompensatedMachine
from gtpin.errors import UnreachableError
from gtpin.export.box import Box
from gtpin.kinematics.inverse import commands_for
from gtpin.model.model import Model
from gtpin.typing import Floats

STEPS = 4
"""Steps of the iteration; each multiplies the distance from the wanted position by the relative error of the controller's
geometry, about 0.001."""


Controller = Callable[[Floats], Floats]
"""The kinematics of a controller: (N, n) commands, m or rad, for positions (N, 3) in its coordinates, m; NaN out of reach."""


def controller_of(model: Model, origin: Floats) -> Controller:
    """A controller with the kinematics of a model, without effects; ``origin``: (3,) its zero in the base frame, m."""

    def commands(xyz: Floats) -> Floats:
        return commands_for(model.kinematics, xyz + origin)[0]

    return commands


def positions_to_ask_for(machine: CompensatedMachine, controller: Controller, box: Box, wanted: Floats) -> Floats:
    """(N, 3) positions to command so that the machine's TCP reaches ``wanted`` (N, 3), controller's coordinates, m.

    Raises `UnreachableError` if the machine can't bring its TCP to one of them.
    """
    asked = wanted.copy()
    for _ in range(STEPS):
        asked = asked + wanted - there(machine, controller, box, asked)
    return asked


def there(
    machine: CompensatedMachine, controller: Controller, box: Box, asked: Floats, approach: Floats | None = None
) -> Floats:
    """(N, 3) positions that the machine's TCP reaches for commanded positions ``asked`` (N, 3), controller's coordinates, m.

    ``approach``: (N,) direction, +1 or -1, from which all actuators come to each position; None: the mean of both.

    Raises `UnreachableError` if the machine can't bring its TCP to one of them.
    """
    q = controller(asked)
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
