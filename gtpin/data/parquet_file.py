"""Reading Parquet, to the same table as the CSV with the same columns."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from gtpin.data.ids import normal_ids
from gtpin.data.names import kind_of
from gtpin.data.table import Column, DataTable, bad_cell, check_header, numbers_or_words
from gtpin.errors import DatasetError
from gtpin.typing import Floats


def read_parquet(file: Path, data: bytes, ignore: Collection[str] = (), ids: Collection[str] = ()) -> DataTable:
    """Read the bytes of a Parquet file; rows are numbered as in a CSV, the first is 2.

    Numbers may be integers, floats, decimals or text that spells them. Raises `DatasetError` like `read_csv`.
    """
    try:
        table = pa.parquet.read_table(pa.BufferReader(data))
        names = table.column_names  # names are decoded only here; damaged ones are not UTF-8
        # pandas keeps an index that is no plain range as a column of this name.
        table = table.select([i for i, name in enumerate(names) if not name.startswith("__index_level_")])
    except (pa.ArrowException, OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise DatasetError(f"not a Parquet file that can be read ({reason})", file=file, hint="write it anew") from None
    names = table.column_names
    check_header(names, file)
    if table.num_rows == 0:
        raise DatasetError("no rows", file=file, hint="it needs at least one")
    columns: dict[str, Column] = {}
    for name in names:
        if name in ignore:
            continue
        if kind_of(name) == "id" or name in ids:
            cells = (None if value is None else str(value) for value in _values(table[name]))
            columns[name] = normal_ids(cells, name, file, range(2, table.num_rows + 2))
            continue
        found: Floats | int | None = _floats(table[name])
        if found is None:
            found = numbers_or_words(_texts(table[name]))
        if found is None and kind_of(name) == "any":
            continue
        if found is None or isinstance(found, int):
            index = found or 0
            row = [_texts(table[other].slice(index, 1))[0] for other in names]
            raise bad_cell(file, names, row, names.index(name), index + 2)
        columns[name] = found
    return DataTable(file, tuple(names), np.arange(2, table.num_rows + 2), columns)


def _floats(column: pa.ChunkedArray) -> Floats | None:
    """Give a column of plain finite numbers as float64; None for any other."""
    kind = column.type
    if column.null_count or not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)):
        return None
    values = np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
    return values if np.isfinite(values).all() else None


def _texts(column: pa.ChunkedArray) -> list[str]:
    return ["" if value is None else str(value) for value in _values(column)]


def _values(column: pa.ChunkedArray) -> list[object]:
    try:
        values: list[object] = column.to_pylist()
    except (pa.ArrowException, ValueError, OverflowError):
        # Times outside the range of Python's datetime: such a column counts as words.
        return ["?"] * len(column)
    return values
