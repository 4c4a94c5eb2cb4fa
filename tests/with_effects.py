"""Models with effects of coefficients that a test chooses, as a fit would have left them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import gtpin
from gtpin.data.table import Column
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints

OF_GANTRY = (
    ("gantry_tau", "backlash", "cart2", 5e-5),  # a drive that overshoots
    ("gantry_tau", "linearity", "cart2", 5e-5),
    ("gantry_tau", "encoder_scale", "cart3", 2e-4),
    ("gantry_tau", "straightness", "cart1", 5e-5),
    ("gantry_tau", "cart_rotation", "cart3", 2e-4),
    ("gantry_tau", "cart_compliance", "cart3", 2e-7),
    ("gantry_tau", "link_compliance", "arm", 1e-7),
)
"""Effects that MJCF holds: robot, effect, site, the first coefficient."""


def active(
    model: gtpin.Model,
    q: np.ndarray,
    effect: str,
    site: str,
    shape_parameter: float | None = None,
    covariates: dict[str, Column] | None = None,
    first: float = 0.0,
    drawn: Callable[[np.ndarray], np.ndarray] | None = None,
    **parameters: float,
) -> ActiveEffect:
    """An effect whose named parameters have the values given, its first coefficient too, and whose others are zero.

    ``drawn``: gives all coefficients for their prior sigmas. Its references are those of a fit at commands q (N, n) with the
    covariates.
    """
    kind = effects_by_id()[effect]
    at = OperatingPoints(model.kinematics, q, model.kinematics.forward(q), covariates or {})  # type: ignore[arg-type]
    sigma = kind.basis(at, site, shape_parameter).sigma
    size = len(sigma)
    coefficients = first * np.eye(size)[0] if drawn is None else drawn(sigma)
    for name, value in parameters.items():
        coefficients[_place(kind, name, size, shape_parameter)] = value
    return ActiveEffect(kind, site, shape_parameter, coefficients, np.zeros((size, size)), at.references)


def _place(kind: object, name: str, size: int, shape_parameter: float | None) -> int:
    """Which coefficient a parameter tells: the first that it answers to one to one."""
    for place, unit in enumerate(np.eye(size)):
        told = kind.parameters(unit, shape_parameter)  # type: ignore[attr-defined]
        if name in told and np.isclose(told[name][0], 1.0):
            return place
    raise AssertionError(f"no coefficient is {name}")
