"""The commands of a G-code file of RepRapFirmware, and whether they are always carried out.

Since version 3 the firmware has conditions and loops (``if``, ``elif``, ``else``, ``while``): the lines below one that are
indented more than it are its block. Numbers may be expressions in braces. Both depend on the machine's state, which is in no
file. See https://docs.duet3d.com/en/User_manual/Reference/Gcode_meta_commands.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from gtpin.errors import DatasetError
from gtpin.importers.lines import text_lines

_BLOCK = re.compile(r"\s*(if|elif|else|while)\b", re.IGNORECASE)


def gcode_commands(file: Path, command: re.Pattern[str]) -> Iterator[tuple[int, re.Match[str]]]:
    """Give the number and the match of each line that begins with a command; comments after ``;`` are cut off.

    Raises
    ------
    DatasetError
        If a command is in the block of a condition or of a loop, or has an expression: only the firmware knows which commands
        it carries out, and with which numbers.
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
