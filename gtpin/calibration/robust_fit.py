"""Robust fit of geometry and instruments' unknowns: gross errors are rejected and noise is estimated until both converge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from gtpin.calibration.fit_state import FitState
from gtpin.calibration.gauss_newton import Fit, FlatValleyError, fit
from gtpin.calibration.marginal import MarginalLikelihood, Maximum
from gtpin.calibration.noise_estimator import NoiseEstimator, same
from gtpin.calibration.problem import Problem
from gtpin.errors import ConvergenceError
from gtpin.kinematics.poses import Poses
from gtpin.noise import weights
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Indices, Ints, Mask

Progress = Callable[[str, int, float], None]
Tails = tuple[weights.Tails, ...]
EXPECTED = "expected:"
"""Begins the step of a progress that tells the memory and the time to expect."""

MAX_ITERATIONS = 30
FREE_ITERATIONS = 8
"""Iterations after which no more rows are rejected, and tails and noise only grow, so that the iteration can't oscillate."""
ROUGH = 5e-6
"""Smallest sigma of the rough fit, m and rad: with less, the cost is a narrow curved valley far from its minimum."""
PART = 20_000
"""Size of a random subset of rows that is fitted first if there are twice as many: its standard errors are less than a
hundredth of a tolerance, so that one step on all rows is enough afterwards. Measured: docs/speed.md.
"""
COARSE = (1e-2, 1e-3)
"""Sigmas, m and rad, of the coarse fits that are made before a second rough fit: first those of the largest tolerances, then
those of usual ones."""
LACKING_FREEDOM = 7.0
"""Degrees of freedom of the t distribution by which gross errors are judged if the model is incomplete by design: the tails of
its residuals are unknown, and longest at the workspace's edge. Assumed; of 50 poses, one whose residual is 14 times
(positions alone) or 18 times the core's sigma is a gross error then. ``examples/dressler2010/seeds.py`` counts the good poses
that are rejected nevertheless.
"""


