"""Pose accuracy and repeatability (ISO 9283), by the standard and from the scatter of repeated visits of many poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.expected import mean_length
from gtpin.distributions import truncated
from gtpin.extras.certificate.quantity import Quantity, blank
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
class Scatter:
    """Scatter of single visits about the mean of their pose.

    ``covariance``: (c, c) covariance of a visit, m and rad, including the instrument's noise. ``repeats``, ``poses``: number
    of visits beyond the first of each pose from which it is estimated, infinite if declared; and of poses with two visits or
    more.
    """

    covariance: Floats
    repeats: float
    poses: int = 0

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
        return Scatter(self.covariance[part, part], self.repeats, self.poses)

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
    doubt = np.sqrt((through + own).sum() / P**2 + scatter.variance * float((1.0 / counts).mean()) ** 2)
    largest = int(np.argmax(squares))
    of_largest = np.sqrt(float(means[largest] @ S @ means[largest]) / counts[largest] / squares[largest])
    return (
        _root_mean_square(symbol, unit, float((squares - scatter.trace / counts).mean()), float(doubt), P, len(errors)),
        Quantity(f"{symbol}_max", float(np.sqrt(squares[largest])), unit, float(of_largest) or None, P, len(errors)),
    )


def left_out_accuracy(
    symbol: str, unit: str, after: float, scatter: Scatter, poses: int, rows: int, freedom: float
) -> Quantity:
    """AP of the corrected machine: the root mean square error ``after``, m or rad, on left-out poses, less the scatter.

    Errors are assumed to be isotropic normal vectors: the relative standard deviation of their mean square with f degrees of
    ``freedom`` is sqrt(2 / f).
    """
    doubt = np.sqrt(after**4 * 2.0 / freedom + scatter.variance)
    return _root_mean_square(symbol, unit, after**2 - scatter.trace, float(doubt), poses, rows)


def _root_mean_square(symbol: str, unit: str, power: float, doubt: float, poses: int, rows: int) -> Quantity:
    """The root of a mean square, whose estimate ``power`` has the standard uncertainty ``doubt`` and can be negative.

    Without doubt, the scatter of a visit is not known, and so the uncertainty of the root is not either.
    """
    if doubt == 0.0:
        return Quantity(f"{symbol}_rms", float(np.sqrt(max(power, 0.0))), unit, None, poses, rows)
    rms = float(np.sqrt(truncated(power, doubt)[0]))
    return Quantity(f"{symbol}_rms", rms, unit, min(doubt / (2.0 * rms), rms), poses, rows)


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
