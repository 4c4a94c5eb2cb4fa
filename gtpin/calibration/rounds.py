"""The iterations of a calibration: fit, reject gross errors, estimate the noise, until nothing changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit, fit
from gtpin.calibration.problem import Measured, Problem, in_frame
from gtpin.calibration.scatter import independent
from gtpin.data import Instrument
from gtpin.distributions import chi2, f
from gtpin.errors import ConvergenceError, DatasetError
from gtpin.kinematics.chunks import chunks
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.noise import weights
from gtpin.noise.estimate import roughly
from gtpin.noise.noise import SMALLEST, Noise
from gtpin.noise.repeats import LEAST_CONTRASTS, contrasts, from_repeats
from gtpin.noise.sight import line_of_sight, range_ratio

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Progress = Callable[[str, int, float], None]

MAX_ITERATIONS = 30
FREE_ITERATIONS = 8
"""Iterations after which no more poses are rejected, and tails and noise only grow, so that the iteration can't oscillate."""
ROUGH = 5e-6
"""Smallest sigma of the rough fit, m and rad: with less, the cost is a narrow curved valley far from its minimum."""
ROUGHLY = 1e-4
"""Relative decrease of the cost at which the rough fit is good enough: its weights may oscillate below that."""
ROUGH_STEPS = 15
"""Steps after which the rough fit is good enough to detect gross errors: reweighting can converge slowly."""
PART = 20_000
"""Size of a random subset of poses that is fitted first if there are twice as many: its standard errors are less than a
hundredth of a tolerance, so that one step on all poses is enough afterwards. Measured: docs/speed.md.
"""
LOST = 100.0
"""Ratio of residuals to noise above which a rough fit has failed: 1.5 mm for a tracker."""
COARSE = (1e-2, 1e-3)
"""Sigmas, m and rad, of the coarse fits that then precede it: as large as the largest tolerances, then as usual ones."""
ENOUGH = 3000
"""Number of poses from which repeatability is estimated by residuals; more are slower, and hardly more accurate."""
SETTLED = 1e-3
"""Relative change of an estimated sigma at which it has settled."""
NEAREST = 0.1
"""Least distance, m, of an instrument from what it measures."""
CORE = 1.2
"""Ratio of the residuals' core to the noise above which heavy tails count as a lack of fit too."""
LACKING_FREEDOM = 7.0
"""Degrees of freedom of the t distribution by which gross errors are judged if the model is incomplete by design: the tails of
its residuals are unknown, and longest at the workspace's edge. Assumed; of 50 poses, one whose residual is 14 times
(positions alone) or 18 times the core's sigma is a gross error then. ``examples/dressler2010/seeds.py`` counts the good poses
that are rejected nevertheless.
"""
LACK_OF_FIT = 1e-3
"""p-value of chi-square below which the model counts as incomplete."""


@dataclass(frozen=True)
class Settled:
    """The converged state of the iterations.

    Parameters
    ----------
    fit
        The last fit.
    used
        (N,) the poses that are not gross errors.
    noise, tails
        Noise that the fit assumes.
    steps
        Number of steps of all fits.
    """

    fit: Fit[Problem]
    used: Mask
    noise: Noise
    tails: weights.Tails
    steps: int

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residuals, without robust weights."""
        return float((self.fit.residual**2).sum())

    @property
    def dof(self) -> float:
        """Measured components minus the effective number of parameters."""
        return self.fit.residual.size - self.fit.taken

    @property
    def excess(self) -> float:
        """Ratio of residuals to noise if chi-square shows a lack of fit; else 1.

        Heavy tails have their own scale, which the fit's weights include.
        """
        if self.tails.heavy:
            return self.tails.scale if self.tails.scale > CORE else 1.0
        known = np.isinf(self.noise.dof)
        chance = chi2.sf(self.chi2, self.dof) if known else f.sf(self.chi2 / self.dof, self.dof, self.noise.dof)
        if chance >= LACK_OF_FIT:
            return 1.0
        return float(np.sqrt(self.chi2 / self.dof))

    def refit(self, factor: float) -> Fit[Problem]:
        """The fit with the noise multiplied by a factor: its covariance includes the model's lack of fit."""
        return fit(self.fit.problem.noisier(factor), self.tails.weigh, self.fit.point.x)


