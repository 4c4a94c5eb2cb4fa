"""Reading CSV with Python's `csv`, to columns of ids and numbers; the first bad cell is named by its line and column."""

from __future__ import annotations

import codecs
import csv
import io
import re
from array import array
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from gtpin.data.ids import normal_ids
from gtpin.data.names import kind_of
from gtpin.data.table import Column, DataTable, bad_cell, check_header, numbers, numbers_or_words
from gtpin.errors import DatasetError

TOGETHER = 256
"""Rows that are turned into columns together."""

Row = tuple[int, list[str]]
"""The number of a line, from 1, and its cells."""


def read_csv(file: Path, data: bytes, ignore: Collection[str] = (), ids: Collection[str] = ()) -> DataTable:
    """Read the bytes of a CSV file: UTF-8 with or without BOM, any line ending, trailing blank lines.

    Columns in `ignore` are not looked at; those in `ids` hold ids, as `pose` does. Columns of words are left out. Raises
    `DatasetError` with the line and column of the first bad cell.
    """
    check_text(file, data, "give a table as CSV in UTF-8, with a header line and rows")
    header = next(_text(data)).rstrip("\n")
    _check_separator(header, file)
    _, names = next(_cells(file, iter([header])), (1, [""]))
    check_header(names, file)
    place = {name: column for column, name in enumerate(names) if name not in ignore}
    values = {name: array("d") for name in place if kind_of(name) == "number" and name not in ids}
    texts: dict[str, list[str]] = {name: [] for name in place if name not in values}
    lines = array("q")
    for chunk in _chunks(_rows(file, data, len(names))):
        lines.extend(line for line, _ in chunk)
        cells = list(zip(*(cells for _, cells in chunk), strict=True))
        found = {name: numbers(cells[place[name]]) for name in values}
        bad = [(int(np.argmax(np.isnan(v))), place[name]) for name, v in found.items() if np.isnan(v).any()]
        if bad:
            index, column = min(bad)
            raise bad_cell(file, names, chunk[index][1], column, chunk[index][0])
        for name, some in found.items():
            values[name].frombytes(some.tobytes())
        for name, text in texts.items():
            text.extend(cells[place[name]])
    if not lines:
        raise DatasetError("no rows under the header", file=file, hint="it needs at least one")
    columns: dict[str, Column] = {}
    for name in place:
        if name in values:
            columns[name] = np.array(values[name])
        elif kind_of(name) == "id" or name in ids:
            columns[name] = normal_ids(texts[name], name, file, lines)
        else:
            read = numbers_or_words(texts[name])
            if isinstance(read, int):
                row = next(row for row in _rows(file, data, len(names)) if row[0] == lines[read])
                raise bad_cell(file, names, row[1], place[name], row[0])
            if read is not None:
                columns[name] = read
    return DataTable(file, tuple(names), np.array(lines, dtype=np.int64), columns)


def check_text(file: Path, data: bytes, hint: str) -> None:
    """Raise `DatasetError` for the bytes of a file that are blank, or no text in UTF-8; ``hint``: what to give instead."""
    if not data.removeprefix(codecs.BOM_UTF8).strip():
        raise DatasetError("the file is empty", file=file, hint=hint)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise DatasetError("the file is UTF-16", file=file, hint="save it as UTF-8")
    at, what = data.find(b"\0"), "the file is not text"
    if at < 0 and not data.startswith((b"PK\x03\x04", b"PAR1", b"\x1f\x8b")):
        try:
            data.decode()
        except UnicodeDecodeError as error:
            at, what, hint = error.start, "the file is not UTF-8", "save it as UTF-8"
        else:
            return
    row = len(data[: at + 1].splitlines()) if at >= 0 else None
    raise DatasetError(what, file=file, row=row, hint=hint)


def _text(data: bytes) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig", newline=None)


def _cells(file: Path, lines: Iterator[str]) -> Iterator[Row]:
    """The cells of each line; raises `DatasetError` where a quoted cell continues in the next line or has text after it."""
    reader = csv.reader(lines, strict=True)
    row = 0
    try:
        for cells in reader:
            if reader.line_num > row + 1:
                raise csv.Error
            row += 1
            yield row, cells
    except csv.Error as error:
        what = "a quoted cell is not closed as it should be"
        hint = "close every quote on its own line; a row is one line"
        if "field limit" in str(error):
            what, hint = f"a cell has more than {csv.field_size_limit()} characters", "shorten it"
        raise DatasetError(what, file=file, row=row + 1, hint=hint) from None


def _rows(file: Path, data: bytes, width: int) -> Iterator[Row]:
    """The rows under the header without the blank lines between them."""
    for row, cells in _cells(file, _text(data)):
        if row == 1 or not cells or (len(cells) == 1 and not cells[0].strip()):
            continue
        if len(cells) != width:
            _refuse_remark(cells[0], file, row)
            hint = "give every row one cell for each column of the header"
            hint += ", and write a decimal point, not a comma" if len(cells) > width else ""
            raise DatasetError(f"the row has {len(cells)} cells, the header {width}", file=file, row=row, hint=hint)
        yield row, cells


def _chunks(rows: Iterator[Row]) -> Iterator[list[Row]]:
    """Lists of up to `TOGETHER` rows.

    Where a row can't be read, the rows before it come first, then its error: a bad number above that row is reported first.
    """
    chunk: list[Row] = []
    try:
        for row in rows:
            chunk.append(row)
            if len(chunk) == TOGETHER:
                yield chunk
                chunk = []
    except DatasetError:
        if chunk:
            yield chunk
        raise
    if chunk:
        yield chunk


def _refuse_remark(line: str, file: Path, row: int) -> None:
    """Raise `DatasetError` for a line that is no part of a table: a comment, or the separator, as Excel writes it."""
    if line.startswith("#"):
        hint = "a table begins with its column names and has no comments: delete the line, or the # before names"
        raise DatasetError("the line begins with #", file=file, row=row, hint=hint)
    if re.fullmatch(r'"?sep=.?"?,*', line, re.IGNORECASE):
        hint = "delete it: a table begins with its column names, with ',' between them"
        raise DatasetError("the line names the separator for Excel", file=file, row=row, hint=hint)


def _check_separator(header: str, file: Path) -> None:
    """Raise `DatasetError` for a header line that is separated by anything but commas."""
    line = header.strip()
    _refuse_remark(line, file, 1)
    words = [word for other, word in ((";", "';'"), ("\t", "tabs")) if line.count(other) > line.count(",")]
    if "," not in line and " " in line:  # with commas present, spaces are parts of names
        words.append("spaces")
    if words:
        hint = "save with ',' between columns and '.' in numbers"
        raise DatasetError(f"the columns are separated by {words[0]}", file=file, row=1, hint=hint)
