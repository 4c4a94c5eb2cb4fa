"""Poses that a calibration took for gross errors, given back where a cause explains them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.data.ids import among
from gtpin.diagnosis.decide import rough_guess
from gtpin.diagnosis.evidence import Posterior
from gtpin.diagnosis.fit import Observed
from gtpin.diagnosis.pool import Pool
from gtpin.diagnosis.shrinkage import leave_out
from gtpin.diagnosis.testable import make_pool

Mask = npt.NDArray[np.bool_]

MOST_POSES = 3000
"""Poses that a search is made on; more make it slower, and hardly surer. The causes are then fitted to all."""
FEWEST = 3
"""Poses, set aside, that something must explain before they are believed: one or two can be explained by chance."""
LEAST_SHARE = 0.5
"""Share of the poses set aside that something must explain before it is believed."""
LEFT = 0.25
"""Share of a squared error that may be left of what is explained."""


def believed(
    dataset: Dataset, baseline: Calibration, exclude: Collection[str], false_alarm: float
) -> tuple[Mask, Mask]:
    """Poses to search on.

    A cause that shows in a few poses alone (play whose force seldom changes its sign, a step near a track's end) looks like
    gross errors beside geometry. Beside the cause it does not.

    Returns
    -------
    believable, sure
        (N,) poses that the calibration kept, or set aside and a cause explains; and (N,) those that it kept. Of more than
        ``MOST_POSES`` the same.
    """
    sure = ~among(dataset.pose, baseline.rejected)
    if len(dataset) > MOST_POSES:
        return sure, sure
    suspects = ~sure & baseline.model.kinematics.forward(dataset.q).reached
    if suspects.sum() < FEWEST:
        return sure, sure
    rows = np.flatnonzero(sure | suspects)
    design = Observed.of(dataset.take(rows), baseline).design(baseline.model)
    pool, _ = make_pool(design, exclude, false_alarm)
    guess = rough_guess(pool)
    explained = np.zeros(len(dataset), dtype=bool)
    if any(name not in pool.free for name in guess.names):
        explained[rows] = _foretold(pool, guess)
        explained &= suspects
    if explained.sum() < max(FEWEST, LEAST_SHARE * suspects.sum()):
        return sure, sure
    return sure | explained, sure


def _foretold(pool: Pool, model: Posterior) -> Mask:
    """(N,) poses that a model fitted to all the others foretells far better than geometry alone does.

    A search explains gross errors as well, each by something of its own; but nothing foretells them.
    """
    design = pool.design
    poses = len(design.whitening)
    each = list(np.eye(poses, dtype=bool))
    columns = np.hstack([pool.groups.columns[n] * s for n, s in zip(model.names, model.scale, strict=True)])
    alone, whole = (leave_out(design, causes, each).errors for causes in (columns[:, :0], columns))
    return np.asarray((whole**2).sum(axis=1) < LEFT * (alone**2).sum(axis=1))
