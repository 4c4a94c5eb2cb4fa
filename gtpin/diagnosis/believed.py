"""Poses that a calibration took for gross errors, given back where a cause explains them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.decide import rough_guess
from gtpin.diagnosis.fit import Observed
from gtpin.diagnosis.noise import gross_errors
from gtpin.diagnosis.testable import make_pool
from gtpin.errors import GtpinError

MOST_POSES = 3000
"""Poses that a search is made on; more make it slower, and hardly surer. The causes are then fitted to all."""
FEWEST = 3
"""Poses, set aside, that something must explain before they are believed: one or two can be explained by chance."""
LEAST_SHARE = 0.5
"""Share of the poses set aside that something must explain before it is believed."""


def believed(
    dataset: Dataset, baseline: Calibration, exclude: Collection[str], false_alarm: float
) -> npt.NDArray[np.bool_]:
    """(N,) poses to search on: those that the calibration kept, and those that it set aside and a cause explains.

    A cause that shows in a few poses alone (play whose force seldom changes its sign, a step near a track's end) looks like
    gross errors beside geometry. Beside the cause it does not. Datasets of more than ``MOST_POSES`` keep what the
    calibration kept.
    """
    aside = np.isin(dataset.pose.astype(str), baseline.rejected)
    if aside.sum() < FEWEST or len(dataset) > MOST_POSES:
        return ~aside
    try:
        design = Observed.of(dataset, baseline).design(baseline.model)
    except GtpinError:  # some pose can't be reached: its command is wrong
        return ~aside
    pool, _ = make_pool(design, exclude, false_alarm)
    guess = rough_guess(pool)
    explained = aside & ~gross_errors(pool, guess)
    if explained.sum() < max(FEWEST, LEAST_SHARE * aside.sum()):
        return ~aside
    return np.asarray(~aside | explained)
