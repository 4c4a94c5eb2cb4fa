"""Scalar shapes of errors, from the textbook's form (distance 0) to far from it (distance 1); sizes are arbitrary."""

from __future__ import annotations

import numpy as np
from motion import Array

Generator = np.random.Generator


def unit(values: Array) -> Array:
    """The same shape with a root mean square of 1; zero stays zero."""
    size = np.sqrt(np.mean(values**2))
    return values / size if size > 0.0 else values


def smooth(x: Array, distance: float, rng: Generator) -> Array:
    """A Gaussian process over x (N, k), scaled to [0, 1]: from the squared-exponential kernel and the whole travel as
    length scale, through Matern 5/2 and 3/2, to Matern 1/2 and a tenth of the travel (Rasmussen and Williams 2006, ch. 4)."""
    length = 10.0**-distance
    r = np.sqrt(((x[:, None] - x[None]) ** 2).sum(2)) / length
    if distance < 0.25:
        K = np.exp(-0.5 * r**2)
    elif distance < 0.5:
        s = np.sqrt(5.0) * r
        K = (1.0 + s + s**2 / 3.0) * np.exp(-s)
    elif distance < 0.9:
        s = np.sqrt(3.0) * r
        K = (1.0 + s) * np.exp(-s)
    else:
        K = np.exp(-r)
    values, vectors = np.linalg.eigh(K)
    return np.asarray(vectors @ (np.sqrt(np.clip(values, 0.0, None)) * rng.standard_normal(len(x))))


def periodic(x: Array, period: float, distance: float, rng: Generator) -> Array:
    """One sine; then a Fourier series with amplitudes 1/k^(1/distance); beyond 0.7 the period wanders along the travel."""
    wander = max(0.0, distance - 0.7) / 0.3
    grid = np.linspace(x.min(), x.max(), 400)
    walk = np.cumsum(rng.standard_normal(400)) * np.sqrt((grid[1] - grid[0]) / period)
    phase = 2.0 * np.pi * x / period + wander * np.interp(x, grid, walk)
    powers = [1.0 if k == 1 else k ** (-1.0 / max(distance, 1e-3)) for k in range(1, 7)]
    return sum((a * np.sin(k * phase + rng.uniform(0, 2 * np.pi)) for k, a in enumerate(powers, 1)), np.zeros_like(x))


def hysteresis(waypoints: Array, stop: Array, distance: float, rng: Generator) -> Array:
    """State of a friction-like hysteresis at the stops of a path through `waypoints` (M,), `stop` (M,) marks the stops.

    At distance 0 the sign of the last motion. Below 0.8 the model of Dahl and Bouc-Wen (exponent 1, beta = gamma = 1/2):
    dz = (dx - z |dx|) / length, with a length that grows with the distance from 0 over one approach to ten. From 0.8 on
    Preisach's: relays with thresholds spread over the travel.
    """
    steps = np.diff(waypoints, prepend=waypoints[0])
    if distance >= 0.8:
        ends = np.sort(rng.uniform(waypoints.min(), waypoints.max(), (300, 2)), axis=1)
        state = rng.choice([-1.0, 1.0], 300)
        out = []
        for x in waypoints:
            state = np.where(x > ends[:, 1], 1.0, np.where(x < ends[:, 0], -1.0, state))
            out.append(state.mean())
        z = np.array(out)
        trend = np.polyfit(waypoints, z, 1)
        return np.asarray((z - np.polyval(trend, waypoints))[stop])
    approach = np.median(np.abs(steps[stop]))
    length = max(1e-6, 10.0 ** (4.0 * distance - 2.0) if distance else 0.0) * approach
    last, states = 0.0, []
    for dx in steps:
        last = np.sign(dx) - (np.sign(dx) - last) * np.exp(-abs(dx) / length) if dx else last
        states.append(last)
    return np.asarray(np.array(states)[stop])


def power(load: Array, distance: float) -> Array:
    """From proportional to the load (distance 0) through Hertz's exponent 2/3 (0.5) to 1/3, with the load's sign."""
    relative = load / max(np.sqrt(np.mean(load**2)), 1e-12)
    return np.asarray(np.sign(load) * np.abs(relative) ** (1.0 - 2.0 * distance / 3.0))


def lagging(time: Array, temperature: Array, distance: float) -> Array:
    """A temperature that follows with one time constant (0.4 x distance x the duration), from 0.5 on with two."""
    order = np.argsort(time)
    grid = np.linspace(time.min(), time.max(), 2000)
    value = np.interp(grid, time[order], temperature[order])
    for tau in (0.4 * distance, 0.8 * distance if distance >= 0.5 else 0.0):
        if tau:
            keep = np.exp(-1.0 / (tau * len(grid)))
            state, out = value[0], []
            for v in value:
                state = v + (state - v) * keep
                out.append(state)
            value = np.array(out)
    return np.asarray(np.interp(time, grid, value))


def worn(x: Array, distance: float, rng: Generator) -> Array:
    """A worn place on a travel scaled to [0, 1]: a bell of half the travel, at the end a pit of a twentieth with edges."""
    middle, width = rng.uniform(0.25, 0.75), 0.25 * 10.0**-distance
    s = np.abs((x - middle) / width)
    return np.asarray(np.exp(-0.5 * s ** (2.0 + 4.0 * distance)))
