"""The gap in words: position errors of poses, or errors of each instrument's readings."""

from __future__ import annotations

from dataclasses import dataclass

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
