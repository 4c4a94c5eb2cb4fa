"""Columns with unknown names: kept if they contain numbers, omitted if they contain words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.data.cells import is_missing, numbers
from gtpin.typing import Floats


def numbers_or_words(cells: Sequence[str]) -> Floats | int | None:
    """Read a column of any kind.

    Gives its numbers. Where most cells that are not empty are numbers, but not all: the index of the first that is not a
    number. None for a column of words or of empty cells.
    """
    values = numbers(cells)
    bad = np.isnan(values)
    if not bad.any():
        return values
    missing = sum(is_missing(cell) for cell, is_bad in zip(cells, bad, strict=True) if is_bad)
    words, numeric = int(bad.sum()) - missing, int((~bad).sum())
    blank = all(not cell.strip() for cell in cells)
    if blank or (words > 0 and words >= numeric):
        return None
    return int(np.flatnonzero(bad)[0])
