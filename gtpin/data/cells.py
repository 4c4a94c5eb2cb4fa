"""Cells of a table: reading numbers from text, words or numbers, and error messages for text that is not a number."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gtpin.data.names import kind_of
from gtpin.errors import DatasetError
from gtpin.typing import Floats

_MISSING = {"", "na", "n/a", "nan", "<na>", "null", "none", "-"}
_INFINITE = {"inf", "infinity"}
_HUGE = re.compile(r"[+-]?[0-9.]+[eE][+]?[0-9]+")


def number(text: str) -> float:
    """Read a decimal number; NaN if it is not a number, missing or not finite."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    # float() also accepts Python's 1_000 and digits of other scripts, which are not numbers in a table.
    return value if math.isfinite(value) and "_" not in text and text.isascii() else math.nan


def numbers(texts: Sequence[str]) -> Floats:
    """Read N numbers, (N,), each as :func:`number` does."""
    joined = "".join(texts)
    try:
        read = number if "_" in joined or not joined.isascii() else float
        values = np.fromiter(map(read, texts), np.float64, len(texts))
    except ValueError:
        values = np.fromiter(map(number, texts), np.float64, len(texts))
    values[~np.isfinite(values)] = np.nan
    return values


def is_missing(text: str) -> bool:
    """Whether a cell marks a missing or an infinite number, and is no other word."""
    plain = text.strip().lower()
    return plain in _MISSING or plain.lstrip("+-") in _INFINITE


def _has_decimal_comma(text: str) -> bool:
    return "," in text and not math.isnan(number(text.replace(",", ".", 1)))


def bad_cell(file: Path, names: Sequence[str], cells: Sequence[str], column: int, row: int) -> DatasetError:
    """Explain a cell that should have held a number, by what the rest of its row looks like."""
    text = cells[column].strip()
    words = [i for i, c in enumerate(cells) if kind_of(names[i]) == "number" and math.isnan(number(c))]
    numbers = sum(kind_of(name) == "number" for name in names)
    if [c.strip() for c in cells] == [name.strip() for name in names]:
        return DatasetError("a second header line", file=file, row=row, hint="delete this line")
    if all(not c.strip() for c in cells):
        return DatasetError("every cell of the row is blank", file=file, row=row, hint="delete this line")
    units = [c for c in (cells[i] for i in words) if not is_missing(c)]
    if row == 2 and len(words) == numbers and units and not any(_has_decimal_comma(c) for c in units):
        what = "the line under the header has no numbers and looks like a line of units"
        return DatasetError(what, file=file, row=row, hint="delete it; the units are m, rad, s, kg, N and degC")
    if not text:
        what, hint = "the cell is blank", "fill it in, or leave the row out"
    elif is_missing(text) or _HUGE.fullmatch(text):
        what, hint = f"{cells[column][:40]!r} is not a finite number", "fill it in, or leave the row out"
    elif _has_decimal_comma(text):
        what, hint = f"{cells[column][:40]!r} is not a number", "write a decimal point, not a comma"
    else:
        what, hint = f"{cells[column][:40]!r} is not a number", "write a plain number in SI units, without its unit"
    return DatasetError(what, file=file, row=row, column=names[column], hint=hint)


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
