"""The noise, re-estimated given what explains a part of the residuals; gross errors; noise that visits show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import bdtrc

from gtpin.calibration.checks.declared_noise import SIGMAS, Sigma
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.data.instrument_tables import SocketTable
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.evidence import NOTHING, Posterior
from gtpin.diagnosis.hypothesis import Scope, Term
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.priors import Priors
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.result import Source
from gtpin.diagnosis.search import MOST_TERMS, rough_guess
from gtpin.distributions import chi2, f
from gtpin.effects.operating_points import OperatingPoints, References
from gtpin.effects.sites import loaded_along
from gtpin.effects.smooth import loads_of
from gtpin.errors import unheard, warn
from gtpin.instruments.readings import Readings
from gtpin.noise.estimate import (
    LEAST_CONTRASTS,
    contradicted,
    contrasts,
    from_repeats,
    likeliest,
    misfit,
    stops,
    tamed,
    within_residuals,
)
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.noise.weights import Tails, gross, robust_scale, square_norms, t_likelihood
from gtpin.typing import Floats, Mask

NOISE_CHANGED = 0.03
"""Relative change of the noise's variance, or mean change of a weight, above which the search is repeated."""


def left_over(hypotheses: HypothesisSet, model: Posterior[Term]) -> tuple[Floats, float]:
    """(N, c) whitened residuals after the geometry and a model were fitted, and the effective number of parameters of both."""
    design = hypotheses.design
    J, prior = design.beside(hypotheses.columns(model))
    normal = J.T @ J
    both = np.linalg.solve(normal + np.diag(prior), np.column_stack([J.T @ design.y, normal]))
    return (design.y - J @ both[:, 0]).reshape(-1, design.components), float(np.trace(both[:, 1:]))


def gross_errors(hypotheses: HypothesisSet, model: Posterior[Term]) -> npt.NDArray[np.bool_]:
    """(N,) True for gross errors: neither a model nor noise with the size and tails of the other poses explains them.

    Readings are compared with readings of the same sigma. If one number of a table's row is a gross error, the whole row is.
    """
    return _gross_rows(left_over(hypotheses, model)[0], hypotheses.design.measured, hypotheses.priors)


