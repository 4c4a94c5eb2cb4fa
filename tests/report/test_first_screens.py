"""What the first screen says in each case is what is stored: a change of words shows as a diff."""

from __future__ import annotations

import re

import pytest
from first_screens import CASES, FOLDER, alike, first_screens


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_first_screen_says_what_is_stored(name: str) -> None:
    stored = (FOLDER / f"{name}.txt").read_text(encoding="utf-8")
    assert alike(first_screens(name), stored), "look at it, and store it: python tests/report/first_screens.py"


def test_every_stored_screen_is_of_a_case() -> None:
    assert {file.stem for file in FOLDER.iterdir()} == set(CASES)


def test_words_and_large_differences_of_numbers_are_told_and_last_digits_are_not() -> None:
    assert alike("an error of 20.3 µm", "an error of 20.1 µm")
    assert not alike("an error of 21.3 µm", "an error of 20.1 µm")
    assert not alike("an error of 20.1 mm", "an error of 20.1 µm")


@pytest.mark.parametrize("name", CASES)
def test_a_headline_has_at_most_three_lines_and_a_size_in_each_but_where_only_noise_is_left(name: str) -> None:
    terminal = (FOLDER / f"{name}.txt").read_text(encoding="utf-8").partition("\nREPORT\n")[0]
    headline = terminal.split("\n\n")[1].splitlines()
    assert 1 <= len(headline) <= 3
    for line in headline:
        assert re.search(r"\d (?:m|µ)m|\d %", line) or line == "No cause beside the geometry: only noise is left."
