"""The lines of a text file, numbers in them, and commands of G-code; an error names the line that can't be read."""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Iterator
from pathlib import Path

from gtpin.data.csv_file import check_text
from gtpin.data.files import LARGEST_TEXT, read_bytes
from gtpin.data.table import is_missing, number
from gtpin.errors import DatasetError

SHOWN = 40
"""Number of characters of a wrong text in an error message."""
_BLOCK = re.compile(r"\s*(if|elif|else|while)\b", re.IGNORECASE)


def text_lines(file: Path, *, may_be_empty: bool = False) -> list[str]:
    """The lines of a text file in UTF-8, with or without BOM, any line ending; line i is element i - 1.

    Raises `DatasetError` if the file is missing, is no regular file, is larger than 100 MB, no text, or not UTF-8; or if it is
    empty, unless it may be.
    """
    data = read_bytes(file, most=LARGEST_TEXT).removeprefix(codecs.BOM_UTF8)
    if data.strip() or not may_be_empty:
        check_text(file, data, "give the text file that the program wrote")
    # Only these characters end a line. str.splitlines() would also split at form feeds and other control characters.
    return data.decode().replace("\r\n", "\n").replace("\r", "\n").split("\n")


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


def gcode_commands(file: Path, command: re.Pattern[str]) -> Iterator[tuple[int, re.Match[str]]]:
    """Give the number and the match of each line that begins with a command; comments after ``;`` are cut off.

    Since version 3 RepRapFirmware has conditions and loops (``if``, ``elif``, ``else``, ``while``): the lines below one that
    are indented more than it are its block. Numbers may be expressions in braces. Both depend on the machine's state, which is
    in no file. See https://docs.duet3d.com/en/User_manual/Reference/Gcode_meta_commands.

    Raises `DatasetError` if a command is in the block of a condition or of a loop, or has an expression: only the firmware
    knows which commands it carries out, and with which numbers.
    """
    blocks: list[tuple[int, str]] = []  # indentation and word of the conditions that are open
    for row, line in enumerate(text_lines(file), 1):
        text = line.partition(";")[0].rstrip().expandtabs()
        if not text.strip():
            continue
        indent = len(text) - len(text.lstrip())
        while blocks and indent <= blocks[-1][0]:
            blocks.pop()
        if head := _BLOCK.match(text):
            blocks.append((indent, head[1].lower()))
            continue
        match = command.match(text)
        if match is None:
            continue
        if blocks:
            what = f"a command inside {blocks[-1][1]!r}, which only the firmware can decide"
            hint = "write the commands that were carried out, without conditions and loops"
            raise DatasetError(what, file=file, row=row, hint=hint)
        if "{" in text:
            hint = "write the numbers in place of what is in braces"
            raise DatasetError("an expression, which only the firmware can compute", file=file, row=row, hint=hint)
        yield row, match
