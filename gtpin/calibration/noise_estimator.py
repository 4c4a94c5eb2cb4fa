"""The noise of a calibration, from what is declared, repeated visits, or the residuals of a fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtpin.calibration.fit_state import LACK_OF_FIT
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.marginal import MarginalLikelihood
from gtpin.calibration.problem import Point, Problem
from gtpin.distributions import f, norm
from gtpin.errors import DatasetError
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses, chunks
from gtpin.noise.estimate import ENOUGH, LEAST_CONTRASTS, contradicted, contrasts, from_repeats, stops, within_residuals
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise, range_ratio
from gtpin.typing import Floats, Indices, Mask

ALIKE = 1e-3
"""Relative change of an estimated sigma below which it has converged."""


@dataclass(frozen=True)
class NoiseEstimator:
    """Estimates the part of the noise that is not declared; its attributes are those of
    :class:`~gtpin.calibration.robust_fit.RobustFit`."""

    whole: Problem
    near: Poses
    visits: Indices
    lacking: bool

    @cached_property
    def first(self) -> ReadingNoise:
        """The noise at the start: declared sigmas, and an instrument's usual values for the others."""
        measured = self.whole.measured
        group, by_row, initial_sigma = measured.group, np.isfinite(measured.row_sigma), measured.initial_sigma.copy()
        known = np.array([sigma is not None for sigma in measured.declared])
        for one in np.setdiff1d(group[by_row], group[~by_row]):  # all of its rows declare their own
            known[one] = True
            own = by_row & (group == one)  # a number that is divided among rows was declared as one
            initial_sigma[one] = np.sqrt((measured.row_sigma[own] ** 2 * measured.counted[own]).mean())
        noise = ReadingNoise(initial_sigma, group, measured.row_sigma, ~known).at_least(SMALLEST)
        station = measured.station
        if station is not None and np.linalg.norm(measured.poses[0] - station, axis=1).min() < 0.1:
            what = "the instrument's station lies among the measured poses"
            raise DatasetError(what, hint="correct station in dataset.toml")
        return noise if station is None else noise.towards(measured.poses[0], station)

    @cached_property
    def by_command(self) -> Floats:
        """(N, c, n) derivative of the measured numbers by the commands, of the start."""
        return self.whole.by_command(Point(self.whole.first, self.whole.start, self.near), slice(None))

    @cached_property
    def stops(self) -> Indices:
        """(N,) index of each row's commands and of what was read there: rows of one index repeat one measurement."""
        return stops(self.visits, self.whole.measured.read)

    def derivative(self, noise: ReadingNoise, rows: Indices | slice = slice(None)) -> Floats:
        """(M, c, n) ``by_command`` of some rows; zeros, which are not computed, where the noise has no part of the drives."""
        if noise.repeatability > 0.0:
            return self.by_command[rows]
        return np.broadcast_to(0.0, (len(self.near.T[rows]), self.whole.measured.components, 1))

    def estimate(self, noise: ReadingNoise, outcome: Fit, fitted: Mask, used: Mask, residual: Floats) -> ReadingNoise:
        """The noise, with its undeclared part estimated from repeated visits, or otherwise from the residuals.

        ``noise``, ``outcome``: the previous estimate, and the last fit. ``fitted``, ``used``: (N,) the rows of this fit,
        and those that are not gross errors. ``residual``: (N, c) residuals of all rows, m and rad.
        """
        if noise.sight is not None and noise.reach is not None:
            ratio = range_ratio(noise.sight[used], noise.reach[used], residual[used, :3])
            noise = replace(noise, range_ratio=ratio)
        contrast, rows = contrasts(self.stops[used], residual[used])
        rows = np.flatnonzero(used)[rows]
        open_ = noise.estimated.any()
        if len(contrast) < LEAST_CONTRASTS:
            if not open_:
                return noise
            found = self._from_residuals(noise, outcome, fitted, used)
            # With positions only, or with one declared sigma, repeatability and the instrument's noise look much alike.
            several = noise.estimated.all() and self.whole.measured.components > 3
            return self._with_repeatability(found, outcome, used, residual) if several and not self.lacking else found
        J = self.by_command[rows]
        repeated = from_repeats(noise.take(rows), contrast, J)
        wrong = contradicted(repeated, contrast, J)
        if wrong.any():
            noise = replace(noise, estimated=noise.estimated | wrong)
            repeated = from_repeats(noise.take(rows), contrast, J)
        some, errors = self._residuals(outcome, used, residual)
        repeated = within_residuals(repeated.at_rows_of(noise).take(some), errors, self.by_command[some])
        repeated = repeated.at_rows_of(noise)
        if not noise.estimated.any():
            return repeated
        found = self._from_residuals(noise, outcome, fitted, used)
        # Equal readings of all visits are copies, or coarser than the noise: they show none.
        differ = noise.group[rows][np.abs(contrast) > SMALLEST]
        shown = np.bincount(differ, minlength=len(noise.sigma)) >= LEAST_CONTRASTS
        taken = noise.estimated & shown
        few = 2 * len(contrast) < np.count_nonzero(used)
        if repeated.repeatability == 0.0 and few:
            # Few repeats give a rough estimate, all residuals an accurate one: use the latter unless an F test finds it larger.
            # How much of it is noise is known no better than by the repeats: the degrees of freedom are theirs.
            larger = found.sigma / repeated.sigma
            taken &= np.array([float(f.sf(r**2, found.dof, repeated.dof)) < LACK_OF_FIT for r in larger])
        if not (noise.estimated & (shown | ~self.first.estimated)).any():
            return found
        return replace(repeated, sigma=np.where(taken | ~noise.estimated, repeated.sigma, found.sigma))

    def _from_residuals(self, noise: ReadingNoise, outcome: Fit, fitted: Mask, used: Mask) -> ReadingNoise:
        """Undeclared sigmas of largest marginal likelihood, about a fit, from where they are."""
        # Only rows that are still used count: a gross error would make the noise so large that the error is accepted in the
        # next iteration, and rejected in the one after that.
        weight, none = outcome.weight * used[fitted], np.zeros(outcome.problem.size, dtype=bool)
        best = MarginalLikelihood.of(outcome, noise.take(fitted), weight, none).best(noise.sigma, widen=False)
        dof = outcome.residual.size / max(len(noise.sigma), 1.0)
        return replace(noise, sigma=best.noise.sigma, repeatability=0.0, source="residuals", dof=dof)

    def _with_repeatability(self, noise: ReadingNoise, outcome: Fit, used: Mask, residual: Floats) -> ReadingNoise:
        """The noise with the machine's repeatability, if the residuals show one; for data with few repeated visits."""
        # An instrument's noise does not depend on the drives' directions, so residuals along the motions of single drives
        # belong to the machine. They are repeatability only if they are independent from pose to pose: similar residuals of
        # neighbouring poses are errors of the model. As noise along the drives they would let the fit off the positions.
        rows, whole = self._residuals(outcome, used, residual)
        estimate = from_repeats(noise.take(rows), whole, self.by_command[rows])
        if estimate.repeatability == 0.0:
            return noise
        shown = replace(noise, sigma=estimate.sigma, repeatability=estimate.repeatability)
        return shown if self._independent(outcome.point, shown, used) else noise

    @staticmethod
    def _residuals(outcome: Fit, used: Mask, residual: Floats) -> tuple[Indices, Floats]:
        """Indices (M,) of ``ENOUGH`` used rows at most, and their residuals (M, c), enlarged for the fit's parameters."""
        rows = np.flatnonzero(used)[:: 1 + np.count_nonzero(used) // ENOUGH]
        size = np.count_nonzero(used) * residual.shape[1]
        return rows, residual[rows] * np.sqrt(size / max(size - outcome.effective_parameters, 1.0))

    def _independent(self, point: Point, noise: ReadingNoise, used: Mask) -> bool:
        """Whether the residuals along the motions of single drives are independent from pose to pose, as repeatability is.

        A model error (a bent track, a rack, compliant links) is a function of the commands, so that neighbouring poses have
        similar errors. Rao's score test of the second against the first is a weighted sum of products of neighbouring poses'
        scores, Moran's I of regression residuals in its general form: P. Burridge, "On the Cliff-Ord test for spatial
        autocorrelation", J. R. Statist. Soc. B 42 (1980) 107-108. Its mean and variance under independence are those of a
        quadratic form in the residuals of a regression: A. D. Cliff and J. K. Ord, "Testing for spatial autocorrelation among
        regression residuals", Geographical Analysis 4 (1972) 267-284.

        ``point``: result of a fit. ``noise``: that of all rows, including the repeatability to be tested.
        """
        rows = np.flatnonzero(used)
        some = rows[:: 1 + (len(rows) - 1) // 1000]  # more are slower, and hardly more accurate
        J = self.by_command[some]
        problem = self.whole.take(some, noise.take(some).whitening(J, J.shape[1]))
        x = point.x.copy()
        x[: problem.n_geometry] = 0.0  # unknowns of the instruments from the fit; geometry from nominal
        z = _scores(problem, problem.point(x), J)
        return max(z) < float(norm.isf(0.025 / len(z)))  # as probable as to accept a repeatability that does not exist

    def volume(self, noise: ReadingNoise) -> float:
        """The mean log determinant of a noise's covariance."""
        J, c = self.derivative(noise), self.whole.measured.components
        logs = [np.linalg.slogdet(noise.take(rows).covariance(J[rows], c))[1] for rows in chunks(len(J))]
        return float(np.concatenate(logs).mean())


def noise_at(noise: ReadingNoise, measured: Readings) -> ReadingNoise:
    """The same noise for other rows of the same instruments; a usual one of orientations that it does not have."""
    sigma, estimated, groups = noise.sigma, noise.estimated, len(measured.declared)
    if len(sigma) != groups:  # a single tracker's, of a fit to positions or of poses
        sigma = np.array([noise.position_sigma, noise.orientation_sigma])[:groups]
        estimated = np.append(estimated, True)[:groups]
    found = replace(noise, sigma=sigma, estimated=estimated, group=measured.group, row_sigma=measured.row_sigma)
    found = replace(found, sight=None, reach=None)
    return found if measured.station is None else found.towards(measured.poses[0], measured.station)


def same(one: ReadingNoise, two: ReadingNoise) -> bool:
    """Whether two successive estimates of the noise are equal, so that the iteration has converged."""
    close = np.abs(one.sigma - two.sigma) <= ALIKE * two.sigma
    drives = abs(one.repeatability - two.repeatability) <= ALIKE * (two.sigma.min(initial=1.0) + two.repeatability)
    return bool(close.all() and drives and abs(one.range_ratio - two.range_ratio) <= ALIKE * two.range_ratio)


def _scores(problem: Problem, point: Point, J: Floats) -> list[float]:
    """Standard scores of the correlation of the drives' errors at neighbouring poses, one for each kind of neighbour."""
    B = np.concatenate([problem.jacobian(point, rows) for rows in problem.chunks()])
    k = B.shape[2]
    y = problem.residual(point) + B @ point.x
    flat = B.reshape(-1, k)
    C = np.linalg.inv(flat.T @ flat + np.diag(problem.prior))
    residual = y - B @ (C @ (flat.T @ y.ravel()))  # of covariance I - B C B' where the errors are independent
    D = problem.whitening @ J
    score = np.einsum("nci,nc->ni", D, residual)
    S, G = np.swapaxes(D, 1, 2) @ B, np.swapaxes(D, 1, 2) @ D
    found = []
    for kernel in _neighbours(problem.measured.q):
        drives = range(len(kernel))
        KS = np.stack([kernel[i] @ S[:, i] for i in drives], axis=1)
        A, AA = np.einsum("nik,nil->kl", S, KS), np.einsum("nik,nij,njl->kl", KS, G, KS, optimize=True)
        squares = sum(float(G[:, i, j] @ (kernel[i] * kernel[j]) @ G[:, j, i]) for i in drives for j in drives)
        variance = 2.0 * (squares - 2.0 * np.trace(C @ AA) + np.trace(C @ A @ C @ A))
        total = sum(float(score[:, i] @ kernel[i] @ score[:, i]) for i in drives)
        found.append(float((total + np.trace(C @ A)) / np.sqrt(max(variance, 1e-300))))
    return found


def _neighbours(q: Floats) -> list[Floats]:
    """(n, N, N) weights of pairs of poses for each drive, for two kinds of neighbours: near in all commands, or in its own."""
    from scipy.spatial.distance import cdist

    # A weight is a Gaussian of the distance, with the median distance of a pose to its nearest neighbour as standard deviation.
    unit = q / np.maximum(np.std(q, axis=0), 1e-12)
    apart = cdist(unit, unit)
    np.fill_diagonal(apart, np.inf)
    near = max(float(np.median(apart.min(axis=1))), 1e-12)
    all_ = np.exp(-0.5 * (apart / near) ** 2)
    own = np.exp(-0.5 * ((unit.T[:, :, None] - unit.T[:, None, :]) / near) ** 2)
    own[:, np.arange(len(q)), np.arange(len(q))] = 0.0
    return [np.broadcast_to(all_, own.shape), own]
