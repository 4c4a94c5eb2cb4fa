"""The noise, asked again once the causes are known: what was taken for scatter may have been a cause, and the reverse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from gtpin.calibration.noise import SHOWN, SMALLEST, Noise
from gtpin.calibration.weights import Tails
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Posterior
from gtpin.diagnosis.fit import Observed
from gtpin.diagnosis.pool import Pool

Floats = npt.NDArray[np.float64]

MATTERS = 0.03
"""Change of the noise's variance, or mean change of a weight, from which on the search is worth another round."""


def left_over(pool: Pool, model: Posterior) -> tuple[Floats, float]:
    """(N, c) whitened residuals of geometry and a model's groups together, and the degrees of freedom that these took."""
    design, groups = pool.design, pool.groups
    scaled = [groups.columns[n] * s for n, s in zip(model.names, model.scale, strict=True)]
    J = np.hstack([design.B, *scaled])
    prior = np.ones(J.shape[1])
    prior[design.n_geometry : design.B.shape[1]] = 0.0
    normal = J.T @ J
    both = np.linalg.solve(normal + np.diag(prior), np.column_stack([J.T @ design.y, normal]))
    return (design.y - J @ both[:, 0]).reshape(-1, design.components), float(np.trace(both[:, 1:]))


def asked_again(observed: Observed, pool: Pool, model: Posterior, declared: tuple[bool, bool]) -> tuple[Observed, bool]:
    """Repeatability, sigmas that were not declared, and weights, from what a model leaves.

    Parameters
    ----------
    model
        Causes and free motions: everything that is no noise.
    declared
        Whether the position's and the orientation's sigma are known.

    Returns
    -------
    observed, matters
        With the noise that the residuals show, and whether it differs enough for another search.
    """
    design = pool.design
    left, taken = left_over(pool, model)
    left = left * np.sqrt(left.size / max(left.size - taken, 1.0))
    tails = Tails.of(left)
    weight = tails.weigh(left)
    errors = np.linalg.solve(design.whitening, left[..., None])[..., 0]
    found = _likeliest(observed.noise, errors, weight, design, declared)
    J, c = design.situation.command_jacobian, design.components
    before, after = (np.trace(n.covariance(J, c)[:, :3, :3], axis1=1, axis2=2).mean() for n in (observed.noise, found))
    changed = abs(after / before - 1.0) > MATTERS or float(np.abs(weight - observed.weight).mean()) > MATTERS
    return replace(observed, noise=found, weight=weight), bool(changed)


def _likeliest(noise: Noise, errors: Floats, weight: Floats, design: Design, declared: tuple[bool, bool]) -> Noise:
    """Noise that makes errors (N, c), m and rad, likeliest; repeatability only where they show it."""
    J, c = design.situation.command_jacobian, design.components
    open_ = [i for i in range(2) if not declared[i] and (i == 0 or c == 6)]
    gain = float(np.sqrt((J[:, :3] ** 2).sum(axis=(1, 2)).mean() / 3.0))
    unit = noise.position_sigma / max(gain, 1e-12)

    def trial(x: Floats) -> Noise:
        sigmas = [noise.position_sigma, noise.orientation_sigma]
        for value, i in zip(x[1:], open_, strict=True):
            sigmas[i] *= float(np.exp(value))
        return replace(
            noise, position_sigma=sigmas[0], orientation_sigma=sigmas[1], repeatability=unit * float(np.sqrt(x[0]))
        )

    def cost(x: Floats) -> float:
        lower = np.linalg.cholesky(trial(x).covariance(J, c))
        whitened = np.linalg.solve(lower, errors[..., None])[..., 0]
        logs = np.log(np.diagonal(lower, axis1=1, axis2=2)).sum()
        return float(logs + 0.5 * (weight * (whitened**2).sum(axis=1)).sum())

    start = np.array([0.02] + [0.0] * len(open_))
    with_it = minimize(cost, start, bounds=[(0.0, 1e3)] + [(-5.0, 5.0)] * len(open_), method="L-BFGS-B")
    without = np.zeros(len(start))
    if open_:
        without = minimize(cost, without, bounds=[(0.0, 0.0)] + [(-5.0, 5.0)] * len(open_), method="L-BFGS-B").x
    shown = 2.0 * (cost(without) - float(with_it.fun)) > SHOWN
    return trial(with_it.x if shown else without).at_least(SMALLEST)
