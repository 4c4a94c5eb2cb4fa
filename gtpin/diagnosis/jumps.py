"""Times at which the errors of a machine jump, as after homing or where an instrument was set up again."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.polynomial.legendre import legvander

from gtpin.data.dataset import Dataset
from gtpin.model.model import Model, in_frame
from gtpin.typing import Floats, Mask

FEWEST = 5
"""Smallest number of poses between two jumps. Assumed."""
MOST = 10
"""Largest number of jumps that are looked for. Assumed."""
TRIED = 500
"""Number of places of a jump that are tried, at most."""
GAIN = 5.0
"""Gain in log likelihood, nats, over the logarithm of the number of poses for each further number, from which there is one more
jump, and from which jumps are preferred to a polynomial with as many numbers. Assumed."""


def jump_times(dataset: Dataset, model: Model, used: Mask, site: str) -> tuple[float, ...]:
    """Times, s, at which the errors that a model leaves jump: of the travel of the actuator ``site``, else of positions.

    Empty where they do not jump, or the poses have no time, a session already, or other instruments than one tracker.
    ``used``: (N,) rows that are no gross errors.
    """
    if "time" not in dataset.covariates or "session" in dataset.covariates or dataset.readings.names:
        return ()
    predicted = model.predict(dataset.q, dataset.covariates)
    rows = used & predicted.reached
    q, left, weight = dataset.q[rows], (dataset.position - predicted.T)[rows], np.ones(int(rows.sum()))
    if site in model.robot.sites:
        poses = model.kinematics.forward(q)
        by_command = in_frame(model.kinematics.command_jacobian(q, poses)[:, :6], model.frame)
        along = by_command[:, :3, model.robot.sites.index(site)]
        weight = np.maximum((along**2).sum(axis=1), 1e-12)
        left = ((along * left).sum(axis=1) / weight)[:, None]
    return jumps(np.asarray(dataset.covariates["time"], dtype=float)[rows], left, weight)


def jumps(time: Floats, left: Floats, weight: Floats) -> tuple[float, ...]:
    """Times between which errors ``left`` (N, m) at times (N,), with weights (N,), are constant; empty where they do not jump.

    Each further jump is the one with the largest gain in log likelihood. Their number is that of the largest log likelihood
    less a cost of each. Errors that change smoothly follow a polynomial of the time as well, which has as many numbers as the
    jumps have: m for each height, and one for each place.
    """
    order = np.argsort(time, kind="stable")
    time, left, weight = time[order], left[order] * np.sqrt(weight[order])[:, None], np.sqrt(weight[order])
    n, m = left.shape
    places, found = [0, n], [([0, n], _power(left, weight, [0, n]))]
    while len(found) <= MOST:
        tried = [
            i for a, b in itertools.pairwise(places) for i in range(a + FEWEST, b - FEWEST + 1, max(1, n // TRIED))
        ]
        if not tried:
            break
        power, places = min((_power(left, weight, some), some) for some in (sorted([*places, i]) for i in tried))
        found.append((places, power))
    cost = (m + 1) / 2.0 * np.log(n) + GAIN
    places, power = min(found, key=lambda one: n * m / 2.0 * np.log(one[1]) + cost * (len(one[0]) - 2))
    inner = places[1:-1]
    if not inner:
        return ()
    degree = int(np.ceil(len(inner) * (1.0 + 1.0 / m)))
    span = max(float(np.ptp(time)), 1e-12)
    columns = legvander(2.0 * (time - time[0]) / span - 1.0, degree) * weight[:, None]
    smooth = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    if n * m / 2.0 * np.log((smooth**2).sum() / power) < GAIN:
        return ()
    return tuple(float((time[i - 1] + time[i]) / 2.0) for i in inner)


def _power(left: Floats, weight: Floats, places: list[int]) -> float:
    """Sum of squares of weighted errors less their means between places."""
    starts = places[:-1]
    means = np.add.reduceat(left * weight[:, None], starts) / np.add.reduceat(weight**2, starts)[:, None]
    return float(((left - np.repeat(means, np.diff(places), axis=0) * weight[:, None]) ** 2).sum())
