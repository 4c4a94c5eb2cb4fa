"""The deflection of a cart along or about one axis: a spring, a curve over the place on the track, and friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gtpin.export.curves import Curve, waves
from gtpin.export.lines import line
from gtpin.typing import Floats

PLACES = 4
"""Number of half waves along the track: as many as ``cart_compliance`` has."""
FREE = 0.2
"""Part of the load's standard deviation that must not follow from the place on the track. With less, one fit can't separate the
compliance from the curve over the place."""
WORTHWHILE = 2e-7
"""Root mean square, m or rad, below which a part of the deflection is dropped."""


@dataclass(frozen=True)
class Give:
    """The deflection, m or rad: compliance * load + place(q) + slip * direction of approach.

    ``compliance`` in m/N or rad/(N m); ``place``: a curve over the cart's command; ``slip`` in m or rad.
    """

    compliance: float
    place: Curve
    slip: float

    def at(self, load: Floats, q: Floats, approach: Floats) -> Floats:
        """(N,) deflection, m or rad, under loads (N,), N or N m, at commands (N,), from directions of approach (N,), +1 or
        -1."""
        return np.asarray(self.compliance * load + self.place(q) + self.slip * approach)


def give(load: Floats, moved: Floats, tangent: float, q: Floats, ends: tuple[float, float], approach: Floats) -> Give:
    """The law fitted by least squares to deflections ``moved`` (N,) under loads, at commands, from directions of approach (N,).

    Where the load follows from the place on the track, the compliance is fitted first and alone. Otherwise the curve over the
    place could take over a part of it. ``tangent`` is the compliance to use where the load does not vary; ``ends``: the range
    of the cart's commands.
    """
    one = np.ones(len(q))
    compliance, rest = line(load, moved, tangent)
    simple = Give(compliance, Curve(rest, 0.0), 0.0)
    place = waves(q, load, ends, one, PLACES)
    own = load - place(q)
    if np.std(own) > FREE * np.std(load):
        # The load without its fit by place and approach: the slope over it is the compliance of a fit of all three together.
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
