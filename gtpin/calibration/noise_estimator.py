"""The noise of a calibration, from what is declared, repeated visits, or the residuals of a fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.problem import Measured, Problem
from gtpin.calibration.scatter import independent
from gtpin.calibration.settled import LACK_OF_FIT
from gtpin.data import Instrument
from gtpin.distributions import f
from gtpin.errors import DatasetError
from gtpin.kinematics.chunks import chunks
from gtpin.model.model import Model
from gtpin.noise.noise import SMALLEST, Noise
from gtpin.noise.repeats import LEAST_CONTRASTS, contrasts, from_repeats
from gtpin.noise.sight import line_of_sight, range_ratio

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

ENOUGH = 3000
"""Number of poses from which repeatability is estimated by residuals; more are slower, and hardly more accurate."""
SETTLED = 1e-3
"""Relative change of an estimated sigma below which it has converged."""
NEAREST = 0.1
"""Smallest distance, m, of an instrument from the poses that it measures. Assumed."""


@dataclass(frozen=True)
class NoiseEstimator:
    """Estimates the part of the noise that is not declared.

    Parameters
    ----------
    start
        The nominal model.
    measured, visits
        The measured poses, and (N,) the index of each one's commands: equal for repeated visits.
    instrument
        The dataset's description of the instrument.
    lacking
        Whether the model leaves out known causes of deviations. Residuals of single visits then do not count as repeatability.
    """

    start: Model
    measured: Measured
    visits: npt.NDArray[np.intp]
    instrument: Instrument
    lacking: bool

    @property
    def declared(self) -> tuple[bool, bool]:
        """Whether the sigmas of positions and of orientations are declared, or not needed."""
        positions_only = self.measured.components == 3
        return (
            self.instrument.position_sigma is not None,
            positions_only or self.instrument.orientation_sigma is not None,
        )

    def first(self) -> Noise:
        """The noise at the start: declared sigmas, and a tracker's usual values for the others."""
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
            estimated=(not self.declared[0], not self.declared[1]),
        ).at_least(SMALLEST)

    def estimate(self, noise: Noise, outcome: Fit[Problem], used: Mask, still: Mask, left: Floats, J: Floats) -> Noise:
        """The noise, with its undeclared part estimated from repeated visits, or otherwise from the residuals.

        Parameters
        ----------
        noise, outcome
            The previous estimate, and the last fit.
        used
            (N,) True for the poses that are not gross errors.
        still
            The same for the poses to which ``outcome`` was fitted.
        left
            (N, c) residuals of all poses, m and rad, instrument's frame.
        J
            (N, 6, n) derivative of the measured poses by the commands, instrument's frame.
        """
        if noise.sight is not None:
            noise = replace(noise, range_ratio=range_ratio(noise.take(used), left[used, :3]))
        contrast, rows = contrasts(self.visits[used], left[used])
        rows = np.flatnonzero(used)[rows]
        if len(contrast) >= LEAST_CONTRASTS:
            repeated = from_repeats(noise.take(rows), contrast, J[rows], self.declared)
            repeated = replace(repeated, sight=noise.sight, reach=noise.reach)
            if all(self.declared) or repeated.repeatability > 0.0:
                return repeated
            # Few repeats give a rough estimate, all residuals an accurate one: use the latter unless it is larger.
            fitted = self._from_residuals(noise, outcome, still)
            return repeated if _larger(fitted, repeated) else fitted
        if all(self.declared):
            return noise
        fitted = self._from_residuals(noise, outcome, still)
        # With positions only, or with one declared sigma, repeatability and the instrument's noise look much alike.
        if any(self.declared) or self.lacking:
            return fitted
        return self._with_repeatability(fitted, outcome, used, left[used], J[used])

    def _from_residuals(self, noise: Noise, outcome: Fit[Problem], still: Mask) -> Noise:
        """Undeclared sigmas from the residuals' squares and the degrees of freedom in each kind of component.

        Only poses that are ``still`` used count. With a gross error, the noise would be so large that the error is accepted in
        the next iteration, and rejected in the one after that.
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
            if not self.declared[i]:
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

    def _with_repeatability(self, noise: Noise, outcome: Fit[Problem], used: Mask, left: Floats, J: Floats) -> Noise:
        """The noise with the machine's repeatability, if the residuals show one; for data with few repeated visits.

        An instrument's noise does not depend on the drives' directions, so residuals along the motions of single drives
        belong to the machine. They are scaled up for the degrees of freedom of the fit. They are repeatability only if they
        are independent from pose to pose. Where neighbouring poses have similar residuals, they are a model error (``lack``),
        which enters the covariance in the same way.
        """
        some = np.arange(len(left))[:: 1 + len(left) // ENOUGH]
        whole = left[some] * np.sqrt(left.size / max(left.size - outcome.taken, 1.0))
        estimate = from_repeats(noise.take(used).take(some), whole, J[some], self.declared)
        if estimate.repeatability == 0.0:
            return noise
        measured, free = self.measured.take(used), self.instrument.frame == "free"
        shown = replace(
            estimate, sight=noise.sight, reach=noise.reach, source="residuals", dof=outcome.residual.size / 2.0
        )
        if independent(self.start, outcome.point, measured, shown.take(used), J, free):
            return shown
        return replace(shown, repeatability=0.0, lack=shown.repeatability)

    def volume(self, noise: Noise, J: Floats) -> float:
        """The mean log determinant of a noise's covariance."""
        logs = [
            np.linalg.slogdet(noise.take(rows).covariance(J[rows], self.measured.components))[1]
            for rows in chunks(len(J))
        ]
        return float(np.concatenate(logs).mean())


def whitened(noise: Noise, J: Floats, values: Floats) -> Floats:
    """(N, c) values in units of the noise."""
    whitened = np.empty_like(values)
    for rows in chunks(len(values)):
        whitening = noise.take(rows).whitening(J[rows], values.shape[1])
        whitened[rows] = np.einsum("nij,nj->ni", whitening, values[rows])
    return whitened


def same(one: Noise, two: Noise) -> bool:
    """Whether two successive estimates of the noise are equal, so that the iteration has converged."""
    pairs = (
        (one.position_sigma, two.position_sigma),
        (one.orientation_sigma, two.orientation_sigma),
        (one.position_sigma + one.along_drives, two.position_sigma + two.along_drives),
        (one.range_ratio, two.range_ratio),
    )
    return all(abs(a - b) <= SETTLED * abs(b) for a, b in pairs)


def _larger(one: Noise, two: Noise) -> bool:
    """Whether one estimate of the noise is significantly larger than another (F test of each sigma)."""
    ratios = (one.position_sigma / two.position_sigma, one.orientation_sigma / two.orientation_sigma)
    return any(float(f.sf(ratio**2, one.dof, two.dof)) < LACK_OF_FIT for ratio in ratios)
