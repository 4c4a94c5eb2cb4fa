"""Something that writes results: two files and a folder with a file, all with one text."""

from __future__ import annotations

from pathlib import Path

from gtpin.output.results import results_folder

NAMES = ("a.txt", "b", "c.txt")


def write(folder: Path | str, text: str, force: bool = False) -> None:
    with results_folder(Path(folder), NAMES, force=force) as new:
        (new / "a.txt").write_text(text)
        (new / "b").mkdir()
        (new / "b" / "d.txt").write_text(text)
        (new / "c.txt").write_text(text)
