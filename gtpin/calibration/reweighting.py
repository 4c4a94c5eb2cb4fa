"""Robust reweighting: fit, reject gross errors, estimate the noise and its tails, until nothing changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit, fit
from gtpin.calibration.noise_estimator import NoiseEstimator, same, whitened
from gtpin.calibration.problem import Measured, Problem, in_frame
from gtpin.calibration.settled import Settled
from gtpin.data import Instrument
from gtpin.errors import ConvergenceError
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.noise import weights
from gtpin.noise.estimate import roughly
from gtpin.noise.noise import Noise

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
"""Ratio of residuals to noise above which a rough fit has failed: 1.5 mm for a tracker. Assumed."""
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
class Reweighting:
    """The robust reweighting iterations of a calibration, with their input.

    Parameters
    ----------
    start
        The nominal model.
    measured, visits
        The N measured poses, and (N,) the index of each one's commands: equal for repeated visits.
    near
        (N) nominal poses, base frame.
    instrument
        The dataset's description of the instrument.
    progress
        Called with the name of the step, the iteration, and the RMS residual in units of the noise.
    lacking
        Whether the model leaves out known causes of deviations, as the paper's models do. Then residuals of single visits do
        not count as repeatability, and gross errors are judged by heavier tails.
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
        estimator = NoiseEstimator(self.start, self.measured, self.visits, self.instrument, self.lacking)
        J = in_frame(self.start.kinematics.command_jacobian(self.measured.q, self.near), self.start.frame)
        noise, used, tails = estimator.first(), np.ones(len(self.near), dtype=bool), weights.Tails()
        part, nominal = self._of_a_part(), None
        if part is None:
            outcome = self._fit(used, noise.at_least(ROUGH), J, weights.huber, None, "rough fit", rough=True)
            steps = outcome.iterations
            if weights.robust_scale(outcome.residual) > LOST:
                nominal = self._coarsely(used, noise, J)
                outcome = self._fit(used, noise.at_least(ROUGH), J, weights.huber, nominal, "rough fit", rough=True)
                steps += outcome.iterations
            if not all(estimator.declared):  # gross errors and tails depend on the noise
                noise = roughly(noise, self._left(outcome, used)[0], estimator.declared)
        else:
            outcome, tails, steps = part.fit, part.tails, part.steps
            noise = replace(part.noise, sight=noise.sight, reach=noise.reach)
        for number in range(1, MAX_ITERATIONS + 1):
            left, here = self._left(outcome, used)
            now_used = ~weights.gross(whitened(noise, J, left), used, LACKING_FREEDOM if self.lacking else np.inf)
            now_noise = estimator.estimate(noise, outcome, now_used, now_used[used], left, J)
            # With the previous noise: a sigma from unweighted squares would hide heavy tails.
            now_tails = weights.Tails.of(whitened(noise, J, left)[now_used])
            if number > FREE_ITERATIONS:
                now_used = now_used | used
                now_tails = min(tails, now_tails, key=lambda t: t.freedom)
                now_noise = max(noise, now_noise, key=lambda n: estimator.volume(n, J))
            settled = (now_used == used).all() and now_tails.freedom == tails.freedom and same(noise, now_noise)
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
        if len(poses) != np.count_nonzero(used):  # those of a part
            poses = model.kinematics.forward(self.measured.q, self.near)
        elif len(poses) < len(used):
            T, R = np.empty((len(used), 3)), np.empty((len(used), 3, 3))
            T[used], R[used] = poses.T, poses.R
            others = model.kinematics.forward(self.measured.q[~used], self.near[~used])
            T[~used], R[~used] = others.T, others.R
            poses = Poses(T, R)
        return self.measured.minus(model.seen(poses)), poses
