"""Outliers of a calibration, readmitted where a cause explains them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.data.instrument_tables import SocketTable
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, HypothesisSet, causes, scales
from gtpin.diagnosis.hypotheses.propose import propose
from gtpin.diagnosis.hypotheses.scope import Scope
from gtpin.diagnosis.inference.search import guess_of_outliers
from gtpin.diagnosis.linear.cross_validation import leave_out
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.preparation.prepare import Prepared
from gtpin.typing import Mask

MOST_POSES = 3000
"""Most poses that a search uses: more make it slower, but hardly better. The causes are then fitted to all poses."""


@dataclass(frozen=True)
class Admitted:
    """Masks (N,) of rows for the search.

    ``sure``: the rows that the calibration used. ``admitted``: these, and the outliers that a cause explains.
    """

    admitted: Mask
    sure: Mask

    @property
    def readmitted(self) -> bool:
        """Whether any outlier is admitted."""
        return bool((self.admitted != self.sure).any())


def readmit_outliers(prepared: Prepared, scope: Scope) -> Admitted:
    """The rows that a search uses: those of the calibration, and outliers that a cause explains.

    A cause that acts at few poses (play whose force seldom changes its sign, a step near a track's end) makes outliers of a
    calibration with geometry alone.
    """
    dataset, baseline = prepared.dataset, prepared.baseline
    priors, sure = scope.priors, baseline.used(dataset)
    suspects = np.flatnonzero(~sure)
    suspects = suspects[baseline.model.kinematics.forward(dataset.q[suspects]).reached]
    suspects = suspects[~_in_sockets(dataset)[suspects]]
    if len(suspects) < priors.readmitted:
        return Admitted(sure, sure)
    explained = np.zeros(len(dataset), dtype=bool)
    # With many poses, the outliers are searched in parts, each with an evenly spread part of the poses that were kept.
    most = len(suspects) if len(dataset) <= MOST_POSES else MOST_POSES // 2
    parts = np.array_split(suspects, -(-len(suspects) // most))
    kept = _evenly(np.flatnonzero(sure), MOST_POSES - len(parts[0]))
    for some in parts:
        rows = np.sort(np.concatenate([kept, some]))
        design = Observed.of(dataset.take(rows), baseline).design(baseline.model)
        hypotheses = propose(design, scope).hypotheses
        guess = guess_of_outliers(hypotheses)
        if causes(guess):
            explained[rows] |= _predicted(hypotheses, guess)
        explained &= ~sure
        least = max(priors.readmitted, priors.readmitted_share * len(some))
        if not design.tracked:
            least = max(least, _free(hypotheses, guess) + 1)
        if explained[some].sum() < least:
            return Admitted(sure, sure)
    return Admitted(sure | explained, sure)


def _in_sockets(dataset: Dataset) -> Mask:
    """(N,) rows of a ball in a socket.

    Visits of a socket have the same command, but for the error of the visit: any cause that changes fast with the command
    explains this error.
    """
    if dataset.readings is None:
        return np.zeros(len(dataset), dtype=bool)
    sockets = [i for i, table in enumerate(dataset.readings.tables) if isinstance(table, SocketTable)]
    return np.isin(dataset.readings.of, sockets)


def _free(hypotheses: HypothesisSet, guess: Explanation) -> int:
    """Number of the coefficients and periods of those causes of a model that have several periods.

    So many periods fit gross errors of single numbers, whatever was read: they explain as many readings as they have free
    numbers. A pose has more numbers, and its gross errors are not explained so easily.
    """
    several = [cause for cause in causes(guess) if cause.further]
    return sum(hypotheses.groups.width(cause) + len(cause.values) for cause in several)


def _evenly(rows: npt.NDArray[np.intp], most: int) -> npt.NDArray[np.intp]:
    """At most ``most`` of the rows, evenly spread."""
    if len(rows) <= most:
        return rows
    return np.asarray(rows[np.linspace(0, len(rows) - 1, most).astype(int)])


def _predicted(hypotheses: HypothesisSet, model: Explanation) -> Mask:
    """(N,) whether a model fitted to all other poses predicts a pose far better than geometry alone does.

    A search can also explain gross errors, each by a separate term, but such a term does not predict other poses.
    """
    design = hypotheses.design
    row = design.measured.rows.row
    each = [row == number for number in range(int(row.max()) + 1)]
    columns = np.hstack([hypotheses.groups.columns(term) * s for term, s in scales(model).items()])
    alone, whole = (
        np.bincount(row, (leave_out(design, some, each).errors ** 2).sum(axis=1)) for some in (columns[:, :0], columns)
    )
    return np.asarray((whole < hypotheses.priors.readmitted_left * alone)[row])
