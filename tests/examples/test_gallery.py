"""The gallery has a picture for each example and notebook, drawn from what it finds, and stays small."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from defusedxml import ElementTree

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples" / "pages"))

import gallery  # noqa: E402  (the scripts of examples are no package)

pytest.importorskip("matplotlib")
MOST = 1_000_000
"""Bytes of all pictures."""
QUICK = ("load_and_move", "jacobians_and_accuracy", "own_effect", "plan_measurement")
"""Examples that take a second."""
TEXT = "{http://www.w3.org/2000/svg}text"


def words(file: Path) -> list[str]:
    """What is written in a picture, but for numbers of its scales."""
    found = [" ".join("".join(text.itertext()).split()) for text in ElementTree.parse(file).iter(TEXT)]
    return sorted(word for word in found if any(letter.isalpha() for letter in word))


def test_each_example_and_notebook_has_a_picture_and_a_caption() -> None:
    names = set(gallery.sources())
    assert names == set(gallery.pictures())
    assert names == {file.stem for file in gallery.FOLDER.glob("*.svg")}
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    for name, function in gallery.pictures().items():
        assert f"![{' '.join(str(function.__doc__).split())}](gallery/{name}.svg)" in page


def test_the_pictures_are_small() -> None:
    assert sum(file.stat().st_size for file in gallery.FOLDER.iterdir()) < MOST


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_an_example_run_again_gives_a_picture_of_the_same_kind(name: str, tmp_path: Path) -> None:
    drawn = gallery.draw(name, tmp_path)
    assert len(words(drawn)) > 1
    assert words(drawn) == words(gallery.FOLDER / drawn.name)
    marks = [sum(1 for _ in ElementTree.parse(file).iter()) for file in (drawn, gallery.FOLDER / drawn.name)]
    assert marks[0] == pytest.approx(marks[1], rel=0.2)
    assert marks[0] > 100
