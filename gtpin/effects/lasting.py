"""Which fitted effects still hold on another day."""

from __future__ import annotations

from gtpin.effects.active import ActiveEffect
from gtpin.robot.robot import Robot

OF_ITS_DAY = frozenset(("session", "time"))
"""Covariates on which an effect of the instrument does not hold on another day."""


def lasts(active: ActiveEffect, robot: Robot) -> bool:
    """Whether an effect is neither a drift of the instrument nor a shift of it between sessions."""
    return not (active.site == "frame" and bool(OF_ITS_DAY & set(active.effect.covariates(robot, active.site))))
