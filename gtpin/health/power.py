"""The smallest change of each effect that a check finds. Changes that it could not find are smaller, or not in its list."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gtpin.health.alarm import Axes, Bench
from gtpin.typing import Floats

LARGEST = 1e3
"""Size of a change, over its typical size, at which the search for the smallest one ends. Assumed."""
STEPS = 12
"""Number of bisections of the logarithm of the size, from 1e-3 to `LARGEST`: they determine the size to 0.4 %."""
NAMED = 60
"""Number of random shapes for the median of a parameter."""


@dataclass(frozen=True)
class Smallest:
    """The smallest change of an effect at a site that a check finds with a given power.

    Parameters
    ----------
    effect, site
        The effect that changes, and its site.
    parameter, value, unit
        The size of the change, as the effect's first parameter. Where the effect has several coefficients: the median over
        changes of random shape. ``value`` is None where not even 1,000 times the typical size is found.
    """

    effect: str
    site: str
    parameter: str
    value: float | None
    unit: str


def smallest_changes(
    bench: Bench, threshold: float, power: float, draws: int, rng: np.random.Generator
) -> Iterator[Smallest]:
    """For each hypothesis, the smallest change whose own gain in log evidence exceeds ``threshold`` with probability ``power``.

    The probability of an alarm is at least this: another hypothesis, or chi-square, may raise the alarm too.
    """
    at = bench.hypotheses.design.situation
    y = bench.unchanged(draws, rng)
    for axes in bench.axes:
        hypothesis = axes.hypothesis
        shape = shapes(axes, draws, rng)
        size = _size(bench, axes, bench.moments(axes, y), shape, threshold, power)
        sigma = hypothesis.basis(at).sigma
        named = [hypothesis.effect.parameters_of(at.robot, hypothesis.site, u * sigma, ()) for u in shape[:NAMED]]
        name, (_, unit) = next(iter(named[0].items()))
        typical = float(np.median([abs(found[name][0]) for found in named]))
        yield Smallest(*hypothesis.place, name, None if size is None else size * typical, unit)


def shapes(axes: Axes, draws: int, rng: np.random.Generator) -> Floats:
    """(draws, c) coefficients of changes of typical size: random in the core with mean square 1, zero in the modulation."""
    c = len(axes.values)
    own = list(axes.core) or list(range(c))
    drawn = rng.standard_normal((draws, len(own)))
    found = np.zeros((draws, c))
    found[:, own] = drawn * np.sqrt(len(own) / (drawn**2).sum(axis=1, keepdims=True))
    return found


def found_share(bench: Bench, axes: Axes, null: Floats, shape: Floats, size: float, threshold: float) -> float:
    """Share of the drawn changes, multiplied by ``size``, whose gain exceeds the threshold."""
    moments = null + size * (shape @ axes.vectors) * axes.values
    return float((bench.gains(axes, moments) >= threshold).mean())


def _size(bench: Bench, axes: Axes, null: Floats, shape: Floats, threshold: float, power: float) -> float | None:
    low, high = np.log(1e-3), np.log(LARGEST)
    if not found_share(bench, axes, null, shape, LARGEST, threshold) >= power:
        return None
    for _ in range(STEPS):
        middle = (low + high) / 2.0
        if found_share(bench, axes, null, shape, float(np.exp(middle)), threshold) >= power:
            high = middle
        else:
            low = middle
    return float(np.exp(high))
