"""Pose repeatability (ISO 9283): as the standard defines it, and from the scatter of repeated visits of many poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.expected import mean_length
from gtpin.certificate.quantity import Quantity, blank
from gtpin.noise.repeats import LEAST_CONTRASTS, contrasts
from gtpin.typing import Floats

CYCLES = 30
"""Number of visits of one pose that ISO 9283 requires."""
ANGLES = ("RP_a", "RP_b", "RP_c")
"""Repeatabilities of orientation about the axes x, y and z."""


@dataclass(frozen=True)
class Scatter:
    """Scatter of single visits about the mean of their pose, pooled over poses.

    Parameters
    ----------
    covariance
        (c, c) covariance of a visit, m and rad, including the instrument's noise; None with fewer than eight repeats.
    repeats, poses
        Number of visits beyond the first of each pose, and of poses with two visits or more.
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
