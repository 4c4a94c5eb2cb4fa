"""Klipper's configuration: sections and their options, each with the file and line that it was read from.

The form is that of Klipper's klippy/configfile.py: an INI file, comments after ``#`` and ``;``, options as ``name: value`` or
``name = value``, indented lines that continue a value, ``[include FILES]``, and at its end the lines that SAVE_CONFIG wrote,
each after ``#*#``. An option that is in both parts has the value of the first part (``_strip_duplicates`` in configfile.py).

Includes are those of ``_resolve_include`` there: FILES is relative to the folder of the file that includes, and may be a
pattern (``*``, ``?``, ``[...]``) that fits no file; no file may include itself. Klipper stops where a file without a pattern is
missing; here it is a warning, because a copied printer.cfg often lacks what only the printer's computer has (mainsail.cfg).
Unlike Klipper, gtpin reads files below the folder of the configuration only, and no message has text of an included file:
a configuration that somebody else wrote could name any file of the machine.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gtpin.errors import DatasetError, warn
from gtpin.extras.importers.lines import decimal, text_lines

SAVED = "#*#"
MOST, DEEPEST = 1000, 50
"""Largest number of files that are included, and largest depth: eight files of eight includes each would be read millions of
times. The largest published configurations have some hundred files, three deep."""

_SECTION = re.compile(r"\[(.+)\]\s*(;.*)?")
_OPTION = re.compile(r"([^:=\s\[#;][^:=]*?)\s*[:=](.*)")
_COMMENT = re.compile(r"#.*|(?:^|\s);.*")  # Klipper ends a line at #, and configparser at ; after a space


@dataclass(frozen=True)
class ConfigLine:
    """A line of a value: its text without comments, and where it was read."""

    text: str
    file: Path
    row: int


@dataclass(frozen=True)
class Option:
    """An option: its lines, the first of which may be blank."""

    name: str
    lines: tuple[ConfigLine, ...]

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

    def error(self, what: str, hint: str) -> DatasetError:
        """The error that this option is wrong, with its place."""
        return DatasetError(what, file=self.file, row=self.row, column=self.name, hint=hint)

    def number(self) -> float:
        """Its value as a finite number; raises `DatasetError`."""
        return decimal(self.text, self.file, self.row, self.name)

    def numbers(self, count: int) -> list[float]:
        """Its value as ``count`` finite numbers separated by commas; raises `DatasetError`."""
        texts = self.text.split(",")
        if len(texts) != count:
            raise self.error(f"{len(texts)} numbers where {count} belong", "correct the line")
        return [decimal(text, self.file, self.row, self.name) for text in texts]


Sections = Mapping[str, Mapping[str, Option]]
"""Options by name, of sections by name."""


def read_config(file: Path, without: Path | None = None) -> Sections:
    """Read a configuration with the files that it includes; ``without``: but for this one.

    Raises `DatasetError` if a line has another format, or an included file is outside the folder, or includes itself. Warns if
    an included file is missing.
    """
    reader = _ConfigReader(file.parent, None if without is None else os.path.abspath(without))
    reader.read(file)
    return reader.found


def needed(sections: Sections, section: str, name: str, file: Path) -> Option:
    """An option; raises `DatasetError` where it is missing."""
    option = sections.get(section, {}).get(name)
    if option is None:
        what = f"the option {name} of [{section}] is missing"
        raise DatasetError(
            what, file=file, column=name, hint="give the whole printer.cfg, with the files that it includes"
        )
    return option


@dataclass
class _ConfigReader:
    """Reads the files of a configuration in the folder ``root`` but for ``without``, with what it has read."""

    root: Path
    without: str | None
    found: dict[str, dict[str, Option]] = field(default_factory=dict)
    above: list[str] = field(default_factory=list)
    included: int = 0

    def read(self, file: Path) -> None:
        saved: dict[str, dict[str, Option]] = {}
        section: str | None = None
        into, last = self.found, ""
        self.above.append(os.path.abspath(file))
        for row, line in enumerate(text_lines(file, may_be_empty=len(self.above) > 1), 1):
            if line.startswith(SAVED):
                if into is self.found:
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
                into[section][last] = Option(last, (*option.lines, ConfigLine(text.strip(), file, row)))
                continue
            if head := _SECTION.fullmatch(text.strip()):
                section, last = " ".join(head[1].split()), ""
                if section.startswith("include "):
                    for other in self._included(file, row, head[1].strip().removeprefix("include").strip()):
                        self.read(other)
                    section = None
                    continue
                into.setdefault(section, {})
                continue
            match = _OPTION.fullmatch(text.strip())
            if match is None or section is None:
                shown = repr(text.strip()[:40]) if len(self.above) == 1 else "this"
                what = f"{shown} is no line of a Klipper configuration"
                raise DatasetError(what, file=file, row=row, hint="give printer.cfg, as Klipper reads and writes it")
            last = match[1].strip().lower()
            into[section][last] = Option(last, (ConfigLine(match[2].strip(), file, row),))
        for name, options in saved.items():
            self.found[name] = {**options, **self.found.get(name, {})}
        self.above.pop()

    def _included(self, file: Path, row: int, wanted: str) -> Iterator[Path]:
        """The files that ``[include WANTED]`` names, each checked just before it is read."""
        here = os.path.join(str(file.parent), wanted)
        # glob's, not pathlib's: it takes any pattern, and ** as *, as Klipper does.
        names = sorted(glob.glob(os.path.join(glob.escape(str(file.parent)), wanted)))
        if not names and not glob.has_magic(wanted) and os.path.abspath(here) != self.without:
            what = f"the included file {wanted[:200]!r} is missing, and left out"
            warn(f"{file}, row {row}: {what}: put it there if it has a mesh, or settings of [printer] or a stepper")
        for name in names:
            path = os.path.abspath(name)
            if path == self.without:
                continue
            problem = self._problem(path, wanted[:200])
            if problem is not None:
                raise DatasetError(problem[0], file=file, row=row, column="include", hint=problem[1])
            self.included += 1
            yield Path(name)

    def _problem(self, path: str, wanted: str) -> tuple[str, str] | None:
        """Why a file must not be read, and what to do; None where it can be read."""
        if not path.startswith(os.path.join(os.path.abspath(self.root), "")):
            return f"{wanted} is outside the folder of the configuration", "copy what it includes there"
        if path in self.above:
            return f"the file {wanted} includes itself", "end the ring of includes"
        if self.included >= MOST:
            return f"more than {MOST} included files", "include each file once"
        if len(self.above) > DEEPEST:
            return f"includes {DEEPEST} deep", "include the files from one file"
        return None
