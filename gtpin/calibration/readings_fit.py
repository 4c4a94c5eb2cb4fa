"""Robust fit of geometry and instruments' unknowns: gross errors are rejected and noise is estimated until both converge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit, fit
from gtpin.calibration.readings_problem import ReadingsProblem
from gtpin.calibration.reweighting import (
    COARSE,
    FREE_ITERATIONS,
    LOST,
    MAX_ITERATIONS,
    ROUGH,
    ROUGH_STEPS,
    ROUGHLY,
    Progress,
)
from gtpin.calibration.settled import CORE, LACK_OF_FIT
from gtpin.distributions import chi2, f
from gtpin.errors import ConvergenceError
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.noise import weights
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.noise.repeats import LEAST_CONTRASTS, contrasts

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

SETTLED = 1e-3
"""Relative change of a sigma below which it has converged."""

ABSURD = 15.0
"""Residual of a row over the robust scale of the others, beyond which it is a gross error however heavy the tails are: a few
gross errors of a single number look like tails that explain them. Assumed; as ``absurd`` of a diagnosis."""

WIDE = 1.5
"""Size of residuals, in units of the noise, from which a fit that does not converge is repeated with noise of that size.
Assumed."""


@dataclass(frozen=True)
class SettledReadings:
    """The converged state of the iterations.

    Parameters
    ----------
    fit
        The last fit, of the rows that are used.
    used
        (N,) the rows that are not gross errors.
    noise
        Noise of all rows, used or not.
    tails
        Tails of the noise, for each group of rows that are compared with each other: an instrument, or one of its sigmas
        where a row has one number.
    steps
        Number of steps of all fits.
    wide
        Factor by which the noise was multiplied in the last fit. It is larger than 1 where the fit would otherwise not
        converge.
    """

    fit: Fit[ReadingsProblem]
    used: Mask
    noise: ReadingNoise
    tails: tuple[weights.Tails, ...]
    steps: int
    wide: float = 1.0

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residuals, without robust weights."""
        return float((self.fit.residual**2).sum()) * self.wide**2

    @property
    def dof(self) -> float:
        """Number of independent readings less the effective number of parameters."""
        return float(self.fit.problem.readings.counted.sum()) - self.fit.taken

    @property
    def excess(self) -> float:
        """Ratio of residuals to noise where chi-square or heavy tails show a lack of fit; else ``wide``."""
        if any(tails.heavy for tails in self.tails):
            return max([self.wide, *(tails.scale for tails in self.tails if tails.heavy and tails.scale > CORE)])
        if chi2.sf(self.chi2, self.dof) >= LACK_OF_FIT:
            return self.wide
        return max(self.wide, float(np.sqrt(self.chi2 / self.dof)))

    def refit(self, factor: float) -> Fit[ReadingsProblem]:
        """The fit with the noise multiplied by a factor."""
        problem = replace(self.fit.problem, whitening=self.fit.problem.whitening * self.wide / factor)
        weight = self.fit.weight
        return fit(problem, lambda _: weight, self.fit.point.x)


