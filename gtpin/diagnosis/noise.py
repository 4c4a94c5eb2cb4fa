"""The noise, re-estimated given the causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.hypothesis_set import Explanation, HypothesisSet
from gtpin.diagnosis.priors import Priors
from gtpin.noise.estimate import LEAST_CONTRASTS, contrasts, likeliest, stops
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.noise.weights import Tails, gross, robust_scale, square_norms, t_likelihood
from gtpin.typing import Floats

MATTERS = 0.03
"""Relative change of the noise's variance, or mean change of a weight, above which the search is repeated."""


def left_over(hypotheses: HypothesisSet, model: Explanation) -> tuple[Floats, float]:
    """(N, c) whitened residuals after the geometry and a model were fitted, and the effective number of parameters of both."""
    design = hypotheses.design
    J, prior = design.beside(hypotheses.columns(model))
    normal = J.T @ J
    both = np.linalg.solve(normal + np.diag(prior), np.column_stack([J.T @ design.y, normal]))
    return (design.y - J @ both[:, 0]).reshape(-1, design.components), float(np.trace(both[:, 1:]))


def gross_errors(hypotheses: HypothesisSet, model: Explanation) -> npt.NDArray[np.bool_]:
    """(N,) True for gross errors: neither a model nor noise with the size and tails of the other poses explains them.

    Readings are compared with readings of the same sigma. If one number of a table's row is a gross error, the whole row is.
    """
    residual, _ = left_over(hypotheses, model)
    measured, most = hypotheses.design.measured, hypotheses.priors.absurd
    found = np.zeros(len(residual), dtype=bool)
    for rows in measured.noise_groups:
        found[rows] = _gross(residual[rows], most)
    row = measured.rows.row
    return np.isin(row, row[found])


def _gross(residual: Floats, most: float) -> npt.NDArray[np.bool_]:
    """(N,) gross errors among whitened residuals (N, c), also those larger than ``most`` times the robust scale."""
    absurd = square_norms(residual) > (most * robust_scale(residual)) ** 2
    return gross(residual, ~absurd) | absurd


@dataclass(frozen=True)
class Reestimated:
    """The re-estimated noise.

    ``observed``: the poses, with this noise and their weights. ``matters``: whether the noise has changed so much that the
    search must be repeated. ``restless``: site of an actuator whose errors differ from pose to pose by more than repeated
    visits scatter: a deviation that changes too fast along the travel for any smooth term, and is no noise. None where
    there is no such actuator.
    """

    observed: Observed
    matters: bool
    restless: str | None


def reestimate_noise(
    observed: Observed, hypotheses: HypothesisSet, model: Explanation, declared: Sequence[float | None] = ()
) -> Reestimated:
    """Estimate repeatability, sigmas that were not declared, and weights of the rows from a model's residuals. By maximum
    likelihood, of Gaussian noise or of noise with heavy tails, whichever is larger.

    The model's parameters reduce the degrees of freedom of all numbers in the same proportion. Tails are those of rows that
    are compared with each other (``noise_groups``): an instrument can have heavy tails, and another none.

    ``model``: causes and smooth terms: everything that is not noise. ``declared``: declared sigma of each group of numbers, m
    or rad, or None; no estimate is smaller, or a long model that follows the noise would make it ever smaller.
    """
    design, priors, noise = hypotheses.design, hypotheses.priors, observed.noise
    least = np.array([sigma or 0.0 for sigma in declared] or [0.0])
    residual, effective_parameters = left_over(hypotheses, model)
    J = design.by_command_seen
    scatter, rows = contrasts(stops(design.measured.q, design.measured.read), design.coloured(residual))
    errors = design.coloured(residual * np.sqrt(design.count / max(design.count - effective_parameters, 1.0)))
    weight, shrunk = np.ones(len(errors)), np.ones(len(errors))
    found = _bounded(likeliest(noise, errors, J, weight), least)
    # Scatter of drives differs from row to row and so looks like heavy tails, and the reverse: the likelier one is used.
    whitened, of_noise = _whitened(noise, errors, design)
    scattered, of_scatter = _whitened(found, errors, design)
    for some in design.measured.noise_groups:
        own, tails = whitened[some], Tails.of(whitened[some])
        gaussian = -0.5 * (scattered[some] ** 2 + np.log(2.0 * np.pi)).sum() + of_scatter[some].sum()
        if (
            tails.heavy
            and t_likelihood(square_norms(own), tails.freedom, own.shape[1])[0] + of_noise[some].sum() > gaussian
        ):
            weight[some] = tails.weigh(own)
            shrunk[some] = weight[some] * tails.scale**2
    if (weight != 1.0).any():
        found = _bounded(likeliest(noise, errors, J, shrunk), least)
    restless = None
    if len(scatter) >= LEAST_CONTRASTS:
        grid = found.repeatability * np.linspace(0.0, 1.0, 41)
        most = most_repeatability(found.take(rows), scatter, J[rows], grid, priors)
        if found.repeatability > most:
            found = replace(found, repeatability=most)
            restless = (
                None if noise.estimated.any() else _most_restless(found, errors, design, model.log_evidence, priors)
            )
            if restless is not None:
                weight = np.ones(len(errors))  # these errors are no noise, so their tails say nothing about the noise
    before, after = (
        np.diagonal(n.covariance(J, design.components), axis1=1, axis2=2)[:, design.compared] for n in (noise, found)
    )
    changed = abs(float((after / before).mean()) - 1.0) > MATTERS
    changed = changed or float(np.abs(weight - observed.weight).mean()) > MATTERS
    return Reestimated(replace(observed, noise=found, weight=weight), changed, restless)


