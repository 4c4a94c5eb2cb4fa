"""Compliances as straight lines over the load, and how good the fit of an effect must be."""

from __future__ import annotations

import numpy as np

from gtpin.typing import Floats

STIFFEST = 1e-11
"""Smallest compliance, m/N or rad/(N m); a smaller or negative fitted one counts as zero."""
NO_LOAD = 1e-6
"""Smallest standard deviation of a load, N or N m, from which a compliance is fitted."""
WORTH = 0.5
"""Largest error of an exported effect's motion of the TCP, over this motion, both root mean square. With more, the effect is
left out of the file."""


def line(load: Floats, moved: Floats, tangent: float) -> tuple[float, float]:
    """Compliance, m/N or rad/(N m), and deflection without load, m or rad, of the line through deflections ``moved`` (N,) under
    loads (N,); the compliance ``tangent`` if the load does not vary."""
    if np.std(load) < NO_LOAD:
        return tangent, float(moved.mean() - tangent * load.mean())
    compliance, rest = np.polyfit(load, moved, 1)
    return float(compliance), float(rest)