@dataclass(frozen=True)
class RobustFit:
    """The robust fit of a calibration, with its input.

    Parameters
    ----------
    start
        The nominal model.
    readings
        The readings, with a first guess of the unknowns.
    rows, visits
        (N,) line number of each row in its file, and index of its commands.
    near
        (N) nominal poses, base frame.
    progress
        Called with the name of the step, the iteration, and the RMS residual in units of the noise.
    """

    start: Model
    readings: Readings
    rows: npt.NDArray[np.int64]
    visits: npt.NDArray[np.intp]
    near: Poses
    progress: Progress | None

    def run(self) -> SettledReadings:
        """Iterate until rejected rows and noise do not change.

        Raises
        ------
        ConvergenceError
            If a fit or the iteration does not converge.
        """
        readings = self.readings
        usual, by_row = readings.usual.copy(), np.isfinite(readings.row_sigma)
        known = np.array([sigma is not None for sigma in readings.declared])
        for group in np.setdiff1d(readings.group[by_row], readings.group[~by_row]):  # all of its rows declare their own
            known[group] = True
            usual[group] = np.sqrt((readings.row_sigma[by_row & (readings.group == group)] ** 2).mean())
        noise = ReadingNoise(usual, readings.group, readings.row_sigma, ~known).at_least(SMALLEST)
        used = np.ones(len(self.rows), dtype=bool)
        tails = tuple(weights.Tails() for _ in self._alike(used))
        rough = noise.at_least(ROUGH)
        outcome = self._fit(used, rough, self._huber, None, "rough fit", rough=True)
        steps = outcome.iterations
        if self._scale(outcome.residual, used) > LOST:
            x = None
            for sigma in COARSE:
                x = self._fit(used, noise.at_least(sigma), self._huber, x, "coarse fit", rough=True).point.x
            outcome = self._fit(used, rough, self._huber, x, "rough fit", rough=True)
            steps += outcome.iterations
        if not known.all():
            noise = self._roughly(noise, self._left(outcome, used), known)
        wide = 1.0
        for number in range(1, MAX_ITERATIONS + 1):
            left = self._left(outcome, used)
            whitened = left / noise.each
            now_used = ~self._gross(whitened, used)
            if number > FREE_ITERATIONS:
                now_used |= used
            now_noise = noise if known.all() else self._estimated(noise, outcome, used, now_used, left, known)
            if number > FREE_ITERATIONS:
                now_noise = replace(now_noise, sigma=np.maximum(now_noise.sigma, noise.sigma))
            now_tails = self._tails(whitened, now_used)
            same = (np.abs(now_noise.sigma - noise.sigma) <= SETTLED * noise.sigma).all()
            freedoms = number > FREE_ITERATIONS or [t.freedom for t in now_tails] == [t.freedom for t in tails]
            if number > 1 and same and freedoms and (now_used == used).all():
                return SettledReadings(outcome, used, noise, tails, steps, wide)
            used, noise = now_used, now_noise
            if number == FREE_ITERATIONS:  # tails that come and go with their own weights are heavy
                tails = tuple(min(pair, key=lambda t: t.freedom) for pair in zip(now_tails, tails, strict=True))
            elif number < FREE_ITERATIONS:
                tails = now_tails
            try:
                outcome = self._fit(
                    used, noise, self._weigher(tails, wide), outcome.point.x, f"fit {number}", wide=wide
                )
            except ConvergenceError:
                wide = self._misfit(noise, outcome, used)
                if wide < WIDE:
                    raise
                weigh = self._weigher(tails, wide)
                outcome = self._fit(used, noise, weigh, outcome.point.x, f"fit {number}", wide=wide)
            steps += outcome.iterations
        raise ConvergenceError(
            f"noise and gross errors have not converged in {MAX_ITERATIONS} iterations",
            hint="declare each instrument's sigma in dataset.toml",
        )

    def _fit(
        self,
        used: Mask,
        noise: ReadingNoise,
        weigh: Callable[[Floats, Mask], Floats],
        x: Floats | None,
        what: str,
        rough: bool = False,
        wide: float = 1.0,
    ) -> Fit[ReadingsProblem]:
        def report(iteration: int, rms: float) -> None:
            if self.progress is not None:
                self.progress(what, iteration, rms)

        own = noise.take(used).scaled(wide)
        problem = ReadingsProblem(
            self.start, self.readings.take(used), own.whitening(own.each[..., None], own.each.shape[1])
        )
        near, x = self.near[used], problem.first if x is None else x
        if rough:
            return fit(problem, lambda r: weigh(r, used), x, report, near=near, decrease=ROUGHLY, enough=ROUGH_STEPS)
        return fit(problem, lambda r: weigh(r, used), x, report, near=near)

    def _left(self, outcome: Fit[ReadingsProblem], used: Mask) -> Floats:
        """(N, c) residuals of a fit at all rows."""
        poses = outcome.point.poses
        if not used.all():
            poses = outcome.point.model.kinematics.forward(self.readings.q, self.near)
        return self.readings.at(outcome.problem.unknowns(outcome.point.x)).minus(poses)

    def _alike(self, used: Mask) -> list[npt.NDArray[np.intp]]:
        """Groups of used rows whose residuals are compared with each other; indices among the used rows."""
        place = np.cumsum(used) - 1
        return [place[rows[used[rows]]] for rows in self.readings.alike]

    def _huber(self, residual: Floats, used: Mask) -> Floats:
        weight = np.ones(len(residual))
        for rows in self._alike(used):
            if len(rows):
                weight[rows] = weights.huber(residual[rows])
        return weight

    def _misfit(self, noise: ReadingNoise, outcome: Fit[ReadingsProblem], used: Mask) -> float:
        """Size of the residuals of a fit in units of a noise."""
        return self._scale((self._left(outcome, used) / noise.each)[used], used)

    def _weigher(self, tails: tuple[weights.Tails, ...], wide: float) -> Callable[[Floats, Mask], Floats]:
        def weigh(residual: Floats, used: Mask) -> Floats:
            weight, residual = np.ones(len(residual)), residual * wide
            for rows, of in zip(self._alike(used), tails, strict=True):
                # The information of the data is less than that of the weighted squares that fit them.
                weight[rows] = of.weigh(residual[rows]) * of.kept(residual.shape[1])
            return weight

        return weigh

    def _scale(self, residual: Floats, used: Mask) -> float:
        return max(weights.robust_scale(residual[rows]) for rows in self._alike(used) if len(rows))

    def _tails(self, whitened: Floats, used: Mask) -> tuple[weights.Tails, ...]:
        some = whitened[used]
        return tuple(weights.Tails.of(some[rows]) if len(rows) else weights.Tails() for rows in self._alike(used))

    def _gross(self, whitened: Floats, used: Mask) -> Mask:
        """(N,) rows with a gross error in any number, or with a pose that the model can't reach; a table's row is rejected as
        a whole."""
        found: Mask = np.asarray(~np.isfinite(whitened).all(axis=1))
        for rows in self._alike(np.ones(len(used), dtype=bool)):
            if used[rows].any():
                own = whitened[rows]
                absurd = weights.square_norms(own) > (ABSURD * weights.robust_scale(own[used[rows]])) ** 2
                found[rows] |= weights.gross(own, used[rows]) | absurd
        return np.isin(self.rows, self.rows[found])

    def _roughly(self, noise: ReadingNoise, left: Floats, known: Mask) -> ReadingNoise:
        """Sigmas that are not declared, by medians."""
        sigma = noise.sigma.copy()
        for group in np.flatnonzero(~known):
            own = np.abs(left[(self.readings.group == group) & ~np.isfinite(self.readings.row_sigma)])
            if len(own):
                sigma[group] = max(SMALLEST, float(np.median(own)) / 0.6745)
        return replace(noise, sigma=sigma)

    def _estimated(
        self, noise: ReadingNoise, outcome: Fit[ReadingsProblem], fitted: Mask, used: Mask, left: Floats, known: Mask
    ) -> ReadingNoise:
        """Sigmas that are not declared, from the residuals, or from repeated readings where their sigma is significantly
        smaller."""
        both = fitted & used
        free = ~np.isfinite(self.readings.row_sigma)
        group, groups = self.readings.group, len(noise.sigma)
        weight = outcome.weight * both[fitted]
        taken = np.zeros(outcome.residual.shape)
        covariance = outcome.covariance
        for rows in outcome.problem.chunks():
            J = outcome.problem.jacobian(outcome.point, rows, weight[rows])
            taken[rows] = np.einsum("nci,ij,ncj->nc", J, covariance, J, optimize=True)
        squares, counts = np.zeros(groups), np.zeros(groups)
        counted = np.where(free[fitted], weight[:, None], 0.0)
        np.add.at(squares, group[fitted], counted * left[fitted] ** 2)
        np.add.at(counts, group[fitted], counted - np.where(free[fitted], taken, 0.0))
        found = noise.refitted(squares, np.maximum(counts, 1.0), known)
        again_squares, again = self._of_repeats(left, used, groups)
        sigma = found.sigma.copy()
        for g in np.flatnonzero(~known & (again >= LEAST_CONTRASTS)):
            repeated = max(float(np.sqrt(again_squares[g] / again[g])), SMALLEST)
            if float(f.sf((found.sigma[g] / repeated) ** 2, max(counts[g], 1.0), again[g])) < LACK_OF_FIT:
                sigma[g] = repeated
        return replace(found, sigma=sigma)

    def _of_repeats(self, left: Floats, used: Mask, groups: int) -> tuple[Floats, Floats]:
        """(G,) squares of contrasts between readings of one kind at one stop of the machine, and their number."""
        same = np.unique(np.column_stack([self.readings.rows.read, self.visits]), axis=0, return_inverse=True)[
            1
        ].ravel()
        contrast, places = contrasts(same[used], left[used])
        squares, counts = np.zeros(groups), np.zeros(groups)
        of = self.readings.group[used][places]
        for group in range(groups):
            own = contrast[of == group]
            if len(own):
                # A gross error of one reading must not enlarge the noise of the others: contrasts are limited to four sigmas.
                limit = 4.0 * float(np.median(np.abs(own))) / 0.6745
                squares[group], counts[group] = (np.clip(own, -limit, limit) ** 2).sum(), len(own)
        return squares, counts
