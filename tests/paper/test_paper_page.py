"""docs/paper.md says what its script computes: the script run in small, against the page's numbers."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from paper_grid import RECOVERED
from scripts import load

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "dressler2010"
DRAWS = ROOT / "docs" / "figures" / "paper_draws.csv"

if not EXAMPLE.is_dir():
    pytest.skip("the examples are not here", allow_module_level=True)


@pytest.fixture(scope="module")
def script() -> ModuleType:
    """examples/dressler2010/page.py."""
    return load("dressler2010/page")


@pytest.fixture(scope="module")
def told(script: ModuleType) -> dict[str, str]:
    """The page in docs, and the file with all numbers of Table III."""
    pages = (ROOT / "docs" / name for name in ("paper.md", script.TABLE3_FILE))
    return sections("".join(page.read_text(encoding="utf-8") for page in pages))


@pytest.fixture(scope="module")
def drawn(script: ModuleType) -> Any:
    """One draw of the twin in place of 24."""
    return script.draw(1)


@pytest.fixture(scope="module")
def computed(script: ModuleType, drawn: Any) -> dict[str, str]:
    """Both with it."""
    blocks = script.of_table3(script.nominal(), RECOVERED)
    return sections(script.page(drawn, RECOVERED) + script.table3(blocks))


def every(text: str) -> np.ndarray:
    """(draws, 11) the rows of the file of all draws: seed, and mean and largest error of each model."""
    return np.loadtxt(text.splitlines(), delimiter=",", skiprows=1, ndmin=2)


def sections(text: str) -> dict[str, str]:
    """By heading."""
    parts = re.split(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def numbers(text: str) -> np.ndarray:
    return np.array([float(n) for n in re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?", text)])


def rows(section: str, columns: int) -> np.ndarray:
    """(N, columns) numbers of the table rows that have so many."""
    found = [numbers(line.replace("/", " ")) for line in section.splitlines() if re.match(r"\| \d", line)]
    return np.array([row for row in found if len(row) == columns])


def test_the_page_has_the_scripts_sections_and_words(told: dict[str, str], computed: dict[str, str]) -> None:
    assert list(told) == list(computed)
    for heading, text in computed.items():
        if heading != "A twin of the experiment":
            assert re.sub(r"[\d.e+-]+", "0", text) == re.sub(r"[\d.e+-]+", "0", told[heading]), heading


def test_what_is_computed_stands_on_the_page(told: dict[str, str], computed: dict[str, str]) -> None:
    for heading, text in computed.items():
        if heading != "A twin of the experiment":
            # Half of the last of three digits, and of that of a deviation in per cent.
            np.testing.assert_allclose(numbers(told[heading]), numbers(text), rtol=0.006, atol=0.11, err_msg=heading)
            small = np.abs(numbers(text)) < 0.09
            np.testing.assert_allclose(numbers(told[heading])[small], numbers(text)[small], rtol=0.06, atol=1e-9)


def test_the_first_draw_is_that_of_the_record(script: ModuleType, drawn: Any) -> None:
    """To a micrometre in the mean, and to three in the largest error."""
    first, stored = every(script.every_draw(drawn))[0], every(DRAWS.read_text(encoding="utf-8"))[0]
    np.testing.assert_allclose(stored[1::2], first[1::2], atol=1.0)
    np.testing.assert_allclose(stored[2::2], first[2::2], atol=3.0)


def test_what_the_page_counts_over_draws_are_its_rows(told: dict[str, str]) -> None:
    section = told["A twin of the experiment"]
    draws = every(DRAWS.read_text(encoding="utf-8"))
    assert draws[:, 0].tolist() == list(range(24))
    mean = draws[:, 1::2]
    found = [int(n) for n in re.findall(r"\d > \d\s+in\s+(\d+)", section)][:4]
    counts = [np.count_nonzero(mean[:, i] > mean[:, i + 1]) for i in range(4)]
    assert np.abs(np.array(found) - counts).max() <= 1  # a tie to a tenth of a micrometre may be broken either way
    table = rows(section, 15)
    np.testing.assert_allclose(table[:, 2], mean.mean(axis=0), atol=0.6)
    np.testing.assert_allclose(table[:, 3], mean.std(axis=0), atol=0.6)
    np.testing.assert_allclose(table[:, 9], draws[:, 2::2].mean(axis=0), atol=0.6)
    # The paper's order of its best two models, in at least 20 of 24.
    assert counts[3] >= 20
    excess = mean.mean(axis=0)[2:] / [110, 100, 90] - 1.0
    low, high = map(int, re.search(r"by (\d+) to (\d+) % over the draws", section).groups())
    np.testing.assert_allclose([low, high], [100 * excess.min(), 100 * excess.max()], atol=0.6)
