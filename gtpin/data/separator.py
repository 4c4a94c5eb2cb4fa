"""Tables whose columns are not separated by commas, as many European spreadsheets write them; recognised by their header."""

from __future__ import annotations

from pathlib import Path

from gtpin.errors import DatasetError

_OTHERS = {";": "';'", "\t": "tabs"}


def check_separator(header: str, file: Path) -> None:
    """Raise `DatasetError` for a header line that is separated by anything but commas."""
    line = header.strip()
    words = [word for other, word in _OTHERS.items() if line.count(other) > line.count(",")]
    if "," not in line and " " in line:  # with commas present, spaces are parts of names
        words.append("spaces")
    if words:
        hint = "save with ',' between columns and '.' in numbers"
        raise DatasetError(f"the columns are separated by {words[0]}", file=file, row=1, hint=hint)
