"""The packages of gtpin import each other in one direction."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import gtpin

pytestmark = pytest.mark.slow

ROOT = Path(gtpin.__file__).parent
TOP = {"__init__", "__main__"}
"""They import lazily what stands below."""


def imports() -> dict[str, set[str]]:
    """By package or module on the top floor, those that it imports, wherever in its files.

    A function of a room that computes may open the report's door for its caller (results show themselves): which doors, another
    test holds.
    """
    found: dict[str, set[str]] = {}
    for file in ROOT.rglob("*.py"):
        own = file.relative_to(ROOT).with_suffix("").parts[0]
        if own in TOP:
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"))
        inside = {
            node for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for node in ast.walk(f) if node is not f
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("gtpin."):
                needed = str(node.module).split(".")[1]
                if not (needed == "report" and node in inside):
                    found.setdefault(own, set()).add(needed)
        found.setdefault(own, set()).discard(own)
    return found


def test_no_package_imports_one_that_needs_it() -> None:
    waiting = imports()
    while free := {name for name, needs in waiting.items() if not needs & waiting.keys()}:
        waiting = {name: needs for name, needs in waiting.items() if name not in free}
    assert not waiting, waiting
