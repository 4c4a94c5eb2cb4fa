"""Files that an MJCF includes."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from gtpin.data.files import read_text
from gtpin.errors import RobotError


def with_includes(root: Element, file: Path, parse: Any) -> None:
    """Replace each ``<include file>`` by the content of that file, as MuJoCo does.

    Paths start at the folder of the main file; where there is no such file, at that of the file with the ``<include>``.

    Raises `RobotError` if an included file can't be read, or is included twice.
    """
    _include(root, file.parent, file.parent, parse, {file.absolute()})


def _include(root: Element, main: Path, own: Path, parse: Any, read: set[Path]) -> None:
    for parent in list(root.iter()):
        if all(child.tag != "include" for child in parent):
            continue
        kept: list[Element] = []
        for child in parent:
            if child.tag != "include":
                kept.append(child)
                continue
            name = child.get("file", "")
            file = main / name if (main / name).exists() else own / name
            if file.absolute() in read:
                raise RobotError("this file is included twice", file=file, hint="include each file once")
            read.add(file.absolute())
            inside = parse(read_text(file, RobotError, hint="mend <include>"), str(file))
            _include(inside, main, file.parent, parse, read)
            kept += inside
        parent[:] = kept
