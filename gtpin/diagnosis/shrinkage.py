"""How far the gap shrinks on poses that were not fitted: blocks left out in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.design import Design

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

RESAMPLES = 2000


@dataclass(frozen=True)
class Gap:
    """Held-out position errors before and after causes were added.

    Parameters
    ----------
    before, after
        Root mean square length of the position error per pose, m, of a geometry alone and with the causes.
    floor
        What a perfect model would show, m.
    shrinkage
        Share of the gap's power that goes away, 1 - (after^2 - floor^2) / (before^2 - floor^2); None where there is no gap.
    interval
        Its 95 % interval, by resampling blocks.
    """

    before: float
    after: float
    floor: float
    shrinkage: float | None
    interval: tuple[float, float] | None


def gap(design: Design, causes: Floats, floor: Floats, blocks: list[Mask], rng: np.random.Generator) -> Gap:
    """Leave each block out, fit geometry and causes to the rest, and predict it.

    Parameters
    ----------
    design
        The linear problem, causes not yet in it.
    causes
        (N c, m) whitened displacements of the causes for coefficients of the size that their priors have; m may be 0.
    floor
        (N,) expected squared length of each pose's position noise, m^2.
    blocks
        (N,) masks of the poses left out, a partition.
    """
    c = design.components
    prior = np.concatenate([np.ones(design.n_geometry), np.zeros(design.B.shape[1] - design.n_geometry)])
    squares = np.empty((2, len(floor)))
    for block in blocks:
        out = np.repeat(block, c)
        for row, J, weight in (
            (0, design.B, prior),
            (1, np.hstack([design.B, causes]), np.concatenate([prior, np.ones(causes.shape[1])])),
        ):
            A = J[~out].T @ J[~out] + np.diag(weight)
            z = np.linalg.lstsq(A, J[~out].T @ design.y[~out], rcond=None)[0]
            left = (design.y[out] - J[out] @ z).reshape(-1, c)
            errors = np.linalg.solve(design.whitening[block], left[..., None])[..., 0]
            squares[row, block] = (errors[:, :3] ** 2).sum(axis=1)
    before, after, least = (float(np.sqrt(values.mean())) for values in (squares[0], squares[1], floor))
    if not causes.shape[1]:
        return Gap(before, after, least, None, None)
    sums = np.array([[squares[0, b].sum(), squares[1, b].sum(), floor[b].sum()] for b in blocks])
    drawn = rng.integers(0, len(blocks), (RESAMPLES, len(blocks)))
    resampled = sums[drawn].sum(axis=1)
    low, high = np.percentile([_share(*row) for row in resampled], (2.5, 97.5))
    return Gap(before, after, least, _share(*sums.sum(axis=0)), (float(low), float(high)))


def _share(before: float, after: float, floor: float) -> float:
    """Share of the gap's power beyond the floor that goes away; between 0 and 1 but for noise."""
    power = max(before - floor, 1e-300)
    return float(np.clip(1.0 - (after - floor) / power, -1.0, 1.0))
