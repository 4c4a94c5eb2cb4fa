"""Curves by which a joint follows another: a line, and harmonics of its coordinate; compliances as lines over loads."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.typing import Floats

HARMONICS = 20
"""Number of half waves over the range: as many as ``linearity`` and ``straightness`` have."""
CLOSE = 1e-9
"""Root mean square error, m or rad, up to which a line alone is taken, without harmonics."""
LEAST = 1e-9
"""Smallest amplitude of a harmonic, m or rad; smaller ones are dropped."""
SHOWN = 1e-6
"""Smallest singular value of the least-squares problem, relative to the largest. Combinations of harmonics with a smaller one
are left out: the coordinates of the fit do not determine them."""
STIFFEST = 1e-11
"""Smallest compliance, m/N or rad/(N m); a smaller or negative fitted one counts as zero."""
NO_LOAD = 1e-6
"""Smallest standard deviation of a load, N or N m, from which a compliance is fitted."""
WORTH = 0.5
"""Largest error of an exported effect's motion of the TCP, over this motion, both root mean square. With more, the effect is
left out of the file."""


@dataclass(frozen=True)
class Harmonic:
    """amplitude cos(rate x + phase): amplitude in m or rad, rate in rad per unit of x, phase in rad."""

    rate: float
    phase: float
    amplitude: float


@dataclass(frozen=True)
class DriveCurve:
    """offset + proportion x + sum of harmonics of x; values in m or rad."""

    offset: float
    proportion: float
    harmonics: tuple[Harmonic, ...] = ()

    def __call__(self, x: npt.ArrayLike) -> Floats:
        """Values at coordinates of any shape."""
        x = np.asarray(x, dtype=float)
        waves = (h.amplitude * np.cos(h.rate * x + h.phase) for h in self.harmonics)
        return np.asarray(sum(waves, self.offset + self.proportion * x))

    def slope(self, x: float) -> float:
        """Derivative at a coordinate."""
        return self.proportion - float(sum(h.amplitude * h.rate * np.sin(h.rate * x + h.phase) for h in self.harmonics))

    def about(self, origin: float) -> DriveCurve:
        """The same curve as a function of x - origin."""
        moved = tuple(replace(h, phase=h.phase + h.rate * origin) for h in self.harmonics)
        return DriveCurve(self.offset + self.proportion * origin, self.proportion, moved)

    def times(self, factor: float) -> DriveCurve:
        """The curve with all its values multiplied by a factor."""
        waves = tuple(replace(h, amplitude=factor * h.amplitude) for h in self.harmonics)
        return DriveCurve(factor * self.offset, factor * self.proportion, waves)

    def plus(self, other: DriveCurve) -> DriveCurve:
        """The sum of two curves; harmonics of equal rate and phase are added."""
        total: dict[tuple[float, float], float] = {}
        for h in (*self.harmonics, *other.harmonics):
            total[h.rate, h.phase] = total.get((h.rate, h.phase), 0.0) + h.amplitude
        waves = tuple(Harmonic(rate, phase, amplitude) for (rate, phase), amplitude in total.items())
        return DriveCurve(self.offset + other.offset, self.proportion + other.proportion, waves)


NOTHING = DriveCurve(0.0, 0.0)
"""The curve that is zero."""
SAME = DriveCurve(0.0, 1.0)
"""The curve of a joint that has the coordinate of the other."""


def fitted(
    x: Floats,
    values: Floats,
    ends: tuple[float, float],
    weight: Floats | None = None,
    *,
    slope: bool = True,
    count: int = HARMONICS,
) -> DriveCurve:
    """The curve through values (N,) at coordinates x (N,), by least squares with weights (N,).

    A line or, without ``slope``, a constant; if that is not close enough, with half waves 1 to ``count`` over the range between
    ``ends``: the functions of the smooth effects.
    """
    weight = np.ones(len(x)) if weight is None else weight
    if slope:
        proportion, offset = np.polyfit(x, values, 1, w=weight)
    else:
        proportion, offset = 0.0, np.average(values, weights=weight**2)
    line = DriveCurve(float(offset), float(proportion))
    if np.sqrt(np.average((line(x) - values) ** 2, weights=weight**2)) <= CLOSE:
        return line
    lower, upper = ends
    rates = np.pi * np.arange(1, count + 1) / (upper - lower)
    columns = np.column_stack([np.ones(len(x)), x if slope else np.zeros(len(x)), np.cos(np.outer(x - lower, rates))])
    found = np.linalg.lstsq(columns * weight[:, None], values * weight, rcond=SHOWN)[0]
    own = (Harmonic(float(r), float(-r * lower), float(a)) for r, a in zip(rates, found[2:], strict=True))
    return DriveCurve(float(found[0]), float(found[1]), tuple(h for h in own if abs(h.amplitude) > LEAST))


def line(load: Floats, moved: Floats, tangent: float) -> tuple[float, float]:
    """Compliance, m/N or rad/(N m), and deflection without load, m or rad, of the line through deflections ``moved`` (N,) under
    loads (N,); the compliance ``tangent`` if the load does not vary."""
    if np.std(load) < NO_LOAD:
        return tangent, float(moved.mean() - tangent * load.mean())
    compliance, rest = np.polyfit(load, moved, 1)
    return float(compliance), float(rest)
