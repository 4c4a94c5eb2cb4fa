"""Random functions: draws of Gaussian processes over one or several coordinates, and play.

None of them is a series of fixed functions of a coordinate, because a diagnosis fits such series.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from gtpin.typing import Floats

Smoothness = Literal["rough", "once", "twice", "smooth"]

NODES = 181
WAVES = 96
"""Random frequencies of a field: enough for its marginals to be nearly normal."""


@dataclass(frozen=True)
class Curve:
    """A function of one coordinate by its values at nodes, linear between them and constant outside."""

    nodes: Floats
    values: Floats

    def __call__(self, x: Floats) -> Floats:
        """Values at x, any shape."""
        return np.asarray(np.interp(x, self.nodes, self.values))

    def scaled(self) -> Curve:
        """The function, shifted and scaled to mean 0 and rms 1 over its nodes."""
        centred = self.values - self.values.mean()
        return Curve(self.nodes, centred / np.sqrt((centred**2).mean()))


def curve(
    rng: np.random.Generator, lower: float, upper: float, length: float, smoothness: Smoothness = "smooth"
) -> Curve:
    """A draw of a Gaussian process from ``lower`` to ``upper``, scaled to mean 0 and rms 1; ``length``: the kernel's length
    scale.

    The kernel is Matern 1/2 (``rough``), 3/2 (``once``, differentiable once), 5/2 (``twice``) or squared exponential
    (``smooth``).
    """
    nodes = np.linspace(lower, upper, NODES)
    r = np.abs(nodes[:, None] - nodes) / length
    covariance = _covariance(r, smoothness) + 1e-6 * np.eye(NODES)
    return Curve(nodes, np.linalg.cholesky(covariance) @ rng.standard_normal(NODES)).scaled()


def _covariance(r: Floats, smoothness: Smoothness) -> Floats:
    if smoothness == "rough":
        return np.exp(-r)
    if smoothness == "once":
        return np.asarray((1.0 + np.sqrt(3.0) * r) * np.exp(-np.sqrt(3.0) * r))
    if smoothness == "twice":
        return np.asarray((1.0 + np.sqrt(5.0) * r + 5.0 / 3.0 * r**2) * np.exp(-np.sqrt(5.0) * r))
    return np.exp(-(r**2) / 2.0)


def uneven_curve(rng: np.random.Generator, lower: float, upper: float) -> Curve:
    """A smooth random function, rough in places and, in half of the cases, with a step: mean 0, rms 1."""
    width = upper - lower
    base = curve(rng, lower, upper, width * rng.uniform(0.12, 0.4), rng.choice(["twice", "smooth"]))
    rough = curve(rng, lower, upper, width * rng.uniform(0.02, 0.06), rng.choice(["rough", "once"]))
    patches = np.clip(curve(rng, lower, upper, 0.15 * width).values, 0.0, 1.5)
    values = base.values + rng.uniform(0.1, 0.3) * patches * rough.values
    if rng.random() < 0.5:
        values = values + rng.uniform(0.2, 0.5) * rng.choice([-1.0, 1.0]) * (base.nodes > rng.uniform(lower, upper))
    return Curve(base.nodes, values).scaled()


@dataclass(frozen=True)
class Field:
    """A draw of a stationary Gaussian process over d coordinates, by random Fourier features: mean 0, variance 1."""

    frequencies: Floats
    phases: Floats
    weights: Floats

    @staticmethod
    def draw(rng: np.random.Generator, lengths: npt.ArrayLike, tails: float = 5.0) -> Field:
        """Draw a random field with a Matern kernel of smoothness ``tails`` / 2 and a length scale (d,) for each coordinate."""
        length = np.asarray(lengths, dtype=float)
        heavy = np.sqrt(tails / rng.chisquare(tails, (WAVES, 1)))
        frequencies = rng.standard_normal((WAVES, len(length))) * heavy / length
        weights = rng.standard_normal(WAVES) * np.sqrt(2.0 / WAVES)
        return Field(frequencies, rng.uniform(0.0, 2.0 * np.pi, WAVES), weights)

    def __call__(self, points: Floats) -> Floats:
        """(N,) values at points (N, d)."""
        return np.asarray(np.cos(points @ self.frequencies.T + self.phases) @ self.weights)


def play(x: Floats, width: float) -> Floats:
    """(N,) position of a part that a pin at x (N,), in the order of time, drags along with a play of +-``width``."""
    dragged = np.empty_like(x)
    at = float(x[0]) if len(x) else 0.0
    for i, pin in enumerate(x.tolist()):
        at = min(max(at, pin - width), pin + width)
        dragged[i] = at
    return dragged
