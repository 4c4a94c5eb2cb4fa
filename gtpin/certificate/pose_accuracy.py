"""Pose accuracy and repeatability (ISO 9283), by the standard and from the scatter of repeated visits of many poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.expected import mean_length
from gtpin.certificate.quantity import Quantity, blank
from gtpin.distributions import truncated
from gtpin.noise.estimate import LEAST_CONTRASTS, contrasts
from gtpin.typing import Floats

CYCLES = 30
"""Number of visits of one pose that ISO 9283 requires."""
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
class VisitScatter:
    """Covariance (3, 3), m^2 or rad^2, of a visit, and the number of repeats from which it is estimated; infinite if
    declared."""

    covariance: Floats
    repeats: float

    @property
    def trace(self) -> float:
        """Mean square length of a visit's scatter."""
        return float(np.trace(self.covariance))

    @property
    def squared(self) -> float:
        """Trace of the covariance's square. The variance of the square length of a normal vector is twice this."""
        return float(np.trace(self.covariance @ self.covariance))


def accuracy(
    symbol: str, unit: str, visits: npt.NDArray[np.intp], errors: Floats, scatter: VisitScatter
) -> tuple[Quantity, Quantity]:
    """AP over all poses, with any number of visits each: the root mean square (``_rms``), and the largest (``_max``).

    E|mean of n visits - command|^2 = AP^2 + tr(S) / n with S the covariance of a visit, so tr(S) / n is subtracted from the
    mean square. Its variance over P poses, given their true errors t, is the sum of 4 t' S t / n + 2 tr(S^2) / n^2 divided by
    P^2, plus the contribution of the uncertainty of S.

    ``symbol``, ``unit``: symbol and unit of the quantities: ``AP_p`` and ``m``, or ``AP_o`` and ``rad``. ``visits``: (N,)
    index of each row's pose. ``errors``: (N, 3) measured less commanded: position, m, or rotation vector, rad. ``scatter``:
    scatter of a visit.
    """
    means, counts = means_of_visits(visits, errors)
    squares, S, P = (means**2).sum(axis=1), scatter.covariance, len(means)
    own = 2.0 * scatter.squared / counts**2
    # Squares of measured means contain their noise: 4 m' S m / n is on average larger by 4 tr(S^2) / n^2.
    through = np.maximum(4.0 * np.einsum("pi,ij,pj->p", means, S, means) / counts - 2.0 * own, 0.0)
    doubt = np.sqrt((through + own).sum() / P**2 + _of_scatter(scatter, float((1.0 / counts).mean())))
    largest = int(np.argmax(squares))
    of_largest = np.sqrt(float(means[largest] @ S @ means[largest]) / counts[largest] / squares[largest])
    return (
        _root_mean_square(symbol, unit, float((squares - scatter.trace / counts).mean()), float(doubt), P, len(errors)),
        Quantity(f"{symbol}_max", float(np.sqrt(squares[largest])), unit, float(of_largest) or None, P, len(errors)),
    )


def left_out_accuracy(
    symbol: str, unit: str, after: float, scatter: VisitScatter, poses: int, rows: int, freedom: float
) -> Quantity:
    """AP of the corrected machine: the root mean square error ``after``, m or rad, on left-out poses, less the scatter.

    Errors are assumed to be isotropic normal vectors: the relative standard deviation of their mean square with f degrees of
    ``freedom`` is sqrt(2 / f).
    """
    doubt = np.sqrt(after**4 * 2.0 / freedom + _of_scatter(scatter, 1.0))
    return _root_mean_square(symbol, unit, after**2 - scatter.trace, float(doubt), poses, rows)


def _of_scatter(scatter: VisitScatter, share: float) -> float:
    """Variance of the scatter's trace, 2 tr(S^2) / k with k repeats (Wishart), times the square of its share."""
    return 2.0 * scatter.squared / scatter.repeats * share**2


def _root_mean_square(symbol: str, unit: str, power: float, doubt: float, poses: int, rows: int) -> Quantity:
    """The root of a mean square, whose estimate ``power`` has the standard uncertainty ``doubt`` and can be negative.

    Without doubt, the scatter of a visit is not known, and so the uncertainty of the root is not either.
    """
    if doubt == 0.0:
        return Quantity(f"{symbol}_rms", float(np.sqrt(max(power, 0.0))), unit, None, poses, rows)
    rms = float(np.sqrt(truncated(power, doubt)[0]))
    return Quantity(f"{symbol}_rms", rms, unit, min(doubt / (2.0 * rms), rms), poses, rows)


