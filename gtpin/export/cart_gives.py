"""How a cart gives way in one direction: a spring, what its place on the track adds, and friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.export.curves import Curve, waves
from gtpin.export.lines import line

Floats = npt.NDArray[np.float64]

PLACES = 4
"""Half waves along the track: as many as ``cart_compliance`` has."""
FREE = 0.2
"""Share of a load's spread that must not follow from the place, if both are to be told apart in one fit."""
WORTHWHILE = 2e-7
"""m or rad, root mean square: smaller parts are dropped."""


@dataclass(frozen=True)
class Give:
    """compliance times load, m or rad, what the place adds, and ``slip`` times the direction of approach."""

    compliance: float
    place: Curve
    slip: float

    def at(self, load: Floats, q: Floats, approach: Floats) -> Floats:
        """(N,) motion."""
        return np.asarray(self.compliance * load + self.place(q) + self.slip * approach)


def give(load: Floats, moved: Floats, tangent: float, q: Floats, ends: tuple[float, float], approach: Floats) -> Give:
    """The law through motions (N,) under loads, at commands, from directions of approach (N,), by least squares.

    The compliance is fitted alone where the load follows from the place: else a curve could take its part. ``tangent`` is
    the compliance where the load does not vary.
    """
    one = np.ones(len(q))
    compliance, rest = line(load, moved, tangent)
    simple = Give(compliance, Curve(rest, 0.0), 0.0)
    place = waves(q, load, ends, one, PLACES)
    own = load - place(q)
    if np.std(own) > FREE * np.std(load):
        # With the place and the approach taken from the load, its slope is that of a fit of all together.
        own = own - approach * float(own @ approach) / max(float(approach @ approach), 1.0)
        compliance = float(own @ moved) / float(own @ own)
    left = moved - compliance * load
    slip = float(left @ approach) / max(float(approach @ approach), 1.0)
    curve = waves(q, left - slip * approach, ends, one, PLACES)
    if abs(slip) < WORTHWHILE:
        slip = 0.0
    if np.std(curve(q)) < WORTHWHILE:
        curve = replace(curve, offset=float(np.mean(left)), harmonics=())
    full = Give(compliance, curve, slip)
    off, before = (np.std(law.at(load, q, approach) - moved) for law in (full, simple))
    return full if off + WORTHWHILE < before else simple
