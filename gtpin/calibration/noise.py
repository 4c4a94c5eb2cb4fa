"""The noise of measured poses: the instrument's, and the machine's own repeatability."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize, minimize_scalar

from gtpin.distributions import chi2
from gtpin.kinematics.chunks import chunks

Floats = npt.NDArray[np.float64]

SMALLEST = 1e-7
"""Sigma, m and rad, that no noise goes below: rounding takes over, and the fit creeps along curved valleys for ever."""

LEAST_CONTRASTS = 8
"""Repeated visits, beyond the first of each pose, below which the scatter between them says too little."""

SHOWN = 3.84
"""Twice the gain in log likelihood from which on repeatability is believed (chance of 2.5 % where there is none): what
scatter alone mimics would make every noise look larger than it is.
"""


FARTHEST = 10.0
"""Distance from the instrument, over the median, beyond which a position counts as a gross error: an assumption. Poses of one
machine are not spread over ten times their distance, since the instrument does not stand among them.
"""


@dataclass(frozen=True)
class Noise:
    """One-sigma noise of every measured pose.

    Parameters
    ----------
    position_sigma
        Per axis, m; with a station, the root mean square over its axes at the mean range.
    orientation_sigma
        Per axis, rad.
    repeatability
        Of every actuator, in units of its command: the scatter of the machine itself.
    sight
        (N, 3) unit vectors from the instrument to the poses, or None where the station is not known.
    reach
        (N,) distance from the instrument over its mean, with ``sight``.
    range_ratio
        Noise along the line of sight over noise across it at the mean range.
    source
        Where the instrument's sigmas come from: ``declared``, ``repeats`` or ``residuals``.
    dof
        Degrees of freedom that the sigmas were estimated with; infinite where they are declared.
    estimated
        Whether the position's and the orientation's sigma were estimated from the data.
    lack
        Like repeatability, of what the model lacks along the motions of single drives: alike at neighbouring poses, so no
        scatter, but it weighs like one.
    """

    position_sigma: float
    orientation_sigma: float
    repeatability: float = 0.0
    sight: Floats | None = None
    reach: Floats | None = None
    range_ratio: float = 1.0
    source: str = "declared"
    dof: float = np.inf
    estimated: tuple[bool, bool] = (False, False)
    lack: float = 0.0

    def covariance(self, command_jacobian: Floats, components: int) -> Floats:
        """(N, c, c) covariance of the measured pose: position alone (c = 3) or with the rotation vector (c = 6).

        Parameters
        ----------
        command_jacobian
            (N, 6, n) derivative of the pose by the commands, in the frame that was measured in.
        """
        count = len(command_jacobian)
        covariance = np.zeros((count, components, components))
        covariance[:, :3, :3] = self.position_sigma**2 * self._shape(count)
        if components == 6:
            covariance[:, 3:, 3:] = self.orientation_sigma**2 * np.eye(3)
        if self.along_drives > 0.0:
            J = command_jacobian[:, :components]
            covariance += self.along_drives**2 * (J @ np.swapaxes(J, 1, 2))
        return covariance

    @property
    def along_drives(self) -> float:
        """Of every actuator, in units of its command: repeatability and lack together."""
        return float(np.hypot(self.repeatability, self.lack))

    def whitening(self, command_jacobian: Floats, components: int) -> Floats:
        """(N, c, c) matrices W with W'W the inverse of the covariance; a read-only view of one where all are alike."""
        count = len(command_jacobian)
        if self.along_drives == 0.0 and self.sight is None:
            sigma = np.array([self.position_sigma] * 3 + [self.orientation_sigma] * 3)[:components]
            return np.broadcast_to(np.diag(1.0 / sigma), (count, components, components))
        whitening = np.empty((count, components, components))
        for rows in chunks(count):
            covariance = self.take(rows).covariance(command_jacobian[rows], components)
            whitening[rows] = np.linalg.inv(np.linalg.cholesky(covariance))
        return whitening

    def scaled(self, factor: float) -> Noise:
        """The same noise, every sigma larger by a factor."""
        return replace(
            self,
            position_sigma=self.position_sigma * factor,
            orientation_sigma=self.orientation_sigma * factor,
            repeatability=self.repeatability * factor,
            lack=self.lack * factor,
        )

    def at_least(self, sigma: float) -> Noise:
        """The same noise, its sigmas no smaller than one (m and rad)."""
        return replace(
            self,
            position_sigma=max(self.position_sigma, sigma),
            orientation_sigma=max(self.orientation_sigma, sigma),
        )

    def take(self, rows: npt.NDArray[np.generic] | slice) -> Noise:
        """The noise of some of the poses."""
        if self.sight is None or self.reach is None:
            return self
        return replace(self, sight=self.sight[rows], reach=self.reach[rows])

    def _shape(self, count: int) -> Floats:
        """(N, 3, 3) covariance of a position over position_sigma^2."""
        if self.sight is None or self.reach is None:
            return np.broadcast_to(np.eye(3), (count, 3, 3))
        along = self.sight[:, :, None] * self.sight[:, None, :]
        across = np.eye(3) - along
        level = 3.0 / (self.range_ratio**2 + 2.0)
        return np.asarray(level * (self.range_ratio**2 * along + self.reach[:, None, None] ** 2 * across))


