"""Group LASSO (Yuan and Lin 2006, J. R. Stat. Soc. B 68, 49) on the textbook forms: one group for each effect and site.

The penalty has the smallest extended BIC of the refitted groups (Chen and Chen 2008, Biometrika 95, 759). Probabilities are
those of stability selection: the share of 20 halves of the poses in which a group is selected (Meinshausen and Buehlmann 2010,
J. R. Stat. Soc. B 72, 417).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from selection import MOST, regressed

from gtpin.bench.benchmark.answer import Answer

Floats = npt.NDArray[np.float64]
STEPS, SMALLEST = 40, 0.03
SWEEPS = 60


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    return regressed(folder, select, again, lambda rng, n: rng.permutation(n)[: n // 2])


def select(y: Floats, groups: Sequence[Floats]) -> tuple[list[int], float]:
    """The groups with the smallest extended BIC along the path, and their penalty as a share of the largest one."""
    path = _Path(y, groups)
    best: tuple[float, list[int], float] = (float(y @ y), [], 1.0)
    for share in np.geomspace(1.0, SMALLEST, STEPS)[1:]:
        active = path.active(float(share))
        if len(active) > MOST:
            break
        X = np.hstack([groups[i] for i in active]) if active else np.zeros((len(y), 0))
        residual = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
        cost = float(residual @ residual) + X.shape[1] * np.log(len(y)) + 2.0 * len(active) * np.log(len(groups))
        if cost < best[0]:
            best = cost, active, float(share)
    return best[1], best[2]


def again(y: Floats, groups: Sequence[Floats], penalty: float) -> list[int]:
    """The groups that a penalty selects."""
    path = _Path(y, groups)
    for share in np.geomspace(1.0, max(penalty, 1e-6), 8):
        found = path.active(float(share))
    return found


class _Path:
    """Block coordinate descent with orthonormal groups, each solution from the one before."""

    def __init__(self, y: Floats, groups: Sequence[Floats]) -> None:
        bases = []
        for X in groups:
            U, s, _ = np.linalg.svd(X, full_matrices=False)
            bases.append(U[:, s > 1e-6 * max(s.max(initial=0.0), 1e-12)])
        Q = np.hstack(bases)
        self.ends = np.cumsum([0, *(basis.shape[1] for basis in bases)])
        self.G, self.b = Q.T @ Q, Q.T @ y
        self.c = np.zeros(len(self.b))
        self.root = [np.sqrt(max(basis.shape[1], 1)) for basis in bases]
        self.largest = max(np.linalg.norm(self.b[own]) / self.root[i] for i, own in self._own())

    def _own(self) -> list[tuple[int, slice]]:
        return [(i, slice(a, b)) for i, (a, b) in enumerate(zip(self.ends, self.ends[1:], strict=False))]

    def active(self, share: float) -> list[int]:
        """The groups that are not zero with a share of the largest penalty."""
        penalty = share * self.largest
        for _ in range(SWEEPS):
            before = self.c.copy()
            for i, own in self._own():
                r = self.b[own] - self.G[own] @ self.c + self.c[own]
                size = float(np.linalg.norm(r))
                self.c[own] = max(0.0, 1.0 - penalty * self.root[i] / max(size, 1e-300)) * r
            if np.abs(self.c - before).max() < 1e-4 * max(np.abs(self.c).max(), 1e-12):
                break
        return [i for i, own in self._own() if np.any(self.c[own])]
