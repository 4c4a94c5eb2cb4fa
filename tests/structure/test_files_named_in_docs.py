"""A page of the docs names only files that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"`([\w/]+\.py)`")
OTHERS = ("klippy/", "optimize_robot_geometry.py")
"""Beginnings of the names of other projects' files."""


def test_the_files_that_pages_name_exist() -> None:
    there = [f"/{file.relative_to(ROOT).as_posix()}" for file in ROOT.rglob("*.py") if ".venv" not in file.parts]
    pages = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md"]
    missing = [
        f"{page.name}: {name}"
        for page in pages
        for name in NAMED.findall(page.read_text(encoding="utf-8"))
        if not name.startswith(OTHERS) and not any(file.endswith(f"/{name}") for file in there)
    ]
    assert missing == []
