"""A table as it was read: its cells, its columns as arrays, and the line in the file of each row."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtpin.data.names import ORIENTATION, command_names, is_command, kind_of, lookalike_words, lookalikes
from gtpin.errors import DatasetError, warn
from gtpin.typing import Floats

_MISSING = {"", "na", "n/a", "nan", "<na>", "null", "none", "-"}
_INFINITE = {"inf", "infinity"}
_HABITS = (
    (re.compile(r"(?<=[0-9.])[dD](?=[+-]?[0-9])"), "e", "write the exponent with E, not with D"),
    (re.compile("[\u2212\u2013]"), "-", "write minus as -, the sign on the keyboard"),
    (re.compile(","), ".", "write a decimal point, not a comma"),
)
"""Numbers as other programs write them: what to replace, by what, and the hint."""
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


def _habit(text: str) -> str | None:
    """The hint for a number that is written as by another program; None for what is none."""
    written = ((h, wrong.sub(right, text, 1)) for wrong, right, h in _HABITS if wrong.search(text))
    return next((h for h, plain in written if not math.isnan(number(plain))), None)


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
    if row == 2 and len(words) == numbers and units and not any(map(_habit, units)):
        what = "the line under the header has no numbers and looks like a line of units"
        return DatasetError(what, file=file, row=row, hint="delete it; the units are m, rad, s, kg, N and degC")
    if not text:
        what, hint = "the cell is blank", "fill it in, or leave the row out"
    elif is_missing(text) or _HUGE.fullmatch(text):
        what, hint = f"{cells[column][:40]!r} is not a finite number", "fill it in, or leave the row out"
    else:
        what = f"{cells[column][:40]!r} is not a number"
        hint = _habit(text) or "write a plain number in SI units, without its unit"
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


Column = NDArray[Any]


@dataclass(frozen=True, eq=False)
class DataTable:
    """Columns of one file: ids as `str`, every other column as finite float64.

    Columns of words are in `names` but not in `columns`.
    """

    file: Path
    names: tuple[str, ...]
    row: NDArray[np.int64]
    columns: Mapping[str, Column]

    def __len__(self) -> int:
        return len(self.row)

    def column(self, name: str) -> Column:
        """Give one column, (N,); raises `DatasetError` where it is missing, with a likely reason."""
        if name not in self.columns:
            if name in self.names:
                hint = "write plain numbers in SI units, without their unit"
                raise DatasetError("the column holds no numbers", file=self.file, row=1, column=name, hint=hint)
            raise DatasetError("the column is missing", file=self.file, row=1, column=name, hint=self._why(name))
        return self.columns[name]

    def matrix(self, names: Sequence[str]) -> Floats:
        """Give several columns side by side, (N, len(names))."""
        return np.column_stack([self.column(name) for name in names])

    def commands(self) -> Floats:
        """Give q1 .. qn, (N, n); raises `DatasetError` for a gap in the numbers or none at all."""
        found = sum(is_command(name) for name in self.names)
        return self.matrix(command_names(max(found, 1)))

    def orientation(self) -> Floats | None:
        """Give qw qx qy qz, (N, 4); None where all four are missing, `DatasetError` where some are."""
        missing = [name for name in ORIENTATION if name not in self.names]
        if len(missing) == 4:
            return None
        if missing:
            hint = "give all of qw qx qy qz, or none where only positions were measured"
            raise DatasetError("the column is missing", file=self.file, row=1, column=missing[0], hint=hint)
        return self.matrix(ORIENTATION)

    def covariates(self, taken: Collection[str]) -> dict[str, Column]:
        """Give all columns that are not taken, by name."""
        return {name: values for name, values in self.columns.items() if name not in taken}

    def warn_of_covariates(self, taken: Collection[str]) -> None:
        """Warn of columns that were left out because they hold words, and of names that look like a known one but differ."""
        names = [name for name in self.names if name not in taken]
        words = [name for name in names if name not in self.columns]
        if words:
            warn(f"{self.file}: {', '.join(words)}: no numbers, so no covariate; ignored")
        if alike := lookalikes(names):
            warn(f"{self.file}: {lookalike_words(alike)}")

    def _why(self, name: str) -> str:
        alike = [other for other in self.names if _plain(other) == _plain(name)]
        if alike:
            return f"there is {alike[0]!r}; names must match to the letter"
        if is_command(name) and (others := [other for other in self.names if is_command(other)]):
            return f"commands are numbered q1, q2, ... without a gap, and there are {', '.join(others[:12])}"
        shown = ", ".join(other[:30] for other in self.names[:30])
        return f"the file has {shown}" + (" and more" if len(self.names) > 30 else "")


def _plain(name: str) -> str:
    return re.sub(r"[\s_]", "", name).lower()


def check_header(names: Sequence[str], file: Path) -> None:
    """Raise `DatasetError` for a line that is no header, or a header with a column that is unnamed or there twice."""
    if not any(math.isnan(number(name)) for name in names):
        hint = "put a header line above it"
        raise DatasetError("the first line holds numbers, not names", file=file, row=1, hint=hint)
    seen: set[str] = set()
    for position, name in enumerate(names, 1):
        if not name.strip():
            hint = "name it, or write the table without it (pandas: to_csv(..., index=False))"
            raise DatasetError(f"column {position} of the table has no name", file=file, row=1, hint=hint)
        if not name.replace("\t", " ").isprintable():
            raise DatasetError("the column's name has unprintable characters", file=file, row=1, column=repr(name[:40]))
        if name in seen:
            raise DatasetError("the column is there twice", file=file, row=1, column=name, hint="keep one of them")
        seen.add(name)
