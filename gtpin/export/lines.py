"""Functions that simulators have, fitted to effects: straight lines of a load, polynomials of a coordinate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Chebyshev, Polynomial

Floats = npt.NDArray[np.float64]

__all__ = ["DEGREE", "STIFFEST", "WORTH", "Polynomial", "line", "quartic"]

STIFFEST = 1e-11
"""Smallest compliance, m/N or rad/(N m); a smaller or negative fitted one counts as zero."""
NO_LOAD = 1e-6
"""Smallest variation of a load, N or N m, from which a compliance is fitted."""
DEGREE = 4
"""Degree of MuJoCo's polynomials."""
WORTH = 0.5
"""Largest share of an effect's motion of the TCP that a polynomial may leave; otherwise the effect is left out."""


def line(load: Floats, moved: Floats, tangent: float) -> tuple[float, float]:
    """Compliance and rest of the line through motions under loads (N,); ``tangent`` where the load does not vary."""
    if np.std(load) < NO_LOAD:
        return tangent, float(moved.mean() - tangent * load.mean())
    compliance, rest = np.polyfit(load, moved, 1)
    return float(compliance), float(rest)


def quartic(x: Floats, values: Floats, weight: Floats | None = None) -> Polynomial:
    """Polynomial of fourth degree through values (N,) at coordinates x (N,), by least squares."""
    fitted = Chebyshev.fit(x, values, DEGREE, w=weight)
    return fitted.convert(kind=Polynomial, domain=[-1.0, 1.0], window=[-1.0, 1.0])
