"""Sparse regression as in SINDy: sequentially thresholded least squares on a library of textbook forms.

Brunton, Proctor and Kutz 2016, PNAS 113, 3932. The library has one column for each coefficient of each effect at each site,
normalised. The threshold has the smallest extended BIC, as for the LASSO; by the corrected AIC (Mangan et al. 2017, Proc. R.
Soc. A 473, 20170009) it named a false cause in nearly every case. Probabilities are inclusion probabilities over 20 bootstrap
samples of the poses (Fasel et al. 2022, Proc. R. Soc. A 478, 20210904).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from selection import MOST, regressed

from gtpin.bench.benchmark.answer import Answer

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
RIDGE = 0.05
ROUNDS = 20
THRESHOLDS = np.geomspace(300.0, 2.0, 24)
"""In units of the noise: the size of a coefficient of a column of unit length."""


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    return regressed(folder, select, again, lambda rng, n: rng.integers(0, n, n))


def select(y: Floats, groups: Sequence[Floats]) -> tuple[list[int], float]:
    """The groups with a coefficient that is not zero, and the threshold."""
    library = _Library(y, groups)
    best: tuple[float, list[int], float] = (float(y @ y), [], float(THRESHOLDS[0]))
    for threshold in THRESHOLDS:
        kept = library.thresholded(float(threshold))
        n, k, found = len(y), int(kept.sum()), library.groups(kept)
        if len(found) > MOST or k > n // 4:
            break
        cost = library.left(kept) + k * np.log(n) + 2.0 * len(found) * np.log(len(groups))
        if cost < best[0]:
            best = cost, found, float(threshold)
    return best[1], best[2]


def again(y: Floats, groups: Sequence[Floats], penalty: float) -> list[int]:
    """The groups that a threshold leaves."""
    library = _Library(y, groups)
    return library.groups(library.thresholded(penalty))


class _Library:
    """All columns, of unit length, by their inner products."""

    def __init__(self, y: Floats, groups: Sequence[Floats]) -> None:
        X = np.hstack(list(groups))
        X = X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)
        self.of = np.repeat(np.arange(len(groups)), [group.shape[1] for group in groups])
        self.G, self.b, self.power = X.T @ X, X.T @ y, float(y @ y)

    def thresholded(self, threshold: float) -> Mask:
        """The columns that are left when ridge regression and thresholding have been repeated until nothing changes."""
        kept = np.ones(len(self.b), dtype=bool)
        for _ in range(ROUNDS):
            c = np.zeros(len(self.b))
            c[kept] = np.linalg.solve(self.G[np.ix_(kept, kept)] + RIDGE * np.eye(kept.sum()), self.b[kept])
            fewer = kept & (np.abs(c) >= threshold)
            if np.array_equal(fewer, kept):
                break
            kept = fewer
        return kept

    def left(self, kept: Mask) -> float:
        """Sum of squares that these columns leave by least squares."""
        c = np.linalg.lstsq(self.G[np.ix_(kept, kept)], self.b[kept], rcond=1e-10)[0] if kept.any() else np.zeros(0)
        return max(self.power - float(c @ self.b[kept]), 0.0)

    def groups(self, kept: Mask) -> list[int]:
        """The groups of some columns."""
        return sorted(set(self.of[kept].tolist()))