def _gross_rows(residual: Floats, measured: Readings, priors: Priors) -> npt.NDArray[np.bool_]:
    """(N,) gross errors among the whitened residuals (N, c) of some readings."""
    found = np.zeros(len(residual), dtype=bool)
    for rows in measured.noise_groups:
        found[rows] = _gross(residual[rows], priors.absurd)
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
    search must be repeated. ``drive_beyond_noise``: site of an actuator whose errors differ from pose to pose by more than
    repeated visits scatter: a deviation that changes too fast along the travel for any smooth term, and is no noise. None where
    there is no such actuator."""

    observed: Observed
    matters: bool
    drive_beyond_noise: str | None


def reestimate_noise(
    observed: Observed, hypotheses: HypothesisSet, model: Posterior[Term], declared: Sequence[float | None] = ()
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
    drive = None
    if len(scatter) >= LEAST_CONTRASTS:
        grid = found.repeatability * np.linspace(0.0, 1.0, 41)
        most = most_repeatability(found.take(rows), scatter, J[rows], grid, priors)
        if found.repeatability > most:
            found = replace(found, repeatability=most)
            if not noise.estimated.any():  # a score test: along which drive do the errors exceed this noise most?
                seen = np.linalg.solve(found.covariance(J, design.components), J)
                score, size = np.einsum("nci,nc->ni", seen, errors) ** 2, np.einsum("nci,nci->ni", seen, J)
                sites = design.operating_points.robot.sites
                drive = beyond_noise(score, size, sites, model.log_evidence, priors)
            if drive is not None:
                weight = np.ones(len(errors))  # these errors are no noise, so their tails say nothing about the noise
    before, after = (
        np.diagonal(n.covariance(J, design.components), axis1=1, axis2=2)[:, design.compared] for n in (noise, found)
    )
    changed = abs(float((after / before).mean()) - 1.0) > NOISE_CHANGED
    changed = changed or float(np.abs(weight - observed.weight).mean()) > NOISE_CHANGED
    return Reestimated(replace(observed, noise=found, weight=weight), changed, drive)


def _bounded(noise: ReadingNoise, least: Floats) -> ReadingNoise:
    """The noise with sigmas of at least ``least``, of each group or of all."""
    found = noise.at_least(SMALLEST)
    return replace(found, sigma=np.maximum(found.sigma, least))


def tails_of(observed: Observed, hypotheses: HypothesisSet, model: Posterior[Term]) -> dict[int, Tails]:
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


def drive_beyond_noise(hypotheses: HypothesisSet, model: Posterior[Term], sites: Sequence[str]) -> str | None:
    """The one of some actuators along whose motion the residuals of a model exceed the noise most; None where none does."""
    design = hypotheses.design
    own = design.by_command[:, :, [design.operating_points.robot.sites.index(site) for site in sites]]
    score = np.einsum("nci,nc->ni", own, left_over(hypotheses, model)[0]) ** 2
    size = np.einsum("nci,nci->ni", own, own)
    return beyond_noise(score, size, sites, model.log_evidence, hypotheses.priors)


def beyond_noise(score: Floats, size: Floats, sites: Sequence[str], explained: float, priors: Priors) -> str | None:
    """The site whose squared scores (N, n) exceed their expected values ``size`` most; None where none exceeds them.

    An actuator that moves nothing that was measured has no size, and no scores.
    ``explained``: log evidence of the model; a share of it is tolerated, because no machine follows the equations exactly.
    """
    excess = (score - size).sum(axis=0)
    z = excess / np.maximum(np.sqrt(2.0 * (size**2).sum(axis=0)), 1e-300)
    best = int(np.argmax(z))
    tolerated = priors.core_leaves * 2.0 * max(explained, 0.0)
    return sites[best] if z[best] > priors.drive_excess and excess[best] / size[:, best].mean() > tolerated else None


MOST_COMPARED = 1000
"""At most this many poses are used, evenly spread over the rows: 1,000 determine a sigma to 2 %."""
NOISE_SEARCHES = 2
"""Number of searches, each with the noise from the last one. With too small a noise, a search explains some of it by causes."""


def understated_noise(prepared: Prepared, scope: Scope) -> dict[Sigma, tuple[float, float]]:
    """Sigmas that are declared too small: by key, the declared value and the estimated one, m or rad.

    The estimate is the smaller of two: from the residuals after a search, and, where there are repeated visits, from their
    differences. An effect that depends on the pose is in the residuals, but not in these differences. Needed by noise that is
    declared too small: tests/diagnosis/test_diagnosis_doubts.py.

    ``prepared``: the data, and their calibration with the declared noise. ``scope``: the effects that may explain part of the
    residuals.
    """
    baseline = prepared.baseline
    declared = {
        key: getattr(baseline.instrument, key) for key, kind in SIGMAS if kind.start < baseline.residual.shape[1]
    }
    declared = {key: value for key, value in declared.items() if value is not None}
    # A sigma that visits contradict was estimated in the calibration: chi-square is that of the declared one.
    sizes = [getattr(baseline.noise, key) / value for key, value in declared.items()]
    misfit_declared = baseline.chi2_per_dof * max(sizes, default=1.0) ** 2
    if not declared or misfit_declared < scope.priors.misfit:
        return {}
    sure = prepared.dataset.take(baseline.used(prepared.dataset))
    observed = Observed.of(sure, baseline).take(np.arange(len(sure))[:: 1 + len(sure) // MOST_COMPARED])
    repeats = _of_repeats(observed, baseline)
    most = scope.priors.understated_once if repeats is None else scope.priors.understated
    if repeats is not None and all(getattr(repeats, key) <= most * value for key, value in declared.items()):
        return {}  # the smaller of the two estimates is no larger: no search is needed
    noise = replace(observed.noise.scaled(float(np.sqrt(misfit_declared))), repeatability=0.0)
    noise = replace(noise, estimated=np.ones_like(noise.estimated))
    guess: Posterior[Term] = NOTHING
    for _ in range(NOISE_SEARCHES):
        now = replace(observed, noise=noise)
        hypotheses = propose(now.design(baseline.model), scope)
        guess = rough_guess(hypotheses, guess)
        noise = reestimate_noise(now, hypotheses, guess).observed.noise
        if all(getattr(noise, key) <= most * value for key, value in declared.items()):
            return {}  # it only falls from search to search
    found = {}
    for key, value in declared.items():
        sizes = [getattr(n, key) for n in (noise, repeats) if n is not None]
        if min(sizes) > most * value:
            found[key] = (value, float(min(sizes)))
    return found


def warn_of_noise(small: dict[Sigma, tuple[float, float]]) -> None:
    """Warn which declared sigmas are replaced in the search, and not in the verdict."""
    for key, (declared, seen) in small.items():
        ratio = seen / declared
        warn(
            f"{key} is {declared:.2g}, but these data scatter by {seen:.2g}, {ratio:.2g} times more: the search for causes "
            "uses this noise, the verdict the declared one"
        )


def _of_repeats(observed: Observed, baseline: Calibration) -> ReadingNoise | None:
    """The instrument's noise, estimated from repeated visits together with the drives' repeatability; None where there are
    few visits."""
    visits = np.unique(observed.measured.q, axis=0, return_inverse=True)[1].ravel()
    model = baseline.model
    residual = observed.measured.residual_at(model.predict(observed.measured.q))
    scatter, rows = contrasts(visits, residual)
    if len(scatter) < LEAST_CONTRASTS:
        return None
    design = observed.design(model)
    noise = replace(observed.noise, estimated=np.ones_like(observed.noise.estimated))
    return from_repeats(noise.take(rows), scatter, design.by_command_seen[rows])


@dataclass(frozen=True)
class ShownNoise:
    """The noise of a diagnosis's rows by declaration and visits.

    ``noise``: declared sigmas, and repeatability and undeclared sigmas from visits. Of a declared sigma that visits contradict
    (with other sigmas, a fifth larger at least, their scatter is much likelier), it has the visits' own. ``most``: the same
    with the largest repeatability that the visits allow. ``source``: ``declared``, ``repeats``, or ``residuals`` where a sigma
    was neither declared nor shown by visits: an assumption. ``visits``: number of repeated visits, beyond the first of each
    pose. ``ratio``: the largest ratio of the visits' own sigma to the declared one that they contradict; 1 where there is none.
    """

    noise: ReadingNoise
    most: ReadingNoise
    source: Source
    visits: int
    ratio: float = 1.0

    @staticmethod
    def of(
        observed: Observed,
        hypotheses: HypothesisSet,
        guess: Posterior[Term],
        declared: tuple[float | None, ...],
        priors: Priors,
    ) -> ShownNoise:
        """The noise of the rows of a search.

        ``guess``: a model of everything that is not noise, for the scatter between visits. ``declared``: declared sigma of each
        group of numbers, m or rad; None where none is declared, or the data show less.
        """
        design, inferred = hypotheses.design, observed.noise
        known = np.array([sigma is not None for sigma in declared])
        sigma = np.array([own if own is not None else s for own, s in zip(declared, inferred.sigma, strict=True)])
        if not known.any() and not np.isfinite(inferred.row_sigma).any():
            base = replace(inferred, estimated=~known)
        else:
            base = replace(inferred, sigma=sigma, estimated=~known, repeatability=0.0)
        # Beside a known noise of a tracker's positions, residuals show that of its orientations.
        rows_open = np.unique(base.group[:, design.compared][~np.isfinite(base.row_sigma[:, design.compared])])
        assumed = bool((~known)[rows_open].any())
        residual, effective_parameters = left_over(hypotheses, guess)
        errors = design.coloured(residual)
        contrast, rows = contrasts(stops(design.measured.q, design.measured.read), errors)
        if len(contrast) < LEAST_CONTRASTS:
            return ShownNoise(base, base, "residuals" if assumed else "declared", len(contrast))
        J = design.by_command_seen[rows]
        found = from_repeats(replace(base, repeatability=0.0).take(rows), contrast, J)
        wrong, ratio = contradicted(found, contrast, J, priors.excess, priors.chance), 1.0
        if wrong.any():
            base, known = replace(base, estimated=~known | wrong), known & ~wrong
            found = from_repeats(replace(base, repeatability=0.0).take(rows), contrast, J)
            ratio = float((found.sigma / sigma)[wrong].max())
        shown = np.bincount(base.group[rows].ravel(), minlength=len(sigma)) >= LEAST_CONTRASTS
        noise = replace(base, sigma=found.sigma, repeatability=found.repeatability, dof=found.dof)
        errors *= np.sqrt(design.count / max(design.count - effective_parameters, 1.0))
        noise = within_residuals(noise, errors, design.by_command_seen)
        shortened = tamed(contrast, found.group)
        unit = float(np.median(found.each) / max(np.sqrt((J**2).sum(axis=2)).mean(), 1e-12))
        grid = max(found.repeatability, unit) * np.linspace(0.0, 3.0, 61)
        most = replace(noise, repeatability=most_repeatability(found, shortened, J, grid, priors))
        unseen = bool((~known & ~shown)[rows_open].any())
        source: Source = "residuals" if unseen else "repeats" if assumed or wrong.any() else "declared"
        return ShownNoise(noise, most, source, len(contrast), ratio)

    def floor(self, design: Design) -> Floats:
        """(N, k) squares of what a perfect model would leave of the compared numbers: m^2; for readings, whitened."""
        return floor_of(self.noise, design)

    def excess(
        self, noise: ReadingNoise, observed: Observed, hypotheses: HypothesisSet, model: Posterior[Term]
    ) -> tuple[float, float, str]:
        """Size of a model's residuals over ``noise`` or ``most``, its p-value, and whose residuals: "" for all.

        A part is what one station, plane or socket gives, or one component. Of parts with a p-value of at most
        ``priors.chance`` over their number, the largest size counts. The weights of the search count: heavy tails are no
        excess.
        """
        design, rows = hypotheses.design, hypotheses.design.measured.rows
        power, effective_parameters = _power(noise, observed, hypotheses, model)
        _, first, read = np.unique(rows.read, return_index=True, return_inverse=True)
        share = np.bincount(read) / len(read)
        dof = np.maximum(np.append(share, 1.0) * (design.count - effective_parameters), 1.0)
        ratio = np.append(np.bincount(read, power), power.sum()) / dof
        chance = chi2.sf(ratio * dof, dof) if np.isinf(self.noise.dof) else f.sf(ratio, dof, self.noise.dof)
        chance[:-1] = np.minimum(len(share) * chance[:-1], 1.0)
        far = [i for i in range(len(share)) if len(share) > 1 and chance[i] <= hypotheses.priors.chance]
        worst = max([len(share), *far], key=lambda i: ratio[i])
        part = rows.what(int(first[worst])) if worst < len(share) else ""
        return float(np.sqrt(ratio[worst])), float(chance[worst]), part

    def share_left(self, observed: Observed, hypotheses: HypothesisSet, model: Posterior[Term]) -> float:
        """The chi-square beyond noise that a model's causes leave, as a share of that without causes."""
        beyond = []
        for some in (NOTHING, model):
            power, effective_parameters = _power(self.noise, observed, hypotheses, some)
            beyond.append(float(power.sum()) - (hypotheses.design.count - effective_parameters))
        return beyond[1] / beyond[0] if beyond[0] > 0.0 else 1.0


