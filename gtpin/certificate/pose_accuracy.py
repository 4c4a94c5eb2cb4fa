"""Pose accuracy (ISO 9283): distances of the means of visits from the commanded poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.certificate.quantity import Quantity, blank
from gtpin.certificate.repeatability import CYCLES
from gtpin.distributions import truncated
from gtpin.typing import Floats


def means_of_visits(visits: npt.NDArray[np.intp], values: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """(P, c) mean of ``values`` (N, c) over the visits of each pose, and (P,) numbers of visits; ``visits`` (N,): index of each
    row's pose."""
    counts = np.bincount(visits)
    sums = np.column_stack([np.bincount(visits, column) for column in values.T])
    return sums / counts[:, None], counts


def standard_accuracy(visits: npt.NDArray[np.intp], errors: Floats) -> Quantity:
    """AP_p as defined in ISO 9283: the largest over the poses with 30 visits or more.

    Parameters
    ----------
    visits
        (N,) index of each row's pose.
    errors
        (N, 3) measured less commanded position, m.
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

    Parameters
    ----------
    symbol, unit
        Symbol and unit of the quantities: ``AP_p`` and ``m``, or ``AP_o`` and ``rad``.
    visits
        (N,) index of each row's pose.
    errors
        (N, 3) measured less commanded: position, m, or rotation vector, rad.
    scatter
        Scatter of a visit.
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
