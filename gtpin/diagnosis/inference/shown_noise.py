"""Declared noise, compared with what residuals and repeated visits show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gtpin.calibration.checks.declared_noise import SIGMAS, Sigma
from gtpin.calibration.result import Calibration
from gtpin.diagnosis.hypotheses.hypothesis import Scope
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, HypothesisSet
from gtpin.diagnosis.hypotheses.propose import propose
from gtpin.diagnosis.inference.reestimate_noise import left_over, most_repeatability, reestimate_noise
from gtpin.diagnosis.inference.search import rough_guess
from gtpin.diagnosis.linear.design import Design, Observed
from gtpin.diagnosis.linear.posterior import NOTHING
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.priors import Priors
from gtpin.distributions import chi2, f
from gtpin.errors import warn
from gtpin.noise.estimate import LEAST_CONTRASTS, contradicted, contrasts, from_repeats, stops, tamed, within_residuals
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

LOOKED_AT = 1000
"""At most this many poses are used, evenly spread over the rows: 1,000 determine a sigma to 2 %."""
LOOKS = 2
"""Number of searches, each with the noise from the last one. With too small a noise, a search explains some of it by causes."""


def understated_noise(prepared: Prepared, scope: Scope) -> dict[Sigma, tuple[float, float]]:
    """Sigmas that are declared too small: by key, the declared value and the estimated one, m or rad.

    The estimate is the smaller of two: from the residuals after a search, and, where there are repeated visits, from their
    differences. An effect that depends on the pose is in the residuals, but not in these differences.

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
    misfit = baseline.chi2_per_dof * max(sizes, default=1.0) ** 2
    if not declared or misfit < scope.priors.misfit:
        return {}
    sure = prepared.dataset.take(baseline.used(prepared.dataset))
    observed = Observed.of(sure, baseline).take(np.arange(len(sure))[:: 1 + len(sure) // LOOKED_AT])
    repeats = _of_repeats(observed, baseline)
    most = scope.priors.understated_once if repeats is None else scope.priors.understated
    if repeats is not None and all(getattr(repeats, key) <= most * value for key, value in declared.items()):
        return {}  # the smaller of the two estimates is no larger: no search is needed
    noise = replace(observed.noise.scaled(float(np.sqrt(misfit))), repeatability=0.0)
    noise = replace(noise, estimated=np.ones_like(noise.estimated))
    guess: Explanation = NOTHING
    for _ in range(LOOKS):
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
    """Warn which declared sigmas are replaced."""
    for key, (declared, seen) in small.items():
        ratio = seen / declared
        warn(
            f"{key} is {declared:.2g}, but these data scatter by {seen:.2g}, {ratio:.2g} times more: the search for causes "
            "assumes this scatter, the verdict does not"
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


Source = Literal["declared", "repeats", "residuals"]


@dataclass(frozen=True)
class ShownNoise:
    """The noise of a diagnosis's rows by declaration and visits.

    ``noise``: declared sigmas, and repeatability and undeclared sigmas from visits. ``most``: the same with the
    largest repeatability that the visits allow. ``source``: ``declared``, ``repeats``, or ``residuals`` where a sigma was
    neither declared nor shown by visits: an assumption. ``visits``: number of repeated visits, beyond the first of each pose.
    ``contradicted``: whether the visits scatter otherwise than the declared noise and drives do: with other sigmas, a fifth
    larger at least, their scatter is much likelier. Something then changes between visits.
    """

    noise: ReadingNoise
    most: ReadingNoise
    source: Source
    visits: int
    contradicted: bool = False

    @staticmethod
    def of(
        observed: Observed,
        hypotheses: HypothesisSet,
        guess: Explanation,
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
        rows_open = np.unique(base.group[~np.isfinite(base.row_sigma)])
        assumed = bool((~known)[rows_open].any())
        residual, effective_parameters = left_over(hypotheses, guess)
        errors = design.coloured(residual)
        contrast, rows = contrasts(stops(design.measured.q, design.measured.read), errors)
        if len(contrast) < LEAST_CONTRASTS:
            return ShownNoise(base, base, "residuals" if assumed else "declared", len(contrast))
        J = design.by_command_seen[rows]
        found = from_repeats(replace(base, repeatability=0.0).take(rows), contrast, J)
        shown = np.bincount(base.group[rows].ravel(), minlength=len(sigma)) >= LEAST_CONTRASTS
        noise = replace(base, sigma=found.sigma, repeatability=found.repeatability, dof=found.dof)
        errors *= np.sqrt(design.count / max(design.count - effective_parameters, 1.0))
        noise = within_residuals(noise, errors, design.by_command_seen)
        shortened = tamed(contrast, found.group)
        unit = float(np.median(found.each) / max(np.sqrt((J**2).sum(axis=2)).mean(), 1e-12))
        grid = max(found.repeatability, unit) * np.linspace(0.0, 3.0, 61)
        most = replace(noise, repeatability=most_repeatability(found, shortened, J, grid, priors))
        unseen = bool((~known & ~shown)[rows_open].any())
        source: Source = "residuals" if unseen else "repeats" if assumed else "declared"
        wrong = contradicted(found, contrast, J, priors.excess, priors.chance)
        return ShownNoise(noise, most, source, len(contrast), bool(wrong.any()))

    def floor(self, design: Design) -> Floats:
        """(N, k) squares of what a perfect model would leave of the compared numbers: m^2; for readings, whitened."""
        return floor_of(self.noise, design)

    def excess(
        self, noise: ReadingNoise, observed: Observed, hypotheses: HypothesisSet, model: Explanation
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

    def share_left(self, observed: Observed, hypotheses: HypothesisSet, model: Explanation) -> float:
        """The chi-square beyond noise that a model's causes leave, as a share of that without causes."""
        beyond = []
        for some in (NOTHING, model):
            power, effective_parameters = _power(self.noise, observed, hypotheses, some)
            beyond.append(float(power.sum()) - (hypotheses.design.count - effective_parameters))
        return beyond[1] / beyond[0] if beyond[0] > 0.0 else 1.0


def _power(
    noise: ReadingNoise, observed: Observed, hypotheses: HypothesisSet, model: Explanation
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