def _power(
    noise: ReadingNoise, observed: Observed, hypotheses: HypothesisSet, model: Posterior[Term]
) -> tuple[Floats, float]:
    """(N,) weighted chi-square of a model's residuals, and the number of parameters that it takes."""
    design = hypotheses.design
    residual, effective_parameters = left_over(hypotheses, model)
    whitening = noise.whitening(design.by_command_seen, design.components)
    errors = np.einsum("nij,nj->ni", whitening, design.coloured(residual))
    return observed.weight * (errors**2).sum(axis=1), effective_parameters


def floor_of(noise: ReadingNoise, design: Design) -> Floats:
    """As :meth:`ShownNoise.floor`, of any noise."""
    compared = (design.units @ design.whitening)[:, design.compared]
    covariance = noise.covariance(design.by_command_seen, design.components)
    return np.asarray(np.einsum("nij,njk,nik->ni", compared, covariance, compared))


NOISE_ROUNDS, LONG_NOISE_ROUNDS = 2, 6
"""Most times that the noise is re-estimated, with and without rods. A search with too small a noise explains some of the noise
by causes. Without rods, each search starts from the last model, so that more repetitions cost little time.
"""
MOST_POSES = 3000
"""Most poses that a search uses: more make it slower, but hardly better. The causes are then fitted to all poses."""
FEW_POSES = 1000
"""Most poses that a search uses where the model that it finds is long. Assumed; on a real arm with about a hundred lines
(docs/real_arms.md), models from searches on 600 and on 1,000 poses predicted other poses equally well.
"""


