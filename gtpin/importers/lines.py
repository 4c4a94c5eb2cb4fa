"""The lines of a text file, and numbers in them; an error names the line that can't be read."""

from __future__ import annotations

import codecs
import math
from pathlib import Path

from gtpin.data.cells import is_missing, number
from gtpin.data.files import LARGEST_TEXT, read_bytes
from gtpin.errors import DatasetError

SHOWN = 40
"""Number of characters of a wrong text in an error message."""


def text_lines(file: Path) -> list[str]:
    """The lines of a text file in UTF-8, with or without BOM, any line ending; line i is element i - 1.

    Raises
    ------
    DatasetError
        If the file is missing, is no regular file, is larger than 100 MB, empty, no text, or not UTF-8.
    """
    data = read_bytes(file, most=LARGEST_TEXT).removeprefix(codecs.BOM_UTF8)
    if not data.strip():
        raise DatasetError("the file is empty", file=file, hint="export it again")
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise DatasetError("the file is UTF-16", file=file, hint="save it as UTF-8")
    if b"\0" in data:
        raise DatasetError("the file is not text", file=file, hint="give the text file that the program wrote")
    try:
        # Only these characters end a line. str.splitlines() would also split at form feeds and other control characters.
        return data.decode().replace("\r\n", "\n").replace("\r", "\n").split("\n")
    except UnicodeDecodeError as error:
        row = data[: error.start].count(b"\n") + 1
        raise DatasetError("the file is not UTF-8", file=file, row=row, hint="save it as UTF-8") from None


def decimal(
    text: str, file: Path, row: int, column: str | None = None, hint: str = "correct the row, or delete it"
) -> float:
    """Read a finite decimal number; raises `DatasetError` with its place and the hint where it is none."""
    value = number(text)
    if math.isnan(value):
        plain = text.strip()
        what = "the cell is blank" if not plain else f"{plain[:SHOWN]!r} is not a number"
        if plain and is_missing(plain):
            what = f"{plain[:SHOWN]!r} is not a finite number"
        raise DatasetError(what, file=file, row=row, column=column, hint=hint)
    return value


def decimals(texts: list[str], file: Path, row: int) -> list[float]:
    """Read several numbers, each as :func:`decimal` does. Errors count the columns from 1."""
    return [decimal(text, file, row, str(place)) for place, text in enumerate(texts, 1)]