def _bounded(noise: ReadingNoise, least: Floats) -> ReadingNoise:
    """The noise with sigmas of at least ``least``, of each group or of all."""
    found = noise.at_least(SMALLEST)
    return replace(found, sigma=np.maximum(found.sigma, least))


def tails_of(observed: Observed, hypotheses: HypothesisSet, model: Explanation) -> dict[int, Tails]:
    """Tails of the noise, by kind of the rows, where their weights are not 1. With them a fit weighs rows that the search did
    not use."""
    if (observed.weight == 1.0).all():
        return {}
    residual, effective_parameters = left_over(hypotheses, model)
    residual = residual * np.sqrt(residual.size / max(residual.size - effective_parameters, 1.0))
    whitened = residual / np.sqrt(observed.weight)[:, None]  # the design's whitening has the weights
    weighed = observed.weight != 1.0
    return {int(kind): Tails.of(whitened[observed.kinds == kind]) for kind in np.unique(observed.kinds[weighed])}


def _whitened(noise: ReadingNoise, errors: Floats, design: Design) -> tuple[Floats, Floats]:
    """(N, c) whitened errors, and (N,) logs of the whitening's determinants."""
    whitening = noise.whitening(design.by_command_seen, design.components)
    return np.einsum("nij,nj->ni", whitening, errors), np.log(np.diagonal(whitening, axis1=1, axis2=2)).sum(axis=1)


def most_repeatability(noise: ReadingNoise, scatter: Floats, J: Floats, grid: Floats, priors: Priors) -> float:
    """The largest repeatability of a grid that the scatter (k, c) between visits allows."""
    costs = np.array([misfit(replace(noise, repeatability=float(value)), scatter, J) for value in grid])
    return float(grid[costs <= costs.min() + priors.disbelieved].max())


def misfit(noise: ReadingNoise, scatter: Floats, J: Floats) -> float:
    """Minus twice the log likelihood of the scatter (k, c) between visits, but for a constant."""
    covariance = noise.covariance(J, scatter.shape[1])
    solved = np.linalg.solve(covariance, scatter[..., None])[..., 0]
    return float(np.linalg.slogdet(covariance)[1].sum() + (scatter * solved).sum())


def _most_restless(noise: ReadingNoise, errors: Floats, design: Design, explained: float, priors: Priors) -> str | None:
    """The actuator along whose motion the errors (N, c), m and rad, exceed the noise most, by a score test; None where none
    does.

    ``explained``: log evidence of the model; a share of it is tolerated, because no machine follows the equations exactly.
    """
    J, c = design.by_command_seen, design.components
    seen = np.linalg.solve(noise.covariance(J, c), J)
    score = (np.einsum("nci,nc->ni", seen, errors)) ** 2
    return _beyond_noise(
        score, np.einsum("nci,nci->ni", seen, J), design.operating_points.robot.sites, explained, priors
    )


def restless_drive(hypotheses: HypothesisSet, model: Explanation, sites: Sequence[str]) -> str | None:
    """The one of some actuators along whose motion the residuals of a model exceed the noise most; None where none does."""
    design = hypotheses.design
    own = design.by_command[:, :, [design.operating_points.robot.sites.index(site) for site in sites]]
    score = np.einsum("nci,nc->ni", own, left_over(hypotheses, model)[0]) ** 2
    size = np.einsum("nci,nci->ni", own, own)
    return _beyond_noise(score, size, sites, model.log_evidence, hypotheses.priors)


def _beyond_noise(score: Floats, size: Floats, sites: Sequence[str], explained: float, priors: Priors) -> str | None:
    """The site whose squared scores (N, n) exceed their expected values ``size`` most; None where none exceeds them."""
    excess = (score - size).sum(axis=0)
    z = excess / np.sqrt(2.0 * (size**2).sum(axis=0))
    best = int(np.argmax(z))
    tolerated = priors.core_leaves * 2.0 * max(explained, 0.0)
    return sites[best] if z[best] > priors.restless and excess[best] / size[:, best].mean() > tolerated else None
