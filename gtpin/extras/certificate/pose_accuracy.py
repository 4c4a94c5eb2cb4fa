"""Pose accuracy and repeatability (ISO 9283), by the standard and from the scatter of repeated visits of many poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import logsumexp

from gtpin.accuracy.expected import mean_length
from gtpin.calibration.fit_state import LACK_OF_FIT
from gtpin.distributions import chi2
from gtpin.extras.certificate.quantity import Quantity, blank
from gtpin.noise.estimate import LEAST_CONTRASTS, contrasts
from gtpin.typing import Floats

CYCLES = 30
"""Number of visits of one pose that ISO 9283 requires."""
WIDE, FINE = 8.0, 501
"""Standard deviations of a mean square about its estimate, and number of values between, at which its density is computed."""
ANGLES = ("RP_a", "RP_b", "RP_c")
"""Repeatabilities of orientation about the axes x, y and z."""


def means_of_visits(visits: npt.NDArray[np.intp], values: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """(P, c) mean of ``values`` (N, c) over the visits of each pose, and (P,) numbers of visits; ``visits`` (N,): index of each
    row's pose."""
    counts = np.bincount(visits)
    sums = np.column_stack([np.bincount(visits, column) for column in values.T])
    return sums / counts[:, None], counts


def standard_accuracy(visits: npt.NDArray[np.intp], errors: Floats) -> Quantity:
    """AP_p as defined in ISO 9283: the largest over the poses with 30 visits or more.

    ``visits``: (N,) index of each row's pose. ``errors``: (N, 3) measured less commanded position, m.
    """
    means, counts = means_of_visits(visits, errors[:, :3])
    often = np.flatnonzero(counts >= CYCLES)
    if not len(often):
        return blank("AP_p", "m", "few_cycles", have=int(counts.max()))
    lengths = np.linalg.norm(means[often], axis=1)
    worst = often[int(np.argmax(lengths))]
    own = errors[visits == worst, :3]
    along = means[worst] / max(float(np.linalg.norm(means[worst])), 1e-300)
    sigma = float((own @ along).std(ddof=1) / np.sqrt(len(own)))
    return Quantity("AP_p", float(lengths.max()), "m", sigma, len(often), int(counts[often].sum()))


@dataclass(frozen=True)
class Scatter:
    """Scatter of single visits about the mean of their pose.

    ``covariance``: (c, c) covariance of a visit, m and rad, including the instrument's noise. ``repeats``, ``poses``: number
    of visits beyond the first of each pose from which it is estimated, infinite if declared; and of poses with two visits or
    more. ``least``: mean square length of the instrument's declared noise, m^2 or rad^2: a visit has no less; 0 where none was
    declared.
    """

    covariance: Floats
    repeats: float
    poses: int = 0
    least: float = 0.0

    @staticmethod
    def of(visits: npt.NDArray[np.intp], values: Floats) -> Scatter | None:
        """The scatter of ``values`` (N, c), m and rad, pooled over poses; None with too few repeats. visits (N,): index of each
        row's pose."""
        found, _ = contrasts(visits, values)
        if len(found) < LEAST_CONTRASTS:
            return None
        return Scatter(found.T @ found / len(found), len(found), int((np.bincount(visits) > 1).sum()))

    def part(self, part: slice) -> Scatter:
        """The scatter of some of the components."""
        return replace(self, covariance=self.covariance[part, part])

    def with_noise(self, sigma: float | None) -> Scatter:
        """The scatter of three components with the instrument's declared noise, per axis, as its least; without it where none
        was declared, or where the visits scatter by so much less (chi-square) that the declared noise is wrong."""
        declared, count = 3.0 * (sigma or 0.0) ** 2, 3.0 * self.repeats
        if declared == 0.0 or chi2.cdf(count * self.trace / declared, count) < LACK_OF_FIT:
            return self
        return replace(self, least=declared)

    @property
    def trace(self) -> float:
        """Mean square length of a visit's scatter."""
        return float(np.trace(self.covariance))

    @property
    def squared(self) -> float:
        """Trace of the covariance's square. The variance of the square length of a normal vector is twice this."""
        return float(np.trace(self.covariance @ self.covariance))

    @property
    def variance(self) -> float:
        """Variance of the trace that is estimated from k repeats: 2 tr(S^2) / k (Wishart)."""
        return 2.0 * self.squared / self.repeats