@dataclass(frozen=True)
class RobustFit:
    """The robust fit of a calibration, with its input.

    - ``whole``: the problem with all N rows; its whitening is not used.
    - ``rows``, ``visits``: (N,) line number of each row in its file, and index of its commands: equal for repeated visits.
    - ``near``: (N) nominal poses, base frame.
    - ``progress``: called with the name of the step, the iteration, and the RMS residual in units of the noise.
    - ``lacking``: whether the model leaves out known causes of deviations, as the paper's models do. Then residuals of
      single visits do not count as repeatability, gross errors are judged by heavier tails, and tolerances are never
      widened.
    - ``found``: parameters whose tolerances are no statement on the machine: (p,) True for those of a free target, and those
      that are free. None: there are none.
    - ``gaussian``: whether the noise counts as Gaussian, however heavy the tails of the residuals are.
    - ``widen``: whether tolerances that the data contradict are widened.
    """

    whole: Problem
    rows: Ints
    visits: Indices
    near: Poses
    progress: Progress | None = None
    lacking: bool = False
    found: Mask | None = None
    gaussian: bool = False
    widen: bool = True

    def run(self) -> FitState:
        """Iterate until rejected rows and noise do not change.

        Raises `ConvergenceError` if a fit or the iteration does not converge.
        """
        if len(self.rows) < 2 * PART:
            own, entered, x = self._entered()
            settled = own._iterated(entered, (x, self.near))
        else:  # steps on a random part are cheap, and few steps on all rows remain
            rows = np.sort(np.random.default_rng(0).permutation(len(self.rows))[:PART])
            part, fitted = self.take(rows).run(), np.zeros(len(self.rows), dtype=bool)
            fitted[rows[part.used]] = True
            part = replace(part, used=fitted, noise=part.noise.at_rows_of(self.estimator.first))
            own = self.with_geometry(part.fit.problem.start.geometry)
            settled = own._iterated(part)
        if settled.heavy and settled.noise.estimated.all() and not self.lacking:
            # Tails of residuals whose noise nobody declared can be errors of the model: poses with large ones count in full.
            plain = replace(own, gaussian=True)._iterated(settled)
            settled = plain if plain.predicts_better_than(settled) else settled
        return replace(settled, geometry=self.whole.start.geometry)

    def take(self, rows: Indices) -> RobustFit:
        """The same fit of some rows."""
        whole = self.whole.take(rows, self.whole.whitening[rows])
        return replace(self, whole=whole, rows=self.rows[rows], visits=self.visits[rows], near=self.near[rows])

    def _iterated(self, state: FitState, anew: tuple[Floats | None, Poses] | None = None) -> FitState:
        """Reject rows, estimate the noise and its tails, and fit, until nothing changes.

        ``state``: the fit so far, of the rows that it used. ``anew``: x and poses from which the next fit starts if rows are
        rejected; None: from the fit so far.
        """
        outcome, fitted, noise, tails, steps = state.fit, state.used, state.noise, state.tails, state.steps
        used, noise_scale = np.ones(len(self.rows), dtype=bool), 1.0
        for number in range(1, MAX_ITERATIONS + 1):
            residual, here = self._residual(outcome, fitted)
            whitened = noise.whitened(self.estimator.derivative(noise), residual)
            now_used = ~self._gross(whitened, used, fitted, outcome, here, noise)
            if number > FREE_ITERATIONS:
                now_used |= used
            now_noise = self.estimator.estimate(noise, outcome, fitted, now_used, residual)
            # With the previous noise: a sigma from unweighted squares would hide heavy tails.
            now_tails = self._tails(whitened, now_used)
            if number > FREE_ITERATIONS:
                now_tails = tuple(min(pair, key=lambda t: t.freedom) for pair in zip(now_tails, tails, strict=True))
                now_noise = max(noise, now_noise, key=self.estimator.volume)
            settled = all(
                now.freedom == old.freedom and abs(now.scale - old.scale) <= weights.SETTLED * old.scale
                for now, old in zip(now_tails, tails, strict=True)
            )
            if number > 1 and same(noise, now_noise) and settled and (now_used == used).all():
                return FitState(outcome, used, noise, tails, steps, state.geometry, noise_scale)
            used, noise, tails = now_used, now_noise, now_tails
            # Gross errors may have given a wrong rough fit; without them, its start is a good start.
            x, near = anew if number == 1 and anew is not None and not used.all() else (outcome.point.x, here)
            what = f"fit {number}"
            try:
                outcome = self._fit(used, noise, tails, x, what, near, noise_scale)
            except ConvergenceError as error:
                noise_scale = self._scale(noise.whitened(self.estimator.derivative(noise), residual)[used], used)
                if noise_scale >= 1.5:
                    outcome = self._fit(used, noise, tails, outcome.point.x, what, here, noise_scale)
                elif isinstance(error, FlatValleyError):  # along what the data do not determine: they are said not to
                    outcome = error.fit
                else:
                    raise
            fitted = used
            steps += outcome.iterations
        raise ConvergenceError(
            f"noise and gross errors have not converged in {MAX_ITERATIONS} iterations",
            hint="declare the noise in dataset.toml",
        )

    def _entered(self) -> tuple[RobustFit, FitState, Floats | None]:
        """A rough fit next to the larger maximum of the marginal likelihood: this with its tolerances; the fit of all rows; and
        x from which another fit can start."""
        tails: Tails = tuple(weights.Tails() for _ in self._alike)
        noise, used = self.estimator.first, np.ones(len(self.rows), dtype=bool)
        nominal = None
        outcome = self.rough(noise)
        steps = outcome.iterations
        if self._scale(outcome.residual, used) > 100.0:  # 1.5 mm for a tracker: it has failed
            for sigma in COARSE:
                nominal = self._fit(used, noise.at_least(sigma), None, nominal, "coarse fit", self.near).point.x
            outcome = self.rough(noise, nominal)
            steps += outcome.iterations
        at, given = self, self.whole.start.geometry
        if not noise.estimated.any():
            return self, FitState(outcome, used, noise, tails, steps, given), nominal
        for _ in range(6):  # each is linear about the last
            best = at._larger_maximum(outcome, noise, given)
            factor = best.factor / at._factor(given)
            change = max(np.abs(best.noise.sigma / noise.sigma - 1.0).max(initial=0.0), abs(factor - 1.0))
            noise = replace(noise, sigma=best.noise.sigma)
            if change < 0.1:
                break
            x = outcome.point.x.copy()
            own = at._widenable
            x[: len(own)][own] /= factor
            at = self.with_geometry(given.with_tolerances(np.where(own, best.factor, 1.0)))
            outcome = at.rough(noise, x)
            steps += outcome.iterations
        noise = replace(noise, sigma=np.minimum(noise.sigma, at._cores(outcome, noise)))
        entered = FitState(outcome, used, noise, tails, steps, given)
        return at, entered, nominal if at is self else outcome.point.x

    def _cores(self, outcome: Fit, noise: ReadingNoise) -> Floats:
        """(G,) sigmas by medians of a fit's residuals: larger ones, which tails enlarge, would hide the tails."""
        residual, sigma = self.whole.raw_residual(outcome.point, outcome.point.poses), noise.sigma.copy()
        shrunk = np.sqrt(max(1.0 - outcome.effective_parameters / self.whole.count, 1e-3))
        for group in np.flatnonzero(noise.estimated):
            own = np.abs(residual[(noise.group == group) & ~np.isfinite(noise.row_sigma)])
            if len(own):
                sigma[group] = max(float(np.median(own)) / 0.6745 / shrunk, SMALLEST)
        return sigma

    def _larger_maximum(self, outcome: Fit, noise: ReadingNoise, given: Geometry) -> Maximum:
        """The noise, and the factor on the given tolerances, at the larger maximum of the marginal likelihood."""
        factor, own = self._factor(given), np.zeros(outcome.problem.size, dtype=bool)
        own[: len(given.parameters)] = self._widenable
        weight = self._weights(outcome.residual, np.ones(len(self.rows), dtype=bool))
        marginal = MarginalLikelihood.of(outcome, noise, weight, own)
        marginal = marginal.in_units(np.where(own, factor, 1.0))  # of the given tolerances
        starts = (np.maximum(noise.sigma, ROUGH), np.minimum(noise.sigma, self.estimator.first.sigma), marginal.scatter)
        narrow = max((marginal.best(s, widen=False) for s in starts), key=lambda found: found.log_likelihood)
        if self.lacking or not self.widen or not own.any():
            return narrow
        wide = max((marginal.best(s, widen=True) for s in starts), key=lambda found: found.log_likelihood)
        # Where no parameter is 4 given tolerances off, the given ones lead to the same fit, and effects that the geometry lacks
        # look the same. From 7 nats on an assumption is wrong, as in `checks/limits.py`.
        far = np.abs(marginal.x[own]).max() > 4.0
        return wide if far and wide.log_likelihood - narrow.log_likelihood > 7.0 else narrow

    @property
    def _widenable(self) -> Mask:
        """(p,) parameters whose tolerances are a statement on the machine."""
        count = len(self.whole.start.geometry.parameters)
        return np.ones(count, dtype=bool) if self.found is None else ~self.found

    def _factor(self, given: Geometry) -> float:
        """The factor by which the tolerances of this fit are wider than given."""
        ratio = self.whole.start.geometry.tolerance / given.tolerance
        return float(ratio[self._widenable].max(initial=1.0))

    def with_geometry(self, geometry: Geometry) -> RobustFit:
        """The same fit with other tolerances."""
        return replace(self, whole=replace(self.whole, start=replace(self.whole.start, geometry=geometry)))

    @cached_property
    def _alike(self) -> list[Indices]:
        return self.whole.measured.noise_groups

    @cached_property
    def estimator(self) -> NoiseEstimator:
        """Estimates the noise."""
        return NoiseEstimator(self.whole, self.near, self.visits, self.lacking)

    def rough(self, noise: ReadingNoise | None = None, x: Floats | None = None) -> Fit:
        """A fit of all rows that is good enough to detect gross errors, or readings that nothing explains.

        ``noise``: by default the first estimate. ``x``: start; by default nominal.
        """
        used, noise = np.ones(len(self.rows), dtype=bool), noise or self.estimator.first
        return self._fit(used, noise.at_least(ROUGH), None, x, "rough fit", self.near, rough=True)

    def _fit(
        self,
        used: Mask,
        noise: ReadingNoise,
        tails: Tails | None,
        x: Floats | None,
        what: str,
        near: Poses,
        noise_scale: float = 1.0,
        *,
        rough: bool = False,
    ) -> Fit:
        """A fit of some rows, with weights as :meth:`_weights` has them. Without ``x`` it starts at the nominal geometry."""

        def report(iteration: int, rms: float) -> None:
            if self.progress is not None:
                self.progress(what, iteration, rms)

        own, J = noise.scaled(noise_scale), self.estimator.derivative(noise)
        if not used.all():
            near, own, J = near[used], own.take(used), J[used]
        problem = self.whole.take(used, own.whitening(J, self.whole.measured.components))
        x = problem.first if x is None else x
        # The weights of a rough fit may oscillate below a relative decrease of 1e-4, and reweighting can converge slowly.
        solve = partial(fit, decrease=1e-4, enough=15) if rough else fit
        return solve(problem, lambda r: self._weights(r, used, tails, noise_scale), x, report, near=near)

    def _residual(self, outcome: Fit, fitted: Mask) -> tuple[Floats, Poses]:
        """(N, c) residuals of a fit to some rows at all rows, and the model's poses, base frame."""
        point, poses = outcome.point, outcome.point.poses
        if not fitted.all():
            others = point.model.kinematics.forward(self.whole.measured.q[~fitted], self.near[~fitted])
            poses = Poses.merged(fitted, poses, others)
        return self.whole.raw_residual(point, poses), poses

    def _in_used(self, used: Mask) -> list[Indices]:
        """The groups of rows whose residuals are compared with each other, as indices among the used rows."""
        place = np.cumsum(used) - 1
        return [place[rows[used[rows]]] for rows in self._alike]

    def _weights(self, residual: Floats, used: Mask, tails: Tails | None = None, noise_scale: float = 1.0) -> Floats:
        """(M,) weights of the used rows from their residuals (M, c), in units of the noise times ``noise_scale``: by the tails
        of each group's noise; None: by Huber's function."""
        weight, groups = np.ones(len(residual)), self._in_used(used)
        for rows, own in zip(groups, tails or [None] * len(groups), strict=True):
            if len(rows):
                r = residual[rows]
                # The information of the data is less than that of the weighted squares that fit them.
                weight[rows] = weights.huber(r) if own is None else own.weigh(r * noise_scale) * own.kept(r.shape[1])
        return weight

    def _scale(self, residual: Floats, used: Mask) -> float:
        return max(weights.robust_scale(residual[rows]) for rows in self._in_used(used) if len(rows))

    def _tails(self, whitened: Floats, used: Mask) -> Tails:
        if self.gaussian:
            return tuple(weights.Tails() for _ in self._alike)
        some = whitened[used]
        return tuple(weights.Tails.of(some[rows]) if len(rows) else weights.Tails() for rows in self._in_used(used))

    def _gross(
        self, whitened: Floats, used: Mask, fitted: Mask, outcome: Fit, poses: Poses, noise: ReadingNoise
    ) -> Mask:
        """(N,) rows with a gross error in any number, or with a pose out of reach; a table's row is rejected as a whole.

        The prediction of a row that the fit hardly used is uncertain itself: with H = B C B' the covariance of a prediction in
        units of the noise and w the row's weight, its residual has the covariance I + (1 - 2 w) H. It is used where w < 1/2,
        with H of the noise's size at most: a row whose prediction is not known at all is not admitted for that.
        """
        found: Mask = np.asarray(~np.isfinite(whitened).all(axis=1))
        finite, heaviest = ~found, LACKING_FREEDOM if self.lacking else np.inf
        weight = np.zeros(len(used))
        weight[fitted] = outcome.weight
        for rows in self._alike:
            if not used[rows].any():
                continue
            limit = weights.gross_limit(whitened[rows], used[rows], heaviest)
            far = rows[(weights.square_norms(whitened[rows]) > limit) & finite[rows]]
            found[far] = True
            if 0 < len(far) <= weights.FEW * len(rows):  # more of them are no accident of single poses
                whitening = noise.take(far).whitening(self.estimator.derivative(noise, far), whitened.shape[1])
                problem = self.whole.take(far, whitening)
                B = problem.jacobian(replace(outcome.point, poses=poses[far]), slice(None))
                H = np.einsum("nci,ij,ndj->ncd", B, outcome.covariance, B, optimize=True)
                H /= np.maximum(np.trace(H, axis1=1, axis2=2) / H.shape[1], 1.0)[:, None, None]
                spread = np.eye(whitened.shape[1]) + np.maximum(1.0 - 2.0 * weight[far], 0.0)[:, None, None] * H
                norms = np.einsum("nc,nc->n", whitened[far], np.linalg.solve(spread, whitened[far][..., None])[..., 0])
                found[far] = ~(norms <= limit)  # also where the square of a gross error overflows
        return np.isin(self.rows, self.rows[found])