@dataclass(frozen=True)
class SearchState:
    """The rows and hypotheses that a search uses.

    ``kept``: the rows that were not set aside. ``everything``: the same rows, with noise and weights. ``searched``,
    ``observed``: the rows that the search uses, and the same with noise and weights. ``hypotheses``: those that the data
    can test. ``guess``: a model of everything that is not noise, by one search.
    """

    kept: Dataset
    everything: Observed
    searched: Dataset
    observed: Observed
    hypotheses: HypothesisSet
    guess: Posterior[Term]

    @property
    def references(self) -> References:
        """References for the fit of the causes: with all sessions of the search, also those that count as one there."""
        found = self.hypotheses.design.operating_points.references
        recorded = self.observed.covariates.get("session", ())
        return replace(found, sessions=tuple(sorted({str(name) for name in recorded})) if found.sessions else ())


def settle(prepared: Prepared, rows: Mask, scope: Scope, rng: np.random.Generator) -> SearchState:
    """Decide which of the rows (N,) are gross errors, estimate the noise, and propose hypotheses.

    Rows that the calibration had set aside, and that the model of a first search predicts, are no gross errors: the search is
    repeated with them.
    """
    found = _settled(prepared, rows, scope, rng)
    predicted = _predicted(prepared, rows, found)
    return _settled(prepared, rows | predicted, scope, rng) if predicted.any() else found


