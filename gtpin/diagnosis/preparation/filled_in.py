"""Covariates that the data hold, but that were filled in and not recorded."""

from __future__ import annotations

import re

import numpy as np

from gtpin.data import Dataset
from gtpin.errors import warn

_NEVER_CONSTANT = re.compile(r"approach[0-9]+|time|temp_.*")
"""Drives come to rest from either side, clocks run, and thermometers vary in the last digit: a constant is a default."""
_SPEED = re.compile(r"speed[0-9]+")
"""A speed of 0 everywhere says that the machine stood still; any other one can't be equal to the last digit at all poses."""


def without_filled_in(dataset: Dataset) -> Dataset:
    """The dataset without columns that are constant and can't have been recorded so: they count as missing.

    A covariate that was recorded and does not vary rules its effects out. One that somebody filled in hides them. Constant
    payloads and forces (a load that is never changed, or none), speeds of 0 (it stands still) and sessions (one set-up) are
    what people state of a measurement, and are kept.

    Warns
    -----
    GtpinWarning
        Of the columns.
    """
    constant = [name for name, values in dataset.covariates.items() if len(values) > 1 and (values == values[0]).all()]
    filled = [name for name in constant if _filled_in(name, dataset)]
    if not filled:
        return dataset
    text = f"the same in every row, so taken as not recorded: {', '.join(filled)}"
    warn(f"{dataset.file}: {text}" if dataset.file else text)
    return dataset.without(filled)


def _filled_in(name: str, dataset: Dataset) -> bool:
    if _NEVER_CONSTANT.fullmatch(name):
        return True
    return bool(_SPEED.fullmatch(name)) and float(np.asarray(dataset.covariates[name], dtype=float)[0]) != 0.0
