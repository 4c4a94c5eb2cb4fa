"""The examples in the docstrings of effects run, and show what they say."""

import doctest
import importlib

import pytest


@pytest.mark.parametrize("module", ["gtpin.effects.effect", "gtpin.effects.catalogue"])
def test_the_examples_of_a_docstring_run_and_give_what_they_show(module: str) -> None:
    found = doctest.testmod(importlib.import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert found.attempted > 0
    assert found.failed == 0