def _predicted(prepared: Prepared, rows: Mask, found: SearchState) -> Mask:
    """(N,) the rows outside of ``rows`` that the model of a search predicts to its uncertainty and noise.

    They looked like gross errors of the geometry alone, such as the first poses of a machine that becomes warm.
    """
    dataset, baseline, hypotheses = prepared.dataset, prepared.baseline, found.hypotheses
    left = ~rows & baseline.model.kinematics.forward(dataset.q).reached
    if not (left.any() and found.guess.terms):
        return np.zeros_like(left)
    both = np.flatnonzero(left | np.isin(dataset.row, found.searched.row))
    observed = Observed.of(dataset.take(both), baseline)
    merged = hypotheses.design.operating_points
    if "session" in observed.covariates:  # consecutive sessions may count as one in the search
        same = dict(zip(found.searched.covariates["session"], merged.covariates["session"], strict=True))
        names = np.array([same.get(name, name) for name in observed.covariates["session"]], dtype=object)
        observed = replace(observed, covariates={**observed.covariates, "session": names})
    observed = replace(observed, noise=observed.noise.sized_as(found.observed.noise))
    design = observed.design(baseline.model, merged.references)
    with unheard():  # of sessions all of whose rows are among these
        J, prior = design.beside(hypotheses.columns_at(design, found.guess))
    c, new = design.components, left[both]
    known = J[np.repeat(~new, c)]
    root = np.linalg.inv(np.linalg.cholesky(known.T @ known + np.diag(prior))).T
    residual = (design.y - J @ (root @ (root.T @ (known.T @ design.y[np.repeat(~new, c)])))).reshape(-1, c)
    half = (J @ root).reshape(-1, c, J.shape[1])[new]
    spread = np.linalg.cholesky(np.eye(c) + half @ np.swapaxes(half, 1, 2))
    residual[new] = np.linalg.solve(spread, residual[new][..., None])[..., 0]
    predicted = np.zeros_like(left)
    predicted[both] = ~_gross_rows(residual, design.measured, hypotheses.priors)
    return predicted & left


