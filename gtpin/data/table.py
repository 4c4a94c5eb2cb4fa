"""A table as it was read: its columns as arrays, and the line in the file of each row."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtpin.data.cells import number
from gtpin.data.names import is_command
from gtpin.errors import DatasetError
from gtpin.typing import Floats

Column = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Table:
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
        raise DatasetError(
            "the first line holds numbers, not names", file=file, row=1, hint="put a header line above it"
        )
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
