"""Why an effect can't be tested is data; words are made of it in one place."""

from __future__ import annotations

from typing import get_args

import pytest

from gtpin.effects.untestable import Kind, Untestable, as_untestable
from gtpin.report.reasons import WORDS, reason_words


def test_every_kind_of_reason_has_words() -> None:
    assert set(WORDS) == set(get_args(Kind))


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        (Untestable("missing", "speed2"), "the covariate speed2 is missing"),
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
