"""The converged state of a calibration's iterations, and whether its noise explains the residuals.

What repeats is not what is right: residuals are judged between poses, by the means of each pose's visits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gtpin.calibration.gauss_newton import Fit, fit
from gtpin.calibration.left_out import MOST_LEFT_OUT, left_out
from gtpin.calibration.observability import Observability, observability, with_priors
from gtpin.distributions import chi2, f, interval_above_0, truncated
from gtpin.instruments.readings import Readings
from gtpin.model.fit_conditions import ModelDiscrepancy
from gtpin.noise import weights
from gtpin.noise.estimate import stops
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Indices, Mask

LACK_OF_FIT = 1e-3
"""p-value of chi-square below which the model counts as incomplete. Assumed."""


def places_of(measured: Readings) -> Indices:
    """(N, c) index of the pose and the component of each number: equal for what is read of one pose again and again.

    A known distance of sockets, which is assigned to several rows, is no repeated reading: each of its rows has its own index.
    """
    counted = measured.counted
    c = counted.shape[1]
    places: Indices = stops(measured.q, measured.read)[:, None] * c + np.arange(c)
    parts = (counted > 0.0) & (counted < 1.0)
    places[parts] = places.max() + 1 + np.arange(np.count_nonzero(parts))
    return places


def _chance(power: float, free: float, dof: float) -> float:
    """p-value of a sum of squares in units of the noise, with ``free`` degrees of freedom, and ``dof`` of the noise."""
    return float(chi2.sf(power, free) if np.isinf(dof) else f.sf(power / free, free, dof))


def mean_power(whitened: Floats, places: Indices, weight: Floats) -> float:
    """Sum of squares of the mean residuals of all places, each in units of the noise of such a mean.

    ``whitened``: (M,) residuals in units of the noise of a single visit. ``places``: (M,) index of the place of each.
    ``weight``: (M,) weights of a robust fit.
    """
    sums, weights = np.bincount(places, weight * whitened), np.bincount(places, weight)
    own = weights > 0.0
    return float((sums[own] ** 2 / weights[own]).sum())


def unexplained_by(fit: Fit, errors: Floats, variance: Floats, *, known: bool, dof: float) -> ModelDiscrepancy:
    """What a fit leaves unexplained between poses: the scatter of the poses' mean residuals beyond that of the noise.

    A number of a pose counts once, with the mean of its visits, and the degrees of freedom are the count of these means less
    the parameters that were fitted. One standard deviation of the mean square is added. Where chi-square shows no unexplained
    errors, they are 0 beside a declared noise. Noise that repeated visits show is less certain: then they are what the mean
    square lets expect above 0. The upper end of their interval is not 0.

    ``fit``: the fit of N rows with c numbers each. ``errors``: (N, c) its residuals, m and rad. ``variance``: (N, c)
    variance of the noise of each number, m^2 or rad^2. ``known``: whether the noise was declared, or repeated visits showed
    it. Otherwise all residuals count as unexplained. ``dof``: degrees of freedom of the noise; infinite where it was
    declared.
    """
    measured = fit.problem.measured
    counted = measured.counted > 0.0
    places, turns = places_of(measured)[counted], measured.group_turns[measured.group][counted]
    visits = np.bincount(places)
    own = np.unique(places, return_index=True)[1]  # one number of each pose and component
    means, noise = (np.bincount(places, x[counted])[places[own]] / visits[places[own]] for x in (errors, variance))
    free = max(len(own) - fit.effective_parameters, 1.0)
    explained = False
    if known:
        power = mean_power(fit.residual[counted], places, np.ones(len(places)))
        explained = _chance(power, free, dof) >= LACK_OF_FIT

    def size(some: Mask) -> tuple[float, float, float]:
        """Unexplained error of a kind of numbers, and the ends of its 95 % interval."""
        if not some.any():
            return 0.0, 0.0, 0.0
        same = measured.group_turns[measured.group] == turns[own][some][0]
        of_kind = max(some.sum() - _parameters_of(fit, same), 1.0)
        seen = float((means[some] ** 2).sum()) / of_kind
        random = float((noise[some] / visits[places[own]][some]).mean()) if known else 0.0
        sd = float(np.hypot(max(seen, random) * np.sqrt(2.0 / of_kind), random * np.sqrt(2.0 / dof)))
        more, width = seen - random, max(sd, 1e-300)
        least, most = interval_above_0(more, width)
        found = max(more + sd, 0.0)
        if explained:
            found = 0.0 if np.isinf(dof) else truncated(more, width)[0]
        return float(np.sqrt(found)), 0.0 if explained or not known else float(np.sqrt(least)), float(np.sqrt(most))

    position, least, most = size(~turns[own])
    return ModelDiscrepancy(position, 0.0 if explained else size(turns[own])[0], known, least, most)


def _parameters_of(fit: Fit, some: Mask) -> float:
    """The effective number of parameters that the numbers of a mask (N, c) take: the sum of their leverages, where there are
    others; of at most 2,000 rows, in proportion."""
    if some.all():
        return fit.effective_parameters
    rows = np.unique(np.linspace(0, len(some) - 1, min(len(some), MOST_LEFT_OUT)).round().astype(int))
    leverage = ((fit.problem.jacobian(fit.point, rows, fit.weight[rows]) @ fit.root) ** 2).sum(axis=2)
    return float(fit.effective_parameters * leverage[some[rows]].sum() / max(leverage.sum(), 1e-300))


@dataclass(frozen=True)
class FitState:
    """The converged state of the iterations.

    - ``fit``: the last fit, of the rows that are used.
    - ``used``: (N,) the rows that are not gross errors.
    - ``noise``: noise of all rows, used or not.
    - ``tails``: tails of the noise, for each group of rows that are compared with each other.
    - ``steps``: number of steps of all fits.
    - ``geometry``: the nominal geometry with the tolerances that were given; those of the fit are wider where the data
      demanded it.
    - ``doubt``: what else the data fit with a geometry much nearer to nominal, in words; empty where nothing is known.
    - ``noise_scale``: factor by which the noise was multiplied in the last fit. It is larger than 1 where the fit would
      otherwise not converge.
    """

    fit: Fit
    used: Mask
    noise: ReadingNoise
    tails: tuple[weights.Tails, ...]
    steps: int
    geometry: Geometry
    noise_scale: float = 1.0
    doubt: str = ""

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residuals, without robust weights."""
        return float((self.fit.residual**2).sum()) * self.noise_scale**2

    @property
    def dof(self) -> float:
        """Number of independent measured numbers less the effective number of parameters."""
        return self.fit.problem.count - self.fit.effective_parameters

    @property
    def heavy(self) -> list[weights.Tails]:
        """The tails that are heavier than Gaussian."""
        return [tails for tails in self.tails if tails.heavy]

    @property
    def scale(self) -> float:
        """Ratio of the residuals of single visits to noise: the scale of heavy tails, where it is above 1.2, else the root of
        chi-square; at least ``noise_scale``."""
        if self.heavy:
            return max([self.noise_scale, *(tails.scale for tails in self.heavy if tails.scale > 1.2)])
        return max(self.noise_scale, float(np.sqrt(self.chi2 / max(self.dof, 1.0))))

    @property
    def _between(self) -> tuple[float, float, float]:
        """Sums of squares of the fit's whitened and weighted residuals, of the visits' means and of single visits; and the
        number of the means, where what is known in part counts in part."""
        measured = self.fit.problem.measured
        counted = measured.counted.ravel()
        some = counted > 0.0
        places, residual = places_of(measured).ravel()[some], self.fit.residual.ravel()[some]
        weight = np.repeat(self.fit.weight, self.fit.residual.shape[1])[some]
        own = np.unique(places, return_index=True)[1]
        return (
            mean_power(residual, places, weight),
            float((weight * residual**2).sum()),
            float(counted[some][own].sum()),
        )

    @cached_property
    def sigma_scale(self) -> float:
        """Ratio of the poses' mean residuals to the noise of such means where these show a lack of fit, or ``noise_scale``."""
        if self.heavy:
            return self.scale * self._repeating
        means, _, count = self._between
        power, free = means * self.noise_scale**2, max(count - self.fit.effective_parameters, 1.0)
        lacks = _chance(power, free, self.noise.dof) < LACK_OF_FIT
        return max(self.noise_scale, float(np.sqrt(power / free))) if lacks else self.noise_scale

    @property
    def _repeating(self) -> float:
        """Ratio of the poses' mean residuals to those of independent visits; 1 where an F test shows no more."""
        means, whole, count = self._between
        free, inner = max(count - self.fit.effective_parameters, 1.0), self.fit.problem.count - count
        within = max(whole - means, 1e-12 * whole)
        if inner < 1.0 or f.sf((means / free) / (within / inner), free, inner) >= LACK_OF_FIT:
            return 1.0
        return max(1.0, float(np.sqrt((means / free) / (whole / (free + inner)))))

    @cached_property
    def final(self) -> Fit:
        """The fit whose covariance includes the lack of fit: weights of heavy tails include the scale of these."""
        factor = self.sigma_scale if self.noise_scale > 1.0 or not self.heavy else self._repeating
        if factor <= 1.0:
            return self.fit
        weight = self.fit.weight
        return fit(self.fit.problem.noisier(factor / self.noise_scale), lambda _: weight, self.fit.point.x)

    @cached_property
    def _left_out(self) -> Floats:
        """(N, c) errors of the rows when their pose is left out of the fit, m and rad; NaN of those that are not left out."""
        errors, some = left_out(self.fit)
        found = np.full((len(self.used), errors.shape[1]), np.nan)
        found[np.flatnonzero(self.used)[some]] = errors
        return found

    def predicts_better_than(self, other: FitState) -> bool:
        """Whether poses that are left out have smaller errors than with another fit, in the geometric mean of the units."""
        measured = self.fit.problem.measured
        turns = np.zeros(self._left_out.shape, dtype=bool)
        turns[self.used] = measured.group_turns[measured.group]
        both = np.isfinite(self._left_out) & np.isfinite(other._left_out)
        ratio = 0.0
        for some in (both & turns, both & ~turns):
            if some.any():
                ratio += np.log((self._left_out[some] ** 2).mean() / (other._left_out[some] ** 2).mean())
        return bool(ratio < 0.0)

    @cached_property
    def observability(self) -> Observability:
        """Of the geometry."""
        return observability(with_priors(self.final), self.fit.problem.n_geometry, self.final.residual.size)

    @property
    def deviation(self) -> Floats:
        """(p,) deviations of the fitted geometry from nominal, in units of the tolerances that were given."""
        fitted = self.fit.problem.start.geometry
        return np.asarray(self.fit.point.x[: len(fitted.parameters)] * fitted.tolerance / self.geometry.tolerance)

    @property
    def log_evidence(self) -> float:
        """Logarithm of the marginal likelihood, but for a constant (Laplace approximation about the fit)."""
        problem = self.fit.problem
        x = np.where(problem.prior == 1.0, self.fit.point.x[: problem.size], 0.0)
        power = self.fit.weight @ (self.fit.residual**2).sum(axis=1) + x @ x
        noise = float(np.log(self.noise.take(self.used).each).sum())
        return 0.5 * float(np.linalg.slogdet(self.fit.covariance)[1]) - 0.5 * float(power) - noise

    @property
    def widened(self) -> float:
        """Largest factor by which the tolerances of the fit are wider than those that were given; 1 where they are equal."""
        return float((self.fit.problem.start.geometry.tolerance / self.geometry.tolerance).max(initial=1.0))
