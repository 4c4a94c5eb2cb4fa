"""Choice of the poses that determine some effects best; all other unknowns are nuisance parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gtpin.typing import Floats

Rows = npt.NDArray[np.intp]

WORTH = 1e-6
"""Smallest increase of the score for which poses are exchanged."""
PASSES = 2
"""Largest number of rounds of exchanges."""


class Choice:
    """Chooses the poses that best determine some unknowns, in groups; all other unknowns are nuisance parameters.

    The score of a set of poses is the sum over the groups of -log det(C_g) / size of g, where C_g is the group's block of the
    covariance (1 / prior + J'J)^-1 after these poses are measured (Ds-optimality, one value for each group).

    Parameters
    ----------
    J
        (N, c, D) derivatives of the N poses' whitened components by D unknowns with priors of mean zero.
    prior
        (D,) prior variances.
    groups
        Indices of the wanted unknowns, by group.
    """

    def __init__(self, J: Floats, prior: Floats, groups: Sequence[Sequence[int]]) -> None:
        self.J, self.prior = J, prior
        self.groups = [np.array(group, dtype=np.intp) for group in groups]

    def covariance(self, rows: Sequence[int] | Rows) -> Floats:
        """(D, D) covariance of all unknowns after the poses with the indices ``rows`` are measured."""
        J = self.J[np.asarray(rows, dtype=np.intp)].reshape(-1, self.J.shape[2])
        # By the matrix inversion lemma: there are fewer rows than unknowns.
        CJ = self.prior[:, None] * J.T
        return np.asarray(np.diag(self.prior) - CJ @ np.linalg.solve(np.eye(len(J)) + J @ CJ, CJ.T))

    def scores(self, rows: Sequence[int]) -> Floats:
        """(N,) score of ``rows`` together with each other pose; minus infinity for the poses in ``rows``."""
        C = self.covariance(rows)
        CJ = self.J @ C
        S = np.eye(self.J.shape[1]) + CJ @ self.J.swapaxes(1, 2)
        total = np.zeros(len(self.J))
        for group in self.groups:
            own = CJ[:, :, group]
            block = C[np.ix_(group, group)] - own.swapaxes(1, 2) @ np.linalg.solve(S, own)
            total -= np.linalg.slogdet(block)[1] / len(group)
        total[list(rows)] = -np.inf
        return total

    def best(self, count: int) -> Rows:
        """(count,) indices of the chosen poses, ascending: a greedy choice, then exchanges of one pose that improve it."""
        chosen: list[int] = []
        for _ in range(count):
            chosen.append(int(self.scores(chosen).argmax()))
        for _ in range(PASSES):
            before = list(chosen)
            for place, row in enumerate(chosen):
                others = chosen[:place] + chosen[place + 1 :]
                scores = self.scores(others)
                best = int(scores.argmax())
                if scores[best] > scores[row] + WORTH:
                    chosen[place] = best
            if chosen == before:
                break
        return np.array(sorted(chosen), dtype=np.intp)
