"""Positions that were rounded more coarsely than the instrument's noise: the rounding is noise as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtpin.data.dataset import Dataset
from gtpin.errors import warn
from gtpin.typing import Floats

STEPS = (1e-2, 5e-3, 1e-3, 5e-4, 1e-4, 5e-5, 1e-5)
"""Steps that positions are rounded to, m, the coarsest first."""
FEWEST = 10
"""Fewest rows from which it is not due to chance that all are multiples of a step. Assumed."""
EXACT = 1e-6
"""Share of a step by which a number may differ from a multiple of it: binary numbers don't represent decimals exactly."""
FARTHEST = 1e3
"""Coordinate, m, beyond which a position is a gross error, whose digits are not used. Assumed."""
MATTERS = 1.05
"""Factor by which rounding must increase the noise to be taken into account. Assumed."""


def with_rounding(dataset: Dataset) -> Dataset:
    """The dataset with the rounding error added to the declared noise of positions.

    Rounding to a step d is an error uniform over d, of standard deviation d / sqrt(12). Undeclared noise is estimated from
    the data, and includes it already.

    Warns: where rounding makes the noise larger than what is declared.
    """
    step, declared = rounded_to(dataset), dataset.instrument.position_sigma
    if step is None or declared is None:
        return dataset
    sigma = float(np.hypot(declared, step / np.sqrt(12.0)))
    if sigma < MATTERS * declared:
        return dataset
    text = (
        f"positions are rounded to {1e3 * step:g} mm: with it their noise is {sigma:.2g} m, more than the {declared:.2g} m "
        "that are declared, and is used; export more digits"
    )
    warn(f"{dataset.file}: {text}" if dataset.file else text)
    return replace(dataset, instrument=dataset.instrument.model_copy(update={"position_sigma": sigma}))


def rounded_to(dataset: Dataset) -> float | None:
    """The coarsest step, m, that all positions are multiples of; None where there is none."""
    return coarsest_step(dataset.position, STEPS)


def coarsest_step(values: Floats, steps: Sequence[float]) -> float | None:
    """The first of some steps that all values (N, k) are multiples of; None where there is none, or there are few rows."""
    near = values[(np.abs(values) < FARTHEST).all(axis=1)]
    if len(near) < FEWEST:
        return None
    for step in steps:
        counts = near / step
        if np.abs(counts - np.round(counts)).max() < EXACT:
            return step
    return None