def accuracy(
    symbol: str, unit: str, visits: npt.NDArray[np.intp], errors: Floats, scatter: Scatter
) -> tuple[Quantity, Quantity]:
    """AP over all poses, with any number of visits each: the root mean square (``_rms``), and the largest (``_max``).

    E|mean of n visits - command|^2 = AP^2 + tr(S) / n with S the covariance of a visit, so tr(S) / n is subtracted from the
    mean square. Its variance over P poses, given their true errors t, is the sum of 4 t' S t / n + 2 tr(S^2) / n^2 divided by
    P^2, plus the contribution of the uncertainty of S (:func:`_root_mean_square`).

    ``symbol``, ``unit``: symbol and unit of the quantities: ``AP_p`` and ``m``, or ``AP_o`` and ``rad``. ``visits``: (N,)
    index of each row's pose. ``errors``: (N, 3) measured less commanded: position, m, or rotation vector, rad. ``scatter``:
    scatter of a visit.
    """
    means, counts = means_of_visits(visits, errors)
    squares, S, P = (means**2).sum(axis=1), scatter.covariance, len(means)
    own = 2.0 * scatter.squared / counts**2
    # Squares of measured means contain their noise: 4 m' S m / n is on average larger by 4 tr(S^2) / n^2.
    through = np.maximum(4.0 * np.einsum("pi,ij,pj->p", means, S, means) / counts - 2.0 * own, 0.0)
    doubt, share = float(np.sqrt((through + own).sum())) / P, float((1.0 / counts).mean())
    largest = int(np.argmax(squares))
    of_largest = np.sqrt(float(means[largest] @ S @ means[largest]) / counts[largest] / squares[largest])
    return (
        _root_mean_square(symbol, unit, (float(squares.mean()), doubt), scatter, share, P, len(errors)),
        Quantity(f"{symbol}_max", float(np.sqrt(squares[largest])), unit, float(of_largest) or None, P, len(errors)),
    )


def left_out_accuracy(
    symbol: str, unit: str, after: float, scatter: Scatter, poses: int, rows: int, freedom: float
) -> Quantity:
    """AP of the corrected machine: the root mean square error ``after``, m or rad, on left-out poses, less the scatter.

    Errors are assumed to be isotropic normal vectors: the relative standard deviation of their mean square with f degrees of
    ``freedom`` is sqrt(2 / f).
    """
    return _root_mean_square(
        symbol, unit, (after**2, after**2 * float(np.sqrt(2.0 / freedom))), scatter, 1.0, poses, rows
    )


def _root_mean_square(
    symbol: str, unit: str, observed: tuple[float, float], scatter: Scatter, share: float, poses: int, rows: int
) -> Quantity:
    """The root r of a mean square that was observed together with a share h of the scatter of a visit.

    ``observed``: the observed mean square A and its standard deviation a. With S the trace of the scatter, b its standard
    deviation, n the declared part of it and s^2 the rest: A is N(r^2 + h (n + s^2), a^2), and S is N(n + s^2, b^2). The priors
    of r >= 0 and s >= 0 are flat (Gelman, Bayesian Analysis 1 (2006) 515, section 3). Of the posterior of r its mean and
    standard deviation are given. With flat priors of their squares the estimate of a small r would be too large.

    Without doubt, the scatter of a visit is not known, and so the uncertainty of the root is not either.
    """
    (A, a), b, n = observed, float(np.sqrt(scatter.variance)), scatter.least
    power, doubt = A - share * scatter.trace, float(np.hypot(a, share * b))
    if doubt == 0.0:
        return Quantity(f"{symbol}_rms", float(np.sqrt(max(power, 0.0))), unit, None, poses, rows)
    r = _roots(np.array([power]), doubt)[0]
    density = -0.5 * ((power - r**2) / doubt) ** 2
    if a > 0.0 and b > 0.0:  # given r, s^2 has this mean and standard deviation before its prior
        mean, w = (share * b**2 * (A - share * n - r**2) + a**2 * (scatter.trace - n)) / doubt**2, a * b / doubt
        s = _roots(mean, w)
        density += logsumexp(-0.5 * ((s**2 - mean[:, None]) / w) ** 2, axis=1) + np.log(s[:, 1] - s[:, 0])
    weight = np.exp(density - density.max())
    rms = float((weight * r).sum() / weight.sum())
    sigma = float(np.sqrt((weight * (r - rms) ** 2).sum() / weight.sum()))
    return Quantity(f"{symbol}_rms", rms, unit, sigma, poses, rows)


