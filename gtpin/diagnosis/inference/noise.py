"""The noise, asked again once the causes are known: what was taken for scatter may have been a cause, and the reverse."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.inference.joint_fit import Observed
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import Posterior
from gtpin.noise.likelihood import SHOWN
from gtpin.noise.noise import SMALLEST, Noise
from gtpin.noise.repeats import LEAST_CONTRASTS, contrasts
from gtpin.noise.weights import Tails, gross, robust_scale, square_norms, t_likelihood

Floats = npt.NDArray[np.float64]

MATTERS = 0.03
"""Change of the noise's variance, or mean change of a weight, from which on the search is worth another round."""
DISBELIEVED = 10.8
"""Twice the loss in log likelihood from which on a repeatability is not believed (chance of 1 in 1,000)."""
RESTLESS = 6.0
"""Standard deviations by which an actuator must err more than the noise before that is called a motion."""
LEFT = 0.15
"""Share of what is explained that forms leave at most."""
ABSURD = 15.0
"""Standard deviations of the bulk, beyond which a pose is set aside whatever the tails."""


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


def gross_errors(pool: Pool, model: Posterior) -> npt.NDArray[np.bool_]:
    """(N,) poses that neither a model nor any noise of the size and tails of the others explains."""
    left, _ = left_over(pool, model)
    absurd = square_norms(left) > (ABSURD * robust_scale(left)) ** 2
    return gross(left, ~absurd) | absurd


@dataclass(frozen=True)
class Asked:
    """What residuals say of the noise.

    Parameters
    ----------
    observed
        The poses, with that noise and their weights.
    matters
        Whether it differs enough for another search.
    fine
        Site of an actuator that errs more from pose to pose than repeated visits let it scatter: by something that changes
        too fast along its way for any smooth motion, and is no noise. None where there is none.
    """

    observed: Observed
    matters: bool
    fine: str | None


def asked_again(observed: Observed, pool: Pool, model: Posterior, declared: tuple[bool, bool]) -> Asked:
    """Repeatability, sigmas that were not declared, and weights, from what a model leaves.

    Parameters
    ----------
    model
        Causes and free motions: everything that is no noise.
    declared
        Whether the position's and the orientation's sigma are known.
    """
    design = pool.design
    left, taken = left_over(pool, model)
    visits = np.unique(observed.measured.q, axis=0, return_inverse=True)[1].ravel()
    colour = np.linalg.inv(design.whitening)
    scatter, rows = contrasts(visits, np.einsum("nij,nj->ni", colour, left))
    left = left * np.sqrt(left.size / max(left.size - taken, 1.0))
    errors = np.einsum("nij,nj->ni", colour, left)
    J, c = design.command_jacobian, design.components
    even = np.ones(len(left))
    found, weight = _likeliest(observed.noise, errors, even, design, declared), even
    whitened = _whitened(observed.noise, errors, design)
    tails = Tails.of(whitened)
    # Scatter that differs from pose to pose looks like tails, and the reverse: the likelier of the two it is.
    if tails.heavy and _of_tails(observed.noise, whitened, tails, design) > _of_scatter(found, errors, design):
        weight = tails.weigh(whitened)
        found = _likeliest(observed.noise, errors, weight * tails.scale**2, design, declared)
    fine = None
    if len(scatter) >= LEAST_CONTRASTS:
        most = _most_repeatability(found.take(rows), scatter, J[rows])
        if found.repeatability > most:
            found = replace(found, repeatability=most)
            fine = _most_restless(found, errors, design, model.log_evidence) if all(declared) else None
            if fine is not None:
                weight = even  # what is no noise has no tails either
    before, after = (np.trace(n.covariance(J, c)[:, :3, :3], axis1=1, axis2=2).mean() for n in (observed.noise, found))
    changed = abs(after / before - 1.0) > MATTERS or float(np.abs(weight - observed.weight).mean()) > MATTERS
    return Asked(replace(observed, noise=found, weight=weight), bool(changed), fine)


