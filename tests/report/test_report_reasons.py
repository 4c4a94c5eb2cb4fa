"""Why an effect can't be tested is data; words are made of it in one place."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import get_args

import pytest

import gtpin
from gtpin.effects.untestable import Kind, Untestable, as_untestable
from gtpin.report.phrases import REASONS, reason_words


def test_every_kind_of_reason_has_words() -> None:
    assert set(REASONS) == set(get_args(Kind))


def test_the_page_of_the_statistics_lists_every_kind_with_its_words() -> None:
    page = (Path(__file__).parents[2] / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", page, re.MULTILINE))
    names = {"missing": "speed2", "unusable": "session", "constant": "session"}
    for kind in set(REASONS) - {"other"}:
        assert rows[kind] == reason_words(Untestable(kind, names.get(kind, "")), "cart1")


def test_diagnosis_and_effects_leave_sentences_to_the_report() -> None:
    """No module of theirs imports the report when it is imported itself."""
    root = Path(gtpin.__file__).parent
    for file in [*root.glob("diagnosis/**/*.py"), *root.glob("effects/*.py")]:
        imports = [node for node in ast.parse(file.read_text()).body if isinstance(node, ast.ImportFrom)]
        assert not [node.module for node in imports if (node.module or "").startswith("gtpin.report")], file


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        (Untestable("missing", "speed2"), "the covariate speed2 is missing"),
        (Untestable("unusable", "session"), "the values of the covariate session can't be used: a warning says why"),
        (Untestable("constant", "session"), "the covariate session does not vary"),
        (Untestable("too_few_commands", "q3"), "the commands of cart3 are too few, or too close together"),
        (Untestable("absorbed"), "geometric calibration absorbs it"),
        (None, ""),
    ],
)
def test_words_name_the_covariate_and_the_site(reason: Untestable | None, words: str) -> None:
    assert reason_words(reason, "cart3") == words


def test_an_effect_of_a_users_own_may_give_its_reason_in_words_of_its_own() -> None:
    assert reason_words(as_untestable("the {hose} was off"), "cart1") == "the {hose} was off"
    assert as_untestable("") is None
    assert as_untestable(None) is None
    assert as_untestable(Untestable("one_sign")) == Untestable("one_sign")
