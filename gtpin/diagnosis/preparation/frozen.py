"""Temperatures that are constant to the last digit in a sequence of rows, and vary in the other rows."""

from __future__ import annotations

import numpy as np

from gtpin.data import Dataset
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.errors import warn
from gtpin.typing import Floats


def without_frozen(dataset: Dataset, priors: Priors = PRIORS) -> Dataset:
    """The dataset without temperatures that are constant to the last digit in a sequence of rows: they count as missing.

    Readings of a working thermometer differ from row to row. A logger that repeats its last value, begins late or was read at
    another time gives such a sequence. Readings in coarse steps are not judged.

    Warns
    -----
    GtpinWarning
        Names the columns and the rows.
    """
    order = np.argsort(dataset.covariates["time"], kind="stable") if "time" in dataset.covariates else slice(None)
    frozen = []
    for name in sorted(n for n in dataset.covariates if n.startswith("temp_")):
        values = np.asarray(dataset.covariates[name], dtype=float)[order]
        first, length = _longest_stretch(values)
        others = np.delete(values, np.s_[first : first + length])
        if length < max(priors.fewest_moving, priors.frozen * len(values)) or not len(others):
            continue
        if len(np.unique(others)) < priors.distinct * len(others):
            continue
        frozen.append(name)
        lines = dataset.row[order][first : first + length]
        text = (
            f"{name} is {values[first]:g} in {length} rows one after the other (line {lines[0]} to line {lines[-1]}) and "
            "differs in all others: it was not read there, so that it is not used"
        )
        warn(f"{dataset.file}: {text}" if dataset.file else text)
    return dataset.without(frozen) if frozen else dataset


def _longest_stretch(values: Floats) -> tuple[int, int]:
    """First index and length of the longest sequence of equal values."""
    begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    lengths = np.diff(begins, append=len(values))
    longest = int(np.argmax(lengths))
    return int(begins[longest]), int(lengths[longest])
