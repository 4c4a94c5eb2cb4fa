"""A table as it was read: its columns as arrays, and the line in the file of each row."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gtpin.data.cells import number
from gtpin.data.names import ORIENTATION, command_names, is_command, lookalikes
from gtpin.errors import DatasetError, warn
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
        alike = lookalikes(names)
        if alike:
            pairs = ", ".join(f"{name!r} is not {known!r}" for name, known in alike.items())
            warn(
                f"{self.file}: {pairs}: kept as covariates of their own, which no effect of gtpin's looks at; "
                "rename them if the known ones are meant"
            )

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
