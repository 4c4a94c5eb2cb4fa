"""The gap in words: position errors of poses, or errors of each instrument's readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.report.words import joined, length, quantity


@dataclass(frozen=True)
class GapWords:
    """The quantity whose errors are given, and these errors on left-out data with units: before and after causes were added,
    and of noise alone."""

    what: str
    before: str
    after: str
    floor: str


def gap_words(gap: Gap) -> GapWords:
    """The gap in words."""
    if not gap.by_instrument:
        return GapWords("position error", length(gap.before), length(gap.after), length(gap.floor))

    def of(values: list[float]) -> str:
        named = len(gap.by_instrument) > 1
        return joined(
            [
                f"{quantity(value, one.unit)}{f' ({one.name})' if named else ''}"
                for one, value in zip(gap.by_instrument, values, strict=True)
            ]
        )

    names = joined([one.name for one in gap.by_instrument])
    return GapWords(
        f"error of the readings of {names}",
        of([one.before for one in gap.by_instrument]),
        of([one.after for one in gap.by_instrument]),
        of([one.floor for one in gap.by_instrument]),
    )


def beyond(gap: Gap) -> str:
    """What is left beyond the noise floor with the causes, sqrt(after^2 - floor^2), with units; for each instrument."""
    if not gap.by_instrument:
        return length(float(np.sqrt(max(gap.after**2 - gap.floor**2, 0.0))))
    parts = [
        (one.name, quantity(float(np.sqrt(max(one.after**2 - one.floor**2, 0.0))), one.unit))
        for one in gap.by_instrument
    ]
    return joined([f"{size} ({name})" if len(parts) > 1 else size for name, size in parts])


def beyond_noise(gap: Gap) -> str:
    """What goes away with the causes, in lengths, where the gap beyond noise is smaller than noise; empty otherwise.

    A fraction of such a gap says little. The gap beyond noise is g = sqrt(before^2 - floor^2); with a fraction f of its power
    explained, g (1 - sqrt(1 - f)) of it goes away.
    """
    power = gap.before**2 - gap.floor**2
    if gap.by_instrument or gap.interval is None or not 0.0 < power < gap.floor**2:
        return ""
    size = float(np.sqrt(power))
    low, high = (length(size * float(1.0 - np.sqrt(1.0 - np.clip(share, 0.0, 1.0)))) for share in gap.interval)
    return f"Beyond noise the gap is {length(size)}, of which {low} to {high} go away (95 %)."
