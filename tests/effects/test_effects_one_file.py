"""What describes one effect stands in its own file: nothing else in gtpin names it."""

import ast
from pathlib import Path

import pytest

import gtpin
from gtpin.effects.catalogue import OWN

ROOT = Path(gtpin.__file__).parent
IDS = {kind.id for kind in OWN}
ELSEWHERE = {("comparison/figures.py", "linearity")}
"""A figure of the paper, which is called so."""


@pytest.mark.slow
def test_no_other_module_decides_by_an_effects_name() -> None:
    """The plant's causes stand apart: it must not share the diagnosis's effects."""
    named = set()
    for file in ROOT.rglob("*.py"):
        where = file.relative_to(ROOT).as_posix()
        if where.startswith(("effects/", "bench/simulator/")):
            continue
        texts = [n.value for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.Constant)]
        named |= {(where, text) for text in texts if isinstance(text, str) and text.split("@")[0] in IDS}
    assert named - ELSEWHERE == set()


def test_every_shipped_effect_has_its_own_module_that_is_called_like_it() -> None:
    assert [kind.__module__ for kind in OWN] == [f"gtpin.effects.{kind.id}" for kind in OWN]