def line_of_sight(position: Floats, station: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3) from a station to positions (N, 3), and the distances (N,) over their mean.

    Gross errors of position are not in the mean, and count as ``FARTHEST`` times as far away as it at most.
    """
    sight = position - station
    size = np.abs(sight).max(axis=1, keepdims=True)  # the square of a gross error need not be a number
    unit = sight / size
    length = np.linalg.norm(unit, axis=1)
    distance = length * size[:, 0]
    near = distance[distance <= FARTHEST * np.median(distance)].mean()
    return unit / length[:, None], np.minimum(distance / near, FARTHEST)


def range_ratio(noise: Noise, residual: Floats) -> float:
    """Noise along the line of sight over noise across it, by maximum likelihood from residuals (N, 3), m.

    The level stays as declared: only residuals' directions are asked, which an unmodelled effect hardly steers.
    """

    def cost(log_ratio: float) -> float:
        trial = replace(noise, range_ratio=float(np.exp(log_ratio)))
        shape = trial._shape(len(residual))
        mahalanobis = np.einsum("ni,nij,nj->n", residual, np.linalg.inv(shape), residual).sum()
        # The level is profiled out, so that a lack of fit does not pose as a ratio.
        return float(1.5 * len(residual) * np.log(mahalanobis) + 0.5 * np.linalg.slogdet(shape)[1].sum())

    found = minimize_scalar(cost, bounds=(np.log(0.05), np.log(3.0)), method="bounded")
    return float(np.exp(found.x))


def contrasts(visits: npt.NDArray[np.intp], values: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """Differences between visits of one pose that are free of the pose itself.

    Parameters
    ----------
    visits
        (N,) index of each row's pose.
    values
        (N, c) measured less predicted.

    Returns
    -------
    contrasts, rows
        (k, c) each of the variance of a single visit and independent of the others (Helmert's), and (k,) one row of
        its pose.
    """
    order = np.argsort(visits, kind="stable")
    begins = np.flatnonzero(np.diff(visits[order], prepend=-1))
    counts = np.diff(begins, append=len(order))
    found, rows = [np.zeros((0, values.shape[1]))], [np.zeros(0, dtype=np.intp)]
    for count in np.unique(counts[counts > 1]):  # poses of as many visits at once
        visit = order[begins[counts == count, None] + np.arange(count)]
        j = np.arange(1.0, count)[:, None]
        earlier = np.cumsum(values[visit[:, :-1]], axis=1) / j
        found.append(((earlier - values[visit[:, 1:]]) * np.sqrt(j / (j + 1.0))).reshape(-1, values.shape[1]))
        rows.append(visit[:, 1:].ravel())
    return np.concatenate(found), np.concatenate(rows)


def roughly(noise: Noise, values: Floats, declared: tuple[bool, bool]) -> Noise:
    """Noise whose sigmas that were not declared are told by medians, which neither gross errors nor heavy tails move.

    Parameters
    ----------
    values
        (N, c) measured less predicted, m and rad.
    declared
        Whether the position's and the orientation's sigma are known.
    """
    sigmas = [noise.position_sigma, noise.orientation_sigma]
    for i, kind in enumerate((slice(0, 3), slice(3, 6))):
        if not declared[i]:
            sigmas[i] = max(SMALLEST, float(np.sqrt(np.median((values[:, kind] ** 2).sum(axis=1)) / chi2.median(3))))
    return replace(noise, position_sigma=sigmas[0], orientation_sigma=sigmas[1])


def from_repeats(noise: Noise, contrast: Floats, command_jacobian: Floats, declared: tuple[bool, bool]) -> Noise:
    """Noise whose repeatability, and whose sigmas that were not declared, explain the scatter between visits.

    Maximum likelihood over contrasts (k, c), with the derivative (k, 6, n) of the pose by the commands. Repeatability is
    left at zero where the scatter does not show it. Contrasts far outside the others count as if they were at the edge.

    Parameters
    ----------
    declared
        Whether the position's and the orientation's sigma are known.
    """
    components = contrast.shape[1]
    contrast = _tamed(contrast)
    spread = np.median(np.abs(contrast), axis=0) / 0.6745
    rough = np.maximum([np.median(spread[:3]), np.median(spread[3:]) if components == 6 else 1.0], SMALLEST)
    open_ = [i for i in range(2) if not declared[i] and (i == 0 or components == 6)]
    base = replace(
        noise,
        position_sigma=noise.position_sigma if declared[0] else rough[0],
        orientation_sigma=noise.orientation_sigma if declared[1] else rough[1],
    )
    # A unit of repeatability: what would move the TCP by the position's noise.
    gain = float(np.sqrt((command_jacobian[:, :3] ** 2).sum(axis=(1, 2)).mean() / 3.0))
    unit = base.position_sigma / max(gain, 1e-12)

    def trial(x: Floats) -> Noise:
        sigmas = [base.position_sigma, base.orientation_sigma]
        for value, i in zip(x[1:], open_, strict=True):
            sigmas[i] *= float(np.exp(value))
        return replace(
            base, position_sigma=sigmas[0], orientation_sigma=sigmas[1], repeatability=unit * float(np.sqrt(x[0]))
        )

    def cost(x: Floats) -> float:
        covariance = trial(x).covariance(command_jacobian, components)
        solved = np.linalg.solve(covariance, contrast[..., None])[..., 0]
        return float(0.5 * (np.linalg.slogdet(covariance)[1].sum() + np.einsum("ni,ni->", contrast, solved)))

    starts = [np.array([0.05] + [0.0] * len(open_)), np.array([1.0] + [-0.5] * len(open_))]
    bounds = [(0.0, 1e4)] + [(-5.0, 5.0)] * len(open_)
    found = [minimize(cost, start, bounds=bounds, method="L-BFGS-B") for start in starts]
    best = min(found, key=lambda result: float(result.fun))
    simpler = np.zeros(1 + len(open_))
    if open_:
        fixed = [(0.0, 0.0), *bounds[1:]]
        simpler = minimize(cost, simpler, bounds=fixed, method="L-BFGS-B").x
    chosen = best.x if 2.0 * (cost(simpler) - float(best.fun)) > SHOWN else simpler
    if all(declared):
        return replace(trial(chosen), source="declared")
    return replace(trial(chosen), source="repeats", dof=float(3 * len(contrast))).at_least(SMALLEST)


def _tamed(contrast: Floats) -> Floats:
    """Contrasts (k, c), those beyond the 97.5 % point of what the median of their size implies drawn back to it."""
    scaled = contrast / np.maximum(np.median(np.abs(contrast), axis=0), SMALLEST)
    norms = (scaled**2).sum(axis=1)
    c = contrast.shape[1]
    limit = chi2.ppf(0.975, c) * np.median(norms) / chi2.median(c)
    return np.asarray(contrast * np.sqrt(np.minimum(1.0, limit / np.maximum(norms, 1e-300)))[:, None])