def _roots(squares: Floats, sigma: float) -> Floats:
    """(K, FINE) values of roots whose squares are about (K,) estimates, with a standard deviation ``sigma``."""
    low, high = (
        np.sqrt(np.maximum(at, 0.0)) for at in (squares - WIDE * sigma, np.maximum(squares, 0.0) + WIDE * sigma)
    )
    return np.asarray(np.linspace(low, high, FINE, axis=-1))


def repeatability_of(position: Floats) -> float:
    """RP_l of n visits: mean plus three standard deviations of the distances of their positions (n, 3), m, from their mean."""
    lengths = np.linalg.norm(position - position.mean(axis=0), axis=1)
    return float(lengths.mean() + 3.0 * lengths.std(ddof=1))


def jackknife(position: Floats) -> float:
    """Standard uncertainty of RP_l of positions (n, 3), m, by the jackknife (Efron).

    Its square is (n - 1) / n times the sum of the squared deviations, from their mean, of RP_l without each visit in turn.
    """
    n = len(position)
    without = np.array([repeatability_of(np.delete(position, i, axis=0)) for i in range(n)])
    return float(np.sqrt((n - 1) * without.var()))


def standard_repeatability(visits: npt.NDArray[np.intp], position: Floats) -> Quantity:
    """RP_l as defined in ISO 9283: the largest over the poses with 30 visits or more.

    Its standard uncertainty is from the jackknife, because distances are not normally distributed. visits (N,): index of each
    row's pose; position (N, 3), m.
    """
    counts = np.bincount(visits)
    often = np.flatnonzero(counts >= CYCLES)
    if not len(often):
        return blank("RP_l", "m", "few_cycles", have=int(counts.max()))
    found = []
    for pose in often:
        own = position[visits == pose]
        found.append((repeatability_of(own), jackknife(own)))
    value, sigma = max(found)
    return Quantity("RP_l", value, "m", sigma, len(often), int(counts[often].sum()))


def pooled_repeatability(visits: npt.NDArray[np.intp], values: Floats, position_sigma: float) -> list[Quantity]:
    """RP_l, and the repeatabilities about the axes, that many visits to a pose would have with the pooled scatter.

    ``RP_l_pooled`` includes the instrument's noise. ``RP_l_machine`` does not: ``position_sigma`` (m, per axis) is subtracted.
    It is blank where the scatter exceeds the noise by less than two standard deviations of the scatter. ``visits``, ``values``:
    as for :meth:`Scatter.of`.
    """
    scatter, repeats = Scatter.of(visits, values), len(visits) - len(np.unique(visits))
    names = [f"{angle}_pooled" for angle in ANGLES]
    if scatter is None:
        lengths = [blank(symbol, "m", "few_visits", have=repeats) for symbol in ("RP_l_pooled", "RP_l_machine")]
        return lengths + [blank(name, "rad", "few_visits", have=repeats) for name in names]
    position, rows = scatter.part(slice(3)), repeats + scatter.poses
    own = position.covariance - position_sigma**2 * np.eye(3)
    machine = blank("RP_l_machine", "m", "within_noise", have=repeats)
    if np.trace(own) > 2.0 * float(np.sqrt(position.variance)):
        values, vectors = np.linalg.eigh(own)
        machine = _length("RP_l_machine", (vectors * np.maximum(values, 0.0)) @ vectors.T, position, rows)
    angles = [blank(name, "rad", "no_orientation") for name in names]
    if len(scatter.covariance) == 6:
        found = 3.0 * np.sqrt(np.diag(scatter.covariance)[3:])
        angles = [
            Quantity(name, float(v), "rad", float(v / np.sqrt(2.0 * repeats)), scatter.poses, rows)
            for name, v in zip(names, found, strict=True)
        ]
    return [_length("RP_l_pooled", position.covariance, position, rows), machine, *angles]


def _length(symbol: str, covariance: Floats, seen: Scatter, rows: int) -> Quantity:
    """RP_l of a covariance: mean and three standard deviations of the length of normal vectors of mean zero. Its relative
    uncertainty is half that of the covariance's trace, whose uncertainty is that of the trace of the measured scatter."""
    mean, trace = float(mean_length(covariance[None])[0]), float(np.trace(covariance))
    value = mean + 3.0 * float(np.sqrt(max(trace - mean**2, 0.0)))
    sigma = value * float(np.sqrt(seen.variance)) / (2.0 * trace)
    return Quantity(symbol, value, "m", sigma, seen.poses, rows)
