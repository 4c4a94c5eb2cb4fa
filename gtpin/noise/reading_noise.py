"""The noise of readings of several instruments: one sigma for each group of numbers, or a sigma that a row declares."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.noise.estimate import likeliest_of

Floats = npt.NDArray[np.float64]
SMALLEST = 1e-7
"""Smallest sigma of a reading's noise that is estimated, m and rad: encoders read tenths of a micrometre. Derived: below it,
rounding errors are larger than the noise, and fits do not converge."""


@dataclass(frozen=True, eq=False)
class ReadingNoise:
    """Noise of every number of N rows, as standard deviations. The instruments' noises are independent.

    Parameters
    ----------
    sigma
        (G,) sigma of each group of numbers, m or rad.
    group
        (N, c) group of each number.
    row_sigma
        (N, c) sigma that a row declares for a number; NaN where it declares none.
    estimated
        (G,) whether the group's sigma was estimated from the data.
    repeatability
        Standard deviation with which every actuator returns to a command, m or rad. Each row counts as a separate visit.
    """

    sigma: Floats
    group: npt.NDArray[np.intp]
    row_sigma: Floats
    estimated: npt.NDArray[np.bool_]

    repeatability: float = 0.0

    lack = 0.0

    @property
    def each(self) -> Floats:
        """(N, c) sigma of each number."""
        return np.where(np.isfinite(self.row_sigma), self.row_sigma, self.sigma[self.group])

    def covariance(self, by_command: Floats, components: int) -> Floats:
        """(N, c, c) covariance of each row; ``by_command`` (N, c, n) is the derivative of the readings by the commands."""
        own = self.each[:, :, None] ** 2 * np.eye(components)
        if self.repeatability == 0.0:
            return np.asarray(own)
        return np.asarray(own + self.repeatability**2 * (by_command @ np.swapaxes(by_command, 1, 2)))

    def whitening(self, by_command: Floats, components: int) -> Floats:
        """(N, c, c) matrices W with W'W the inverse of the covariance."""
        if self.repeatability == 0.0:
            return np.asarray(np.eye(components) / self.each[:, :, None])
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance(by_command, components))))

    def take(self, rows: npt.NDArray[np.generic] | slice) -> ReadingNoise:
        """The noise of some of the rows."""
        return replace(self, group=self.group[rows], row_sigma=self.row_sigma[rows])

    def scaled(self, factor: float) -> ReadingNoise:
        """The same noise with every sigma multiplied by a factor."""
        return replace(
            self,
            sigma=self.sigma * factor,
            row_sigma=self.row_sigma * factor,
            repeatability=self.repeatability * factor,
        )

    def sized_as(self, other: object) -> ReadingNoise:
        """The same noise with the sigmas and the repeatability of another."""
        assert isinstance(other, ReadingNoise)
        return replace(self, sigma=other.sigma, repeatability=other.repeatability)

    def at_least(self, sigma: float) -> ReadingNoise:
        """The same noise with instruments' sigmas of at least ``sigma``, m and rad."""
        return replace(self, sigma=np.maximum(self.sigma, sigma), row_sigma=np.maximum(self.row_sigma, sigma))

    def refitted(self, squares: Floats, counts: Floats, known: npt.NDArray[np.bool_]) -> ReadingNoise:
        """The noise with sigma = sqrt(squares / counts) for the groups that are not ``known`` (G,).

        Parameters
        ----------
        squares
            (G,) sums of squared errors, m^2 and rad^2.
        counts
            (G,) degrees of freedom.
        """
        free = ~known & (counts > 0.0)
        sigma = np.where(free, np.sqrt(squares / np.maximum(counts, 1e-300)), self.sigma)
        return replace(self, sigma=np.maximum(sigma, SMALLEST), estimated=~known)


def likeliest_readings(noise: ReadingNoise, errors: Floats, by_command: Floats, weight: Floats) -> ReadingNoise:
    """Maximum-likelihood noise from errors: repeatability, and the sigmas that were not declared.

    Repeatability is zero where the errors do not show it, as in :func:`~gtpin.noise.estimate.likeliest`.

    Parameters
    ----------
    noise
        First estimate of the sigmas.
    errors
        (N, c) measured less predicted, m and rad.
    by_command
        (N, c, n) derivative of the readings by the commands.
    weight
        (N,) factors of the rows' squared errors.
    """
    present = np.bincount(noise.group[~np.isfinite(noise.row_sigma)], minlength=len(noise.sigma)) > 0
    open_ = np.flatnonzero(noise.estimated & present)
    # The unit of repeatability: it moves the readings by as much as their noise.
    moved = np.sqrt((by_command**2).sum(axis=2))
    some = moved > 0.0
    unit = float(np.median(noise.each[some] / moved[some])) if some.any() else 0.0

    def trial(x: Floats) -> ReadingNoise:
        sigma = noise.sigma.copy()
        sigma[open_] *= np.exp(x[1:])
        return replace(noise, sigma=np.maximum(sigma, SMALLEST), repeatability=unit * float(x[0]))

    return likeliest_of(trial, len(open_), errors, by_command, weight)
