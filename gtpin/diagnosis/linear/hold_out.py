"""Which poses are left out together when the gap is computed: neighbours, a session, an interval of time, or random poses."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset, by_region, random
from gtpin.errors import DatasetError, ModelError
from gtpin.typing import Mask

HoldOut = Literal["region", "session", "time", "random"]

TOGETHER = 4
"""Number of poses that are left out together, neighbours or drawn at random."""
STRETCHES = 10
"""Number of intervals of time that are left out in turn."""


def check_hold_out(dataset: Dataset, hold_out: str) -> None:
    """Check that a dataset can be split in this way.

    Raises `ModelError` if there is no such way to split. `DatasetError` if the column is missing, or has one value only.
    """
    if hold_out not in get_args(HoldOut):
        raise ModelError(f"no hold-out is called {hold_out!r}", hint=f"use {', '.join(get_args(HoldOut))}")
    if hold_out not in ("session", "time"):
        return
    hint = "hold out by region"
    if hold_out in dataset.unusable:
        raise DatasetError(f"the column can't be used to hold out by {hold_out}", column=hold_out, hint=hint)
    if hold_out not in dataset.covariates:
        raise DatasetError(f"there is no {hold_out} to hold out by", file=dataset.file, column=hold_out, hint=hint)
    if len(set(dataset.covariates[hold_out])) < 2:
        raise DatasetError(f"one {hold_out} only: it can't be held out", file=dataset.file, column=hold_out, hint=hint)


def blocks_of(dataset: Dataset, hold_out: HoldOut, rng: np.random.Generator) -> list[Mask]:
    """(N,) masks of the rows that are left out together, a partition.

    With ``region`` and ``random``, visits to one pose are in one block. With ``session`` and ``time`` they need not be: these
    blocks are to show how well another session or time is predicted.

    Raises `DatasetError` if the dataset can't be split in this way.
    """
    check_hold_out(dataset, hold_out)
    if hold_out == "session":
        return _by_value(np.asarray(dataset.covariates["session"]).astype(str))
    if hold_out == "time":
        return _by_value(_stretch(np.asarray(dataset.covariates["time"], dtype=float)))
    groups = max(2, (int(dataset.visits.max()) + 1) // TOGETHER)
    if hold_out == "random":
        return random(dataset, groups, int(rng.integers(2**32)))
    return by_region(dataset, groups)


def n_sessions(dataset: Dataset) -> int:
    """Number of different names in the column ``session``; 1 without this column."""
    return len(set(dataset.covariates["session"])) if "session" in dataset.covariates else 1


def _stretch(time: npt.NDArray[np.float64]) -> npt.NDArray[np.int_]:
    """(N,) index of each row's interval of time. Intervals have about equally many rows; rows of one instant stay together."""
    _, instant, count = np.unique(time, return_inverse=True, return_counts=True)
    earlier = np.cumsum(count) - count
    return np.asarray((earlier * STRETCHES // len(time))[instant])


def _by_value(values: npt.NDArray[np.generic]) -> list[Mask]:
    return [values == value for value in np.unique(values)]