def _settled(prepared: Prepared, rows: Mask, scope: Scope, rng: np.random.Generator) -> SearchState:
    """As :func:`settle`, by one search.

    It uses at most ``MOST_POSES`` random rows; ``FEW_POSES`` for a robot without rods whose model is long.
    """
    kept, baseline = prepared.dataset.take(rows), prepared.baseline
    among_outliers = ~baseline.used(prepared.dataset)[rows]
    drawn = rng.permutation(len(kept))
    everything = Observed.of(kept, baseline)
    some = _part(drawn, among_outliers, FEW_POSES if baseline.model.robot.joint_sites else MOST_POSES)
    observed, used, hypotheses, guess = _reestimated(everything.take(some), prepared, scope)
    if len(some) < min(len(kept), MOST_POSES) and len(guess.terms) <= MOST_TERMS:
        del hypotheses, guess  # frees memory before the next are made
        some = _part(drawn, among_outliers, MOST_POSES)
        observed, used, hypotheses, guess = _reestimated(everything.take(some), prepared, scope)
    searched = kept.take(some[used])
    if len(some) == len(kept):
        return SearchState(searched, observed, searched, observed, hypotheses, guess)
    good = ~np.isin(np.arange(len(kept)), some[~used])
    noise = everything.noise.sized_as(observed.noise)
    tails = tails_of(observed, hypotheses, guess)
    everything = replace(everything, noise=noise, tails=tails).take(good)
    return SearchState(kept.take(good), everything, searched, observed, hypotheses, guess)