@dataclass(frozen=True)
class Scatter:
    """Scatter of single visits about the mean of their pose, pooled over poses.

    ``covariance``: (c, c) covariance of a visit, m and rad, including the instrument's noise; None with fewer than eight
    repeats. ``repeats``, ``poses``: number of visits beyond the first of each pose, and of poses with two visits or more.
    """

    covariance: Floats | None
    repeats: int
    poses: int

    @staticmethod
    def of(visits: npt.NDArray[np.intp], values: Floats) -> Scatter:
        """The scatter of ``values`` (N, c), m and rad; visits (N,): index of each row's pose."""
        found, _ = contrasts(visits, values)
        poses = int((np.bincount(visits) > 1).sum())
        enough = len(found) >= LEAST_CONTRASTS
        return Scatter(found.T @ found / len(found) if enough else None, len(found), poses)


def spread_of_length(covariance: Floats) -> tuple[float, float]:
    """Mean and standard deviation of the length of normal vectors of mean zero with a covariance (3, 3)."""
    mean = float(mean_length(covariance[None])[0])
    return mean, float(np.sqrt(max(float(np.trace(covariance)) - mean**2, 0.0)))


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


def pooled_repeatability(scatter: Scatter, position_sigma: float) -> list[Quantity]:
    """RP_l, and the repeatabilities about the axes, that many visits to a pose would have with the pooled scatter.

    ``RP_l_pooled`` includes the instrument's noise. ``RP_l_machine`` does not: ``position_sigma`` (m, per axis) is subtracted.
    It is blank where the scatter exceeds the noise by less than two standard deviations of the scatter.
    """
    covariance, k = scatter.covariance, scatter.repeats
    symbols = ("RP_l_pooled", "RP_l_machine")
    if covariance is None:
        return [blank(symbol, "m", "few_visits", have=k) for symbol in symbols] + [
            blank(f"{angle}_pooled", "rad", "few_visits", have=k) for angle in ANGLES
        ]
    block = covariance[:3, :3]
    seen = _length(symbols[0], block, block, scatter)
    own = block - position_sigma**2 * np.eye(3)
    # The trace of a covariance S that is estimated from k repeats has the variance 2 tr(S^2) / k (Wishart).
    doubt = float(np.sqrt(2.0 * np.trace(block @ block) / k))
    if np.trace(own) > 2.0 * doubt:
        values, vectors = np.linalg.eigh(own)
        own = (vectors * np.maximum(values, 0.0)) @ vectors.T
        machine = _length(symbols[1], own, block, scatter)
    else:
        machine = blank(symbols[1], "m", "within_noise", have=k)
    return [seen, machine, *_angles(scatter)]


def _length(symbol: str, covariance: Floats, seen: Floats, scatter: Scatter) -> Quantity:
    """RP_l of a covariance. Its relative uncertainty is half that of the covariance's trace, whose uncertainty is that of the
    trace of the measured covariance ``seen``."""
    mean, sd = spread_of_length(covariance)
    value = mean + 3.0 * sd
    doubt = float(np.sqrt(2.0 * np.trace(seen @ seen) / scatter.repeats))
    sigma = value * doubt / (2.0 * float(np.trace(covariance)))
    return Quantity(symbol, value, "m", sigma, scatter.poses, scatter.repeats + scatter.poses)


def _angles(scatter: Scatter) -> list[Quantity]:
    covariance, k = scatter.covariance, scatter.repeats
    if covariance is None or len(covariance) < 6:
        return [blank(f"{angle}_pooled", "rad", "no_orientation") for angle in ANGLES]
    found = 3.0 * np.sqrt(np.diag(covariance)[3:])
    return [
        Quantity(f"{angle}_pooled", float(v), "rad", float(v / np.sqrt(2.0 * k)), scatter.poses, k + scatter.poses)
        for angle, v in zip(ANGLES, found, strict=True)
    ]
