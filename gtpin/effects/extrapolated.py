"""Commands at which a fitted effect is extrapolated: outside the range of the commands that it was fitted to."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gtpin.effects.active import ActiveEffect
from gtpin.errors import warn
from gtpin.robot.robot import Robot
from gtpin.typing import Floats

MARGIN = 0.05
"""Share of the fit's range by which commands may be outside it without a warning. Assumed; it changes no prediction."""


def warn_of_extrapolation(effects: Iterable[ActiveEffect], robot: Robot, q: Floats) -> None:
    """Warn of effects of an actuator's travel at commands q (N, n), m or rad, outside the range of their fit.

    For robots with rods this range is not stored, and there is no warning.
    """
    for active in effects:
        low, high = active.references.commands
        if not active.effect.of_travel or active.only_measured or active.site not in robot.sites or not len(low):
            continue
        j = robot.sites.index(active.site)
        margin = MARGIN * float(high[j] - low[j])
        outside = int(((q[:, j] < low[j] - margin) | (q[:, j] > high[j] + margin)).sum())
        if outside:
            unit, factor = ("deg", 180.0 / np.pi) if robot.revolute[j] else ("m", 1.0)
            fitted = f"{low[j] * factor:.4g} to {high[j] * factor:.4g} {unit}"
            warn(
                f"{outside} of {len(q)} commands of {active.site} are outside {fitted}, where {active.name} was fitted: "
                "its deviation there is extrapolated, and can be wrong"
            )
