"""Klipper's configuration: sections and their options, each with the file and line that it was read from.

The form is that of Klipper's klippy/configfile.py: an INI file, comments after ``#`` and ``;``, options as ``name: value`` or
``name = value``, indented lines that continue a value, ``[include FILES]``, and at its end the lines that SAVE_CONFIG wrote,
each after ``#*#``. An option that is in both parts has the value of the first part (``_strip_duplicates`` in configfile.py).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gtpin.errors import DatasetError
from gtpin.importers.lines import decimal, text_lines

SAVED = "#*#"
DEEPEST = 8
"""Largest depth of includes; with more, a file is assumed to include itself."""

_SECTION = re.compile(r"\[([^\]]+)\]\s*([#;].*)?")
_OPTION = re.compile(r"([^:=\s\[#;][^:=]*?)\s*[:=](.*)")
_COMMENT = re.compile(r"(?:^|\s)[#;].*")


@dataclass(frozen=True)
class Line:
    """A line of a value: its text without comments, and where it was read."""

    text: str
    file: Path
    row: int


@dataclass(frozen=True)
class Option:
    """An option: its lines, the first of which may be blank."""

    name: str
    lines: tuple[Line, ...]

    @property
    def file(self) -> Path:
        """File of its first line."""
        return self.lines[0].file

    @property
    def row(self) -> int:
        """Number of its first line, from 1."""
        return self.lines[0].row

    @property
    def text(self) -> str:
        """Its lines, joined by spaces."""
        return " ".join(line.text for line in self.lines).strip()

    def number(self) -> float:
        """Its value as a finite number; raises `DatasetError`."""
        return decimal(self.text, self.file, self.row, self.name)

    def numbers(self, count: int) -> list[float]:
        """Its value as ``count`` finite numbers separated by commas; raises `DatasetError`."""
        texts = self.text.split(",")
        if len(texts) != count:
            what = f"{len(texts)} numbers where {count} belong"
            raise DatasetError(what, file=self.file, row=self.row, column=self.name, hint="correct the line")
        return [decimal(text, self.file, self.row, self.name) for text in texts]


Sections = Mapping[str, Mapping[str, Option]]
"""Options by name, of sections by name."""


def read_config(file: Path) -> Sections:
    """Read a configuration with the files that it includes; raises `DatasetError` for a line of another format."""
    found: dict[str, dict[str, Option]] = {}
    _read(file, found, 0)
    return found


def needed(sections: Sections, section: str, name: str, file: Path) -> Option:
    """An option; raises `DatasetError` where it is missing."""
    option = sections.get(section, {}).get(name)
    if option is None:
        what = f"the option {name} of [{section}] is missing"
        raise DatasetError(
            what, file=file, column=name, hint="give the whole printer.cfg, with the files that it includes"
        )
    return option


def _read(file: Path, found: dict[str, dict[str, Option]], depth: int) -> None:
    if depth > DEEPEST:
        raise DatasetError("files include one another", file=file, column="include", hint="give a file that ends")
    saved: dict[str, dict[str, Option]] = {}
    section: str | None = None
    into, last = found, ""
    for row, line in enumerate(text_lines(file), 1):
        if line.startswith(SAVED):
            if into is found:
                section = None
            into, line = saved, line[len(SAVED) :].removeprefix(" ")
            if line.startswith(("<-----", "DO NOT EDIT")):
                continue
        elif into is saved and line.strip():
            what = "a line without #*# below what SAVE_CONFIG wrote"
            raise DatasetError(what, file=file, row=row, hint="restore the file as Klipper wrote it")
        text = _COMMENT.sub("", line).rstrip()
        if not text.strip():
            continue
        if text[0].isspace() and section is not None and last:  # the line continues the value above
            option = into[section][last]
            into[section][last] = Option(last, (*option.lines, Line(text.strip(), file, row)))
            continue
        if head := _SECTION.fullmatch(text.strip()):
            section, last = " ".join(head[1].split()), ""
            if section.startswith("include "):
                for other in sorted(file.parent.glob(section.removeprefix("include ").strip())):
                    _read(other, found, depth + 1)
            into.setdefault(section, {})
            continue
        match = _OPTION.fullmatch(text.strip())
        if match is None or section is None:
            what = f"{text.strip()[:40]!r} is no line of a Klipper configuration"
            raise DatasetError(what, file=file, row=row, hint="give printer.cfg, as Klipper reads and writes it")
        last = match[1].strip().lower()
        into[section][last] = Option(last, (Line(match[2].strip(), file, row),))
    for name, options in saved.items():
        found[name] = {**options, **found.get(name, {})}
