"""Warnings after a fit to readings of values farther from nominal than priors allow: parameters, geometry, unknowns."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.observability import UNSEEN, Observability
from gtpin.distributions import chi2
from gtpin.errors import warn
from gtpin.instruments.readings import Readings
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

STRAYED = 6.0
"""Deviation of a parameter from nominal, in units of the tolerances, and of an unknown from what is declared, in prior
sigmas, that is worth a warning. Assumed."""
CHANCE = 1e-6
"""Probability, by the tolerances, of a geometry that is at least as far from nominal as a whole, below which something is
declared wrongly. Assumed."""
SHOWN = 5
"""Largest number of names in a warning."""


def warn_of_strayed(x: Floats, geometry: Geometry, seen: Observability, readings: Readings) -> None:
    """Warn of parameters and unknowns that are farther from their nominal or declared values than their priors allow.

    ``x``: (p,) deviations of the geometry's parameters, in units of the tolerances. ``geometry``: the nominal geometry.
    ``seen``: observability of the geometry with these readings. ``readings``: the readings, with the fitted values of the
    unknowns.
    """
    if names := _far(x, geometry.names):
        warn(f"parameters more than {STRAYED:g} tolerances from nominal: {names}")
    elif (chance := whole_chance(x, seen)) < CHANCE:
        text = f"the geometry as a whole is farther from nominal than its tolerances allow (chance {chance:.1g})"
        hint = "check commands, known distances, and what is declared of the instruments, or give larger tolerances"
        warn(f"{text}: {hint}; an effect that the geometry takes up may do this as well")
    names = _far(readings.deviation, [unknown.name for unknown in readings.unknowns])
    if names:
        hint = "correct what it declares, or give larger prior sigmas"
        warn(f"unknowns more than {STRAYED:g} prior sigmas from what dataset.toml declares: {names}: {hint}")


def whole_chance(x: Floats, seen: Observability) -> float:
    """Probability, by chi-square, of deviations from nominal at least as large as x (p,), in units of the tolerances.

    Along a direction with the variance reduction l, the estimate has the variance l, in units of the squared tolerances.
    """
    told = seen.learned > UNSEEN
    along = seen.directions[:, told].T @ x
    return float(chi2.sf(float((along**2 / seen.learned[told]).sum()), max(int(told.sum()), 1)))


def _far(values: Floats, names: list[str] | tuple[str, ...]) -> str:
    """Names and values of those that are far from 0, the farthest first."""
    far = np.flatnonzero(np.abs(values) > STRAYED)
    order = far[np.argsort(-np.abs(values[far]))]
    more = f" and {len(order) - SHOWN} more" if len(order) > SHOWN else ""
    return ", ".join(f"{names[i]} ({values[i]:+.0f})" for i in order[:SHOWN]) + more
