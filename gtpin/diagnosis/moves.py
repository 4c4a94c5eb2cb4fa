"""Directions of approach held against speeds: of columns that contradict each other, at least one is not what it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.data import Dataset
from gtpin.errors import warn

AGREE = 0.95
"""Share of the rows in motion whose direction of approach is that of the speed (or, by the other sign, is not), from which the
two columns agree. A drive that moves while it is measured comes from where its speed points away from: the rest are slips."""
FEWEST = 8
"""Rows in motion below which nothing is said: that many would agree, or disagree, by chance in 1 of 128 columns."""


def without_contradictions(dataset: Dataset) -> Dataset:
    """The dataset without ``approach`` and ``speed`` of actuators for which the two contradict each other.

    A direction of approach that belongs to other rows, or to another drive, makes backlash look like a lag behind the speed,
    and the reverse. Nothing tells which of the two columns is wrong, so both count as missing.

    Warns
    -----
    GtpinWarning
        Of the columns.
    """
    wrong: list[str] = []
    for actuator in range(1, dataset.n_actuators + 1):
        names = (f"approach{actuator}", f"speed{actuator}")
        if any(name not in dataset.covariates for name in names):
            continue
        approach, speed = (np.asarray(dataset.covariates[name], dtype=float) for name in names)
        moving = speed != 0.0
        if moving.sum() < FEWEST:
            continue
        same = float((np.sign(speed[moving]) == approach[moving]).mean())
        if 1.0 - AGREE < same < AGREE:
            wrong += names
            text = (
                f"{names[0]} and {names[1]} contradict each other in {100.0 * (1.0 - same):.0f} % of the rows in motion"
            )
            hint = "one of them belongs to other rows or another drive, so that neither is used"
            warn(f"{dataset.file}: {text}: {hint}" if dataset.file else f"{text}: {hint}")
    if not wrong:
        return dataset
    return replace(dataset, covariates={n: v for n, v in dataset.covariates.items() if n not in wrong})
