"""Straight lines of a load, fitted to compliances; and what a fit must be worth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

STIFFEST = 1e-11
"""Smallest compliance, m/N or rad/(N m); a smaller or negative fitted one counts as zero."""
NO_LOAD = 1e-6
"""N or N m: a load that varies by less shows no compliance."""
WORTH = 0.5
"""Largest share of an effect's motion of the TCP that a curve may leave; what leaves more is not held."""


def line(load: Floats, moved: Floats, tangent: float) -> tuple[float, float]:
    """Compliance and rest of the line through motions under loads (N,); ``tangent`` where the load does not vary."""
    if np.std(load) < NO_LOAD:
        return tangent, float(moved.mean() - tangent * load.mean())
    compliance, rest = np.polyfit(load, moved, 1)
    return float(compliance), float(rest)