@dataclass(frozen=True)
class Reweighting:
    """The robust reweighting iterations of a calibration, with their input.

    Parameters
    ----------
    start
        The nominal model.
    measured, visits
        The measured poses, and (N,) the index of each one's commands.
    near
        Nominal poses in the base frame.
    instrument
        What the dataset declares.
    progress
        Called with the name of the step, the iteration, and the RMS residual in units of the noise.
    lacking
        Whether the model is incomplete by design. Residuals of single visits then do not count as scatter of the drives, and
        gross errors are judged by heavier tails.
    """

    start: Model
    measured: Measured
    visits: npt.NDArray[np.intp]
    near: Poses
    instrument: Instrument
    progress: Progress | None
    lacking: bool = False

    def run(self) -> Settled:
        """Iterate until the rejected poses and the noise do not change.

        Raises
        ------
        ConvergenceError
            If a fit or the iteration does not converge.
        """
        J = in_frame(self.start.kinematics.command_jacobian(self.measured.q, self.near), self.start.frame)
        noise, used, tails = self._first_noise(), np.ones(len(self.near), dtype=bool), weights.Tails()
        part, nominal = self._of_a_part(), None
        if part is None:
            outcome = self._fit(used, noise.at_least(ROUGH), J, weights.huber, None, "rough fit", rough=True)
            steps = outcome.iterations
            if weights.robust_scale(outcome.residual) > LOST:
                nominal = self._coarsely(used, noise, J)
                outcome = self._fit(used, noise.at_least(ROUGH), J, weights.huber, nominal, "rough fit", rough=True)
                steps += outcome.iterations
            if not all(self._declared):  # gross errors and tails depend on the noise
                noise = roughly(noise, self._left(outcome, used)[0], self._declared)
        else:
            outcome, tails, steps = part.fit, part.tails, part.steps
            noise = replace(part.noise, sight=noise.sight, reach=noise.reach)
        for number in range(1, MAX_ITERATIONS + 1):
            left, here = self._left(outcome, used)
            now_used = ~weights.gross(_whiten(noise, J, left), used, LACKING_FREEDOM if self.lacking else np.inf)
            now_noise = self._estimated(noise, outcome, now_used, now_used[used], left, J)
            # With the previous noise: a sigma from unweighted squares would hide heavy tails.
            now_tails = weights.Tails.of(_whiten(noise, J, left)[now_used])
            if number > FREE_ITERATIONS:
                now_used = now_used | used
                now_tails = min(tails, now_tails, key=lambda t: t.freedom)
                now_noise = max(noise, now_noise, key=lambda n: self._volume(n, J))
            settled = (now_used == used).all() and now_tails.freedom == tails.freedom and _same(noise, now_noise)
            if number > 1 and settled:
                return Settled(outcome, used, noise, tails, steps)
            used, noise, tails = now_used, now_noise, now_tails
            # Gross errors may have given a wrong rough fit; without them, the nominal geometry is a good start.
            anew = number == 1 and part is None and not used.all()
            x, near = (nominal, self.near) if anew else (outcome.point.x, here)
            outcome = self._fit(used, noise, J, tails.weigh, x, f"fit {number}", near=near)
            steps += outcome.iterations
        raise ConvergenceError(
            f"noise and gross errors have not converged in {MAX_ITERATIONS} iterations",
            hint="declare the noise in dataset.toml",
        )

    def _of_a_part(self) -> Settled | None:
        """The result for a random subset of the poses, each with all its visits; None for few poses.

        Steps on a subset are cheap, and few steps on all poses remain.
        """
        if len(self.near) < 2 * PART:
            return None
        order = np.random.default_rng(0).permutation(int(self.visits.max()) + 1)
        taken = order[np.cumsum(np.bincount(self.visits)[order]) <= PART]
        rows = np.flatnonzero(np.isin(self.visits, taken))
        if len(rows) < PART / 2:  # few poses of very many visits
            return None
        part = replace(self, measured=self.measured.take(rows), visits=self.visits[rows], near=self.near[rows])
        return part.run()

    def _coarsely(self, used: Mask, noise: Noise, J: Floats) -> Floats:
        """Parameters of a fit with large, then smaller noise: with small noise the cost of a machine far from nominal is a
        narrow curved valley, in which a rough fit does not converge.
        """
        x = None
        for sigma in COARSE:
            x = self._fit(used, noise.at_least(sigma), J, weights.huber, x, "coarse fit").point.x
        assert x is not None
        return x

    @property
    def _declared(self) -> tuple[bool, bool]:
        positions_only = self.measured.components == 3
        return (
            self.instrument.position_sigma is not None,
            positions_only or self.instrument.orientation_sigma is not None,
        )

    def _first_noise(self) -> Noise:
        sight = reach = None
        if self.instrument.station is not None:
            station = np.array(self.instrument.station)
            if np.linalg.norm(self.measured.T - station, axis=1).min() < NEAREST:
                raise DatasetError(
                    "the instrument's station lies among the measured poses", hint="correct station in dataset.toml"
                )
            sight, reach = line_of_sight(self.measured.T, station)
        # Undeclared sigmas start at a tracker's usual values; only their ratio matters until they are estimated.
        return Noise(
            self.instrument.position_sigma or 2e-5,
            self.instrument.orientation_sigma or 5e-5,
            sight=sight,
            reach=reach,
            estimated=(not self._declared[0], not self._declared[1]),
        ).at_least(SMALLEST)

    def _fit(
        self,
        used: Mask,
        noise: Noise,
        J: Floats,
        weigh: Callable[[Floats], Floats],
        x: Floats | None,
        what: str,
        rough: bool = False,
        near: Poses | None = None,
    ) -> Fit[Problem]:
        def report(iteration: int, rms: float) -> None:
            if self.progress is not None:
                self.progress(what, iteration, rms)

        near = self.near if near is None else near
        if not used.all():
            noise, J, near = noise.take(used), J[used], near[used]
        measured = self.measured.take(used)
        whitening = noise.whitening(J, measured.components)
        problem = Problem(self.start, measured, whitening, self.instrument.frame == "free")
        if rough:
            return fit(problem, weigh, x, report, near=near, decrease=ROUGHLY, enough=ROUGH_STEPS)
        return fit(problem, weigh, x, report, near=near)

    def _left(self, outcome: Fit[Problem], used: Mask) -> tuple[Floats, Poses]:
        """(N, c) residuals of a fit at all poses, including rejected ones, and the model's poses in the base frame."""
        model, poses = outcome.point.model, outcome.point.poses
        if len(poses) != np.count_nonzero(used):  # a part's
            poses = model.kinematics.forward(self.measured.q, self.near)
        elif len(poses) < len(used):
            T, R = np.empty((len(used), 3)), np.empty((len(used), 3, 3))
            T[used], R[used] = poses.T, poses.R
            others = model.kinematics.forward(self.measured.q[~used], self.near[~used])
            T[~used], R[~used] = others.T, others.R
            poses = Poses(T, R)
        return self.measured.minus(model.seen(poses)), poses

    def _estimated(
        self, noise: Noise, outcome: Fit[Problem], used: Mask, still: Mask, left: Floats, J: Floats
    ) -> Noise:
        """The undeclared part of the noise, from repeated visits or otherwise from the residuals.

        Parameters
        ----------
        used
            (N,) the poses that are not gross errors.
        still
            Mask of these among the poses to which ``outcome`` was fitted.
        """
        if noise.sight is not None:
            noise = replace(noise, range_ratio=range_ratio(noise.take(used), left[used, :3]))
        contrast, rows = contrasts(self.visits[used], left[used])
        rows = np.flatnonzero(used)[rows]
        if len(contrast) >= LEAST_CONTRASTS:
            repeated = from_repeats(noise.take(rows), contrast, J[rows], self._declared)
            repeated = replace(repeated, sight=noise.sight, reach=noise.reach)
            if all(self._declared) or repeated.repeatability > 0.0:
                return repeated
            # Few repeats estimate the noise roughly, all residuals well: use the latter unless it is larger.
            fitted = self._from_residuals(noise, outcome, still)
            return repeated if _larger(fitted, repeated) else fitted
        if all(self._declared):
            return noise
        fitted = self._from_residuals(noise, outcome, still)
        # With positions only, or with one declared sigma, drives' scatter is hardly distinguishable from the instrument's.
        if any(self._declared) or self.lacking:
            return fitted
        return self._with_repeatability(fitted, outcome, used, left[used], J[used])

    def _with_repeatability(self, noise: Noise, outcome: Fit[Problem], used: Mask, left: Floats, J: Floats) -> Noise:
        """The same sigmas, or others with the machine's repeatability, if few poses were visited twice and residuals show it.

        An instrument's noise does not depend on the drives' directions, so residuals along the motions of single drives
        belong to the machine. They are scaled up for the degrees of freedom of the fit. They are repeatability only if they
        are independent from pose to pose. What neighbouring poses share is a model error (``lack``), which weighs equally.
        """
        some = np.arange(len(left))[:: 1 + len(left) // ENOUGH]
        whole = left[some] * np.sqrt(left.size / max(left.size - outcome.taken, 1.0))
        estimate = from_repeats(noise.take(used).take(some), whole, J[some], self._declared)
        if estimate.repeatability == 0.0:
            return noise
        measured, free = self.measured.take(used), self.instrument.frame == "free"
        shown = replace(
            estimate, sight=noise.sight, reach=noise.reach, source="residuals", dof=outcome.residual.size / 2.0
        )
        if independent(self.start, outcome.point, measured, shown.take(used), J, free):
            return shown
        return replace(shown, repeatability=0.0, lack=shown.repeatability)

    def _volume(self, noise: Noise, J: Floats) -> float:
        """The mean log determinant of a noise's covariance."""
        logs = [
            np.linalg.slogdet(noise.take(rows).covariance(J[rows], self.measured.components))[1]
            for rows in chunks(len(J))
        ]
        return float(np.concatenate(logs).mean())

    def _from_residuals(self, noise: Noise, outcome: Fit[Problem], still: Mask) -> Noise:
        """Undeclared sigmas from the residuals' squares and the degrees of freedom in each kind of component.

        Only poses that are ``still`` used: a gross error in the fit would make the noise so large that it is accepted in the
        next iteration, and rejected in the one after that.
        """
        weight = outcome.weight * still
        taken, covariance = np.zeros(self.measured.components), outcome.covariance
        for rows in outcome.problem.chunks():
            J = outcome.problem.jacobian(outcome.point, rows, weight[rows])
            taken += np.einsum("nci,ij,ncj->c", J, covariance, J, optimize=True)
        squares = (weight[:, None] * outcome.residual**2).sum(axis=0)
        factors = [1.0, 1.0]
        for i, kind in enumerate((slice(0, 3), slice(3, 6))):
            freedoms = weight.sum() * len(taken[kind]) - taken[kind].sum()
            if not self._declared[i]:
                factors[i] = float(np.sqrt(squares[kind].sum() / max(freedoms, 1.0)))
        return replace(
            noise,
            position_sigma=max(noise.position_sigma * factors[0], SMALLEST),
            orientation_sigma=max(noise.orientation_sigma * factors[1], SMALLEST),
            repeatability=0.0,
            lack=0.0,
            source="residuals",
            dof=outcome.residual.size / 2.0,
        )


def _larger(one: Noise, two: Noise) -> bool:
    """Whether one estimate of the noise is significantly larger than another (F test of each sigma)."""
    ratios = (one.position_sigma / two.position_sigma, one.orientation_sigma / two.orientation_sigma)
    return any(float(f.sf(ratio**2, one.dof, two.dof)) < LACK_OF_FIT for ratio in ratios)


def _whiten(noise: Noise, J: Floats, values: Floats) -> Floats:
    whitened = np.empty_like(values)
    for rows in chunks(len(values)):
        whitening = noise.take(rows).whitening(J[rows], values.shape[1])
        whitened[rows] = np.einsum("nij,nj->ni", whitening, values[rows])
    return whitened


def _same(one: Noise, two: Noise) -> bool:
    pairs = (
        (one.position_sigma, two.position_sigma),
        (one.orientation_sigma, two.orientation_sigma),
        (one.position_sigma + one.along_drives, two.position_sigma + two.along_drives),
        (one.range_ratio, two.range_ratio),
    )
    return all(abs(a - b) <= SETTLED * abs(b) for a, b in pairs)
