"""Arrays of a dataset are checked here once, made read-only, and not checked again."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gtpin.data.ids import Ids, codes, normal_ids
from gtpin.data.names import check_covariate_name, command_names, is_approach
from gtpin.data.table import Column
from gtpin.errors import DatasetError
from gtpin.typing import Floats

_NORM_TOLERANCE = 1e-3
"""Largest deviation of a quaternion's norm from 1. Assumed."""
_SAME_COMMAND = 1e-12
"""Largest difference, m or rad, of two commands that count as the same. Assumed."""
LARGEST = 1e30
"""Largest value of a covariate: its tenth power is still a finite number, and no effect uses more than the fourth power."""


def unnumbered() -> NDArray[np.int64]:
    """An empty array: line numbers of rows that were not read from a file. `Rows.of` numbers them."""
    return np.empty(0, dtype=np.int64)


def frozen(array: Column) -> Column:
    """Give a copy that can't be written to."""
    array = array.copy()
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class CheckedRows:
    """File and lines, (N,), of N rows; its checks raise errors that name the file and line of the row."""

    file: Path | None
    line: NDArray[np.int64]

    @classmethod
    def of(cls, file: Path | None, line: NDArray[np.int64], length: int) -> CheckedRows:
        """Take the lines given or, where none are, number rows as in a file with a header: 2, 3, ..."""
        if length == 0:
            raise DatasetError("no rows", file=file, hint="at least one is needed")
        lines = np.asarray(line) if np.size(line) else np.arange(2, length + 2)
        if lines.shape != (length,) or lines.dtype.kind not in "iu":
            raise DatasetError(f"row must hold one line number for each of {length} rows", file=file)
        return cls(file, frozen(lines.astype(np.int64)))

    def error(self, index: int, column: str, what: str, hint: str) -> DatasetError:
        """Build the error for the i-th row."""
        return DatasetError(what, file=self.file, row=int(self.line[index]), column=column, hint=hint)

    def ids(self, values: ArrayLike, name: str) -> Ids:
        """Check N ids and spell them in their normal form."""
        array = np.asarray(values, dtype=object)
        if array.shape != self.line.shape:
            raise DatasetError(f"needs one id for each of {len(self.line)} rows", file=self.file, column=name)
        result = normal_ids(array, name, self.file, self.line)
        result.setflags(write=False)
        return result

    def floats(self, values: ArrayLike, names: list[str]) -> Floats:
        """Check N finite numbers, or N x len(names) of them where there are several names."""
        shape = (len(self.line),) if len(names) == 1 else (len(self.line), len(names))
        try:
            array = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise DatasetError("not numbers", file=self.file, column=names[0]) from None
        if array.shape != shape:
            what = f"needs an array of shape {shape}, got {array.shape}"
            raise DatasetError(what, file=self.file, column=names[0])
        bad = np.argwhere(~np.isfinite(array))
        if len(bad):
            column = names[bad[0][1] if len(names) > 1 else 0]
            raise self.error(bad[0][0], column, "not a finite number", "leave the row out")
        return frozen(array)

    def commands(self, values: ArrayLike) -> Floats:
        """Check the commands, (N, n) with n >= 1."""
        array = np.asarray(values)
        if array.ndim != 2 or array.shape[1] < 1:
            raise DatasetError(f"commands need the shape (N, n), got {array.shape}", file=self.file, column="q1")
        names = command_names(array.shape[1])
        return self.floats(array if len(names) > 1 else array[:, 0], names).reshape(array.shape)

    def quaternions(self, values: ArrayLike) -> Floats:
        """Check and normalise wxyz quaternions, (N, 4)."""
        array = self.floats(values, ["qw", "qx", "qy", "qz"])
        with np.errstate(over="ignore"):
            norm = np.linalg.norm(array, axis=1)
        off = np.flatnonzero(~(np.abs(norm - 1.0) <= _NORM_TOLERANCE))
        if len(off):
            what = f"the quaternion's norm is {norm[off[0]]:.6g}, not 1"
            raise self.error(off[0], "qw qx qy qz", what, "write unit quaternions, or correct or leave out the row")
        # A quaternion that is normal already keeps its bits, so that writing and reading change nothing.
        norm[np.abs(norm - 1.0) < 1e-14] = 1.0
        return frozen(array / norm[:, None])

    def covariates(
        self, values: Mapping[str, ArrayLike], n_actuators: int, taken: re.Pattern[str]
    ) -> dict[str, Column]:
        """Check covariates by name: sessions are ids, everything else N finite numbers. No name may match ``taken``."""
        result: dict[str, Column] = {}
        for name, column in values.items():
            try:
                check_covariate_name(name, n_actuators, taken)
            except DatasetError as error:
                raise DatasetError(error.what, file=self.file, row=1, column=error.column, hint=error.hint) from None
            result[name] = self.ids(column, name) if name == "session" else self.floats(column, [name])
            if name != "session":
                self._each(np.abs(result[name]) <= LARGEST, name, result[name], f"give a number up to {LARGEST:g}")
            if name == "payload":
                self._each(result[name] >= 0.0, name, result[name], "a payload is a mass in kg, 0 or more")
            if is_approach(name):
                self._each(np.abs(result[name]) == 1.0, name, result[name], "it must be +1 or -1")
        return result

    def same_commands(self, pose: Ids, q: Floats) -> None:
        """Raise `DatasetError` where rows that share a pose id differ in their commands."""
        visit, _ = codes(pose)
        _, first = np.unique(visit, return_index=True)
        with np.errstate(over="ignore"):
            apart = np.abs(q - q[first[visit]])
        index, column = np.unravel_index(np.argmax(apart > _SAME_COMMAND), apart.shape)
        if apart[index, column] > _SAME_COMMAND:
            what = f"pose {pose[index]} has other commands here than in row {self.line[first[visit[index]]]}"
            hint = "rows that share a pose id are visits to the same commands; give each pose an id of its own"
            raise self.error(int(index), f"q{column + 1}", what, hint)

    def _each(self, good: NDArray[np.bool_], name: str, values: Column, hint: str) -> None:
        if not good.all():
            index = int(np.argmin(good))
            raise self.error(index, name, f"{values[index]:.6g} can't be", hint)