def _whitened(noise: Noise, errors: Floats, design: Design) -> Floats:
    whitening = noise.whitening(design.command_jacobian, design.components)
    return np.asarray(np.einsum("nij,nj->ni", whitening, errors))


def _log_volume(noise: Noise, design: Design) -> float:
    whitening = noise.whitening(design.command_jacobian, design.components)
    return float(np.log(np.diagonal(whitening, axis1=1, axis2=2)).sum())


def _of_scatter(noise: Noise, errors: Floats, design: Design) -> float:
    """Log likelihood of errors (N, c), m and rad, of Gaussian noise."""
    whitened = _whitened(noise, errors, design)
    gaussian = -0.5 * (whitened**2).sum() - 0.5 * whitened.size * np.log(2.0 * np.pi)
    return float(gaussian) + _log_volume(noise, design)


def _of_tails(noise: Noise, whitened: Floats, tails: Tails, design: Design) -> float:
    """Log likelihood of errors (N, c), whitened by a noise, of that noise with heavy tails."""
    return t_likelihood(square_norms(whitened), tails.freedom, whitened.shape[1])[0] + _log_volume(noise, design)


def _most_repeatability(noise: Noise, scatter: Floats, J: Floats) -> float:
    """The largest repeatability that the scatter (k, c) between visits allows."""
    grid = noise.repeatability * np.linspace(0.0, 1.0, 41)
    costs = []
    for value in grid:
        covariance = replace(noise, repeatability=float(value)).covariance(J, scatter.shape[1])
        solved = np.linalg.solve(covariance, scatter[..., None])[..., 0]
        costs.append(float(np.linalg.slogdet(covariance)[1].sum() + (scatter * solved).sum()))
    allowed = np.array(costs) <= min(costs) + DISBELIEVED
    return float(grid[allowed].max())


def _most_restless(noise: Noise, errors: Floats, design: Design, explained: float) -> str | None:
    """The actuator whose motion the errors (N, c), m and rad, have more of than the noise, by a score test.

    Parameters
    ----------
    explained
        Log evidence of what is explained, part of which may be left by forms that depart from the machine's.
    """
    J, c = design.command_jacobian, design.components
    covariance = noise.covariance(J, c)
    seen = np.linalg.solve(covariance, J[:, :c])
    score = (np.einsum("nci,nc->ni", seen, errors)) ** 2
    size = np.einsum("nci,nci->ni", seen, J[:, :c])
    excess = (score - size).sum(axis=0)
    z = excess / np.sqrt(2.0 * (size**2).sum(axis=0))
    best = int(np.argmax(z))
    shown = z[best] > RESTLESS and excess[best] / size[:, best].mean() > LEFT * 2.0 * max(explained, 0.0)
    return design.situation.robot.sites[best] if shown else None


def _likeliest(noise: Noise, errors: Floats, weight: Floats, design: Design, declared: tuple[bool, bool]) -> Noise:
    """Noise that makes errors (N, c), m and rad, likeliest; repeatability only where they show it."""
    J, c = design.command_jacobian, design.components
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

    bounds = [(0.0, 1e3)] + [(-5.0, 5.0)] * len(open_)
    starts = [np.array([0.02] + [0.0] * len(open_)), np.array([1.0] + [-0.7] * len(open_))]
    with_it = min((minimize(cost, x, bounds=bounds, method="L-BFGS-B") for x in starts), key=lambda r: float(r.fun))
    without = np.zeros(len(bounds))
    if open_:
        without = minimize(cost, without, bounds=[(0.0, 0.0)] + [(-5.0, 5.0)] * len(open_), method="L-BFGS-B").x
    shown = 2.0 * (cost(without) - float(with_it.fun)) > SHOWN
    return trial(with_it.x if shown else without).at_least(SMALLEST)
