"""Columns of covariates that were filled in with a constant and not recorded."""

from __future__ import annotations

import re

import numpy as np

from gtpin.data import Dataset
from gtpin.errors import warn

_NEVER_CONSTANT = re.compile(r"approach[0-9]+|time|temp_.*")
"""Columns that vary wherever they are recorded: a constant is a default value."""
_SPEED = re.compile(r"speed[0-9]+")
"""A speed of 0 everywhere says that the machine stood still. Any other recorded speed varies in the last digit."""


def without_filled_in(dataset: Dataset) -> Dataset:
    """The dataset without constant columns that were probably filled in and not recorded: they count as missing.

    A recorded covariate that does not vary excludes its effects. A constant that somebody filled in would exclude them wrongly.
    Constant payloads, forces and sessions, and speeds of 0, are usual statements about a measurement, and are kept.

    Warns
    -----
    GtpinWarning
        Names the columns.
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