def _part(drawn: npt.NDArray[np.intp], among_outliers: Mask, most: int) -> npt.NDArray[np.intp]:
    """Sorted indices of the first ``most`` rows of a permutation.

    Up to half of them are rows that the calibration had set aside (``among_outliers``, (N,)), so that their cause can be found.
    """
    first = drawn[among_outliers[drawn]][: most // 2]
    return np.sort(np.concatenate([first, drawn[~among_outliers[drawn]]])[:most])


def _reestimated(
    observed: Observed, prepared: Prepared, scope: Scope
) -> tuple[Observed, Mask, HypothesisSet, Posterior[Term]]:
    """Estimate outliers and noise again, given the model of a search.

    Returns the poses without outliers, (N,) which poses these are, their hypotheses, and the model of the last search.
    """
    model = prepared.baseline.model
    hypotheses = propose(observed.design(model), scope)
    guess = rough_guess(hypotheses)
    # Where a cause is large, the calibration could not find the outliers.
    outliers = gross_errors(hypotheses, guess)
    used = ~outliers | clustered(hypotheses.design.operating_points, outliers, scope.priors)
    if not used.all() and guess.terms:
        observed = observed.take(used)
        del hypotheses  # frees memory before the next is made: it takes the most
        hypotheses = propose(observed.design(model), scope)
        guess = rough_guess(hypotheses, guess)
    else:
        used[:] = True
    for _ in range(LONG_NOISE_ROUNDS if hypotheses.long else NOISE_ROUNDS):
        noise = reestimate_noise(observed, hypotheses, guess, prepared.declared)
        if not noise.matters:
            break
        observed = noise.observed
        del hypotheses
        hypotheses = propose(observed.design(model), scope)
        guess = rough_guess(hypotheses, guess)
    return observed, used, hypotheses, guess


def searchable_rows(prepared: Prepared, priors: Priors) -> Mask:
    """(N,) the rows that a search uses: those of the calibration, and its outliers that are clustered."""
    dataset, baseline = prepared.dataset, prepared.baseline
    used = baseline.used(dataset)
    # Visits of a ball in a socket have nearly the same command, so that its gross errors are clustered.
    sockets = [i for i, table in enumerate(dataset.readings.tables) if isinstance(table, SocketTable)]
    reached = baseline.model.kinematics.forward(dataset.q).reached
    rows = np.flatnonzero(reached & ~np.isin(dataset.readings.of, sockets))
    if (~used[rows]).any():
        at = Observed.of(dataset.take(rows), baseline).operating_points(baseline.model)
        together = rows[clustered(at, ~used[rows], priors)]
        used[together] = True
        if len(together):
            named = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[together]))
            warn(f"used again, since what was set aside is clustered over a command or a load: poses {named}")
    return used


def clustered(at: OperatingPoints, outliers: Mask, priors: Priors) -> Mask:
    """(N,) the outliers that are clustered over a coordinate of the machine.

    Gross errors happen anywhere. Where at least half of the commands in an interval of one coordinate are outliers, something
    acts there: a pit of a track, play that a load takes up, a step near a track's end. For each interval that begins and ends
    at an outlier, the chance is that of so many outliers among its commands (binomial distribution, which bounds the
    hypergeometric one), times the number of such intervals of all coordinates (Bonferroni). Needed by a pit of a track:
    tests/diagnosis/test_searched_rows.py.

    ``outliers``: (N,) rows. Visits of one command count as one: what is wrong there can be wrong at each visit.
    """
    command = np.unique(at.q, axis=0, return_inverse=True)[1].ravel()
    bad = np.bincount(command, outliers) > 0
    count = int(bad.sum())
    together = np.zeros(len(bad), dtype=bool)
    if count < priors.least_cluster:
        return together[command]
    # One row of each command: of those with outliers, an outlier, because directions of approach may differ.
    order = np.lexsort((~outliers, command))
    rows = order[np.flatnonzero(np.diff(command[order], prepend=-1))]
    coordinates = _coordinates(at)[rows]
    tries = coordinates.shape[1] * count * (count - 1) / 2.0
    for values in coordinates.T:
        ordered = np.argsort(values, kind="stable")
        before = np.concatenate([[0], np.cumsum(bad[ordered])])
        ends = np.unique(values[bad])
        low, high = (np.searchsorted(values[ordered], ends, side) for side in ("left", "right"))
        inside, hits = high[None] - low[:, None], before[high][None] - before[low][:, None]
        dense = (hits >= priors.least_cluster) & (2 * hits >= inside)
        chance = bdtrc(np.maximum(hits - 1, 0), np.maximum(inside, 1), count / len(bad)) * tries
        for i, j in np.argwhere(dense & (chance < priors.cluster_chance)):
            together |= bad & (values >= ends[i]) & (values <= ends[j])
    return outliers & together[command]


def _coordinates(at: OperatingPoints) -> Floats:
    """(N, m) commands, directions of approach, payload, and the loads of rods or joints."""
    names = [*(f"approach{k + 1}" for k in range(at.robot.n_actuators)), "payload"]
    columns = [at.q, *(at.covariate(name)[:, None] for name in names if at.varies(name))]
    return np.hstack([*columns, *(loads_of(at, site)[0] for site in loaded_along(at.robot))])
