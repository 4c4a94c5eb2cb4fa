"""Poses that a calibration took for gross errors, given back where a cause explains them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.hypotheses.propose import make_pool
from gtpin.diagnosis.inference.decide import rough_guess
from gtpin.diagnosis.inference.joint_fit import Observed
from gtpin.diagnosis.linear.cross_validation import leave_out
from gtpin.diagnosis.linear.evidence import Posterior

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
        (N,) rows that the calibration kept, or set aside and a cause explains; and (N,) those that it kept.
    """
    sure = baseline.used(dataset)
    suspects = np.flatnonzero(~sure)
    suspects = suspects[baseline.model.kinematics.forward(dataset.q[suspects]).reached]
    if len(suspects) < FEWEST:
        return sure, sure
    explained = np.zeros(len(dataset), dtype=bool)
    # Of many poses, an even part of those that were kept, and all that were set aside, some at a time.
    most = len(suspects) if len(dataset) <= MOST_POSES else MOST_POSES // 2
    parts = np.array_split(suspects, -(-len(suspects) // most))
    kept = _evenly(np.flatnonzero(sure), MOST_POSES - len(parts[0]))
    for some in parts:
        rows = np.sort(np.concatenate([kept, some]))
        design = Observed.of(dataset.take(rows), baseline).design(baseline.model)
        pool, _ = make_pool(design, exclude, false_alarm)
        guess = rough_guess(pool)
        if any(name not in pool.free for name in guess.names):
            explained[rows] |= _foretold(pool, guess)
        explained &= ~sure
        if explained[some].sum() < max(FEWEST, LEAST_SHARE * len(some)):
            return sure, sure
    return sure | explained, sure


def _evenly(rows: npt.NDArray[np.intp], most: int) -> npt.NDArray[np.intp]:
    """At most so many of the rows, evenly spread."""
    if len(rows) <= most:
        return rows
    return np.asarray(rows[np.linspace(0, len(rows) - 1, most).astype(int)])


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
