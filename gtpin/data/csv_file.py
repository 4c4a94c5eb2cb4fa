"""Reading CSV: at once where the file is clean, line by line where it is not."""

from __future__ import annotations

import codecs
import csv
import io
import math
from array import array
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from gtpin.data.cells import bad_cell, number
from gtpin.data.ids import Ids, normal_id, normal_ids
from gtpin.data.names import kind_of
from gtpin.data.separator import check_separator
from gtpin.data.table import Column, Table, check_header
from gtpin.data.words import numbers_or_words
from gtpin.errors import DatasetError

THREADED = 1 << 24
"""Bytes from which on several threads read a table: each takes 64 MB of addresses, and a small table is read at once."""


def read_csv(file: Path, data: bytes, ignore: Collection[str] = ()) -> Table:
    """Read the bytes of a CSV file: UTF-8 with or without BOM, any line ending, trailing blank lines.

    Columns in `ignore` are not looked at. Raises `DatasetError` with the line and column of the first bad cell.
    Columns of words are left out.
    """
    _check_text(file, data)
    header = data[: _end_of_line(data)].decode("utf-8-sig")
    check_separator(header, file)
    names = _split(header, file, 1)
    check_header(names, file)
    wanted = [name for name in names if name not in ignore]
    return _at_once(file, data, names, wanted) or _line_by_line(file, data, names, wanted)


def _check_text(file: Path, data: bytes) -> None:
    if not data.removeprefix(codecs.BOM_UTF8).strip():
        raise DatasetError("the file is empty", file=file, hint="it needs a header line and rows")
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise DatasetError("the file is UTF-16", file=file, hint="save it as UTF-8")
    at = data.find(b"\0")
    if data.startswith((b"PK\x03\x04", b"PAR1", b"\x1f\x8b")) or at >= 0:
        row = _line_of(data, at) if at >= 0 else None
        raise DatasetError("the file is not text", file=file, row=row, hint="export it as CSV in UTF-8")
    if not data.isascii():
        try:
            data.decode()
        except UnicodeDecodeError as error:
            row = _line_of(data, error.start)
            raise DatasetError("the file is not UTF-8", file=file, row=row, hint="save it as UTF-8") from None


def _line_of(data: bytes, at: int) -> int:
    return len(data[: at + 1].splitlines())


def _end_of_line(data: bytes) -> int:
    ends = [end for end in (data.find(b"\n"), data.find(b"\r")) if end >= 0]
    return min(ends, default=len(data))


def _split(line: str, file: Path, row: int) -> list[str]:
    line = line.rstrip("\n")
    if '"' not in line:
        return line.split(",")
    try:
        return next(csv.reader([line], strict=True))
    except csv.Error:
        hint = "close every quote on its own line; a row is one line"
        raise DatasetError("a quoted cell is not closed as it should be", file=file, row=row, hint=hint) from None


def _at_once(file: Path, data: bytes, names: list[str], wanted: list[str]) -> Table | None:
    """Read a table in which nothing is out of the ordinary; None where anything is."""
    # In a single column a blank cell looks like a blank line; and Arrow is lenient about stray quotes.
    if len(names) == 1 or data.find(b'"', _end_of_line(data)) >= 0:
        return None
    types = {name: pa.string() if kind_of(name) == "id" else pa.float64() for name in names}
    try:
        table = pa.csv.read_csv(
            pa.BufferReader(data),
            read_options=pa.csv.ReadOptions(column_names=names, skip_rows=1, use_threads=len(data) > THREADED),
            convert_options=pa.csv.ConvertOptions(column_types=types, null_values=[], include_columns=wanted),
            memory_pool=pa.system_memory_pool(),  # Arrow's own takes a gigabyte of addresses at once
        )
    except pa.ArrowException:
        return None
    # Blank or broken lines in the middle would shift the line numbers.
    if table.num_rows == 0 or _count_lines(data) != table.num_rows + 1:
        return None
    columns: dict[str, Column] = {}
    for name in wanted:
        if kind_of(name) == "id":
            encoded = table[name].combine_chunks().dictionary_encode()
            try:
                ids = normal_ids(encoded.dictionary.to_pylist())
            except ValueError:
                return None
            columns[name] = ids[encoded.indices.to_numpy()]
        else:
            columns[name] = table[name].to_numpy()
            if not np.isfinite(columns[name]).all():
                return None
    return Table(file, tuple(names), np.arange(2, table.num_rows + 2), columns)


def _count_lines(data: bytes) -> int:
    end = len(data)
    while end and data[end - 1] in b"\r\n":
        end -= 1
    return data.count(b"\n", 0, end) + data.count(b"\r", 0, end) - data.count(b"\r\n", 0, end) + 1


def _line_by_line(file: Path, data: bytes, names: list[str], wanted: list[str]) -> Table:
    rows = array("q")
    numbers = {names.index(name): array("d") for name in wanted if kind_of(name) == "number"}
    texts: dict[int, list[str]] = {names.index(name): [] for name in wanted if kind_of(name) != "number"}
    for row, cells in _rows(file, data, len(names)):
        rows.append(row)
        for column, values in numbers.items():
            value = number(cells[column])
            if math.isnan(value):
                raise bad_cell(file, names, cells, column, row)
            values.append(value)
        for column, text in texts.items():
            text.append(cells[column])
    if not rows:
        raise DatasetError("no rows under the header", file=file, hint="it needs at least one")
    columns: dict[str, Column] = {}
    for column, name in enumerate(names):
        if column in numbers:
            columns[name] = np.array(numbers[column])
        elif column in texts and kind_of(name) == "id":
            columns[name] = _ids(file, name, texts[column], rows)
        elif column in texts:
            found = numbers_or_words(texts[column])
            if isinstance(found, int):
                raise bad_cell(file, names, _cells_at(file, data, len(names), rows[found]), column, rows[found])
            if found is not None:
                columns[name] = found
    return Table(file, tuple(names), np.array(rows, dtype=np.int64), columns)


def _rows(file: Path, data: bytes, width: int) -> Iterator[tuple[int, list[str]]]:
    lines = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig", newline=None)
    next(lines)
    for row, line in enumerate(lines, 2):
        if line.isspace():
            continue
        cells = _split(line, file, row)
        if len(cells) != width:
            hint = "give every row one cell for each column of the header"
            hint += ", and write a decimal point, not a comma" if len(cells) > width else ""
            what = f"the row has {len(cells)} cells, the header {width}"
            raise DatasetError(what, file=file, row=row, hint=hint)
        yield row, cells


def _cells_at(file: Path, data: bytes, width: int, row: int) -> list[str]:
    return next(cells for line, cells in _rows(file, data, width) if line == row)


def _ids(file: Path, name: str, texts: list[str], rows: array[int]) -> Ids:
    try:
        return normal_ids(texts)
    except ValueError as error:
        for text, row in zip(texts, rows, strict=True):
            try:
                normal_id(text)
            except ValueError:
                hint = f"give every row a {name}"
                raise DatasetError(str(error), file=file, row=row, column=name, hint=hint) from None
        raise
