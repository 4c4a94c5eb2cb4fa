"""The table of all numbers that move a verdict, made from ``gtpin/diagnosis/priors.py``."""

from __future__ import annotations

import ast
from pathlib import Path

from gtpin.diagnosis import priors


def priors_listed() -> str:
    """Name, value and source of each, as Markdown."""
    tree = ast.parse(Path(priors.__file__).read_text(encoding="utf-8"))
    (numbers,) = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    lines = ["| number | value | what it is, and its source |", "|---|---|---|"]
    for field, text in zip(numbers.body, numbers.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            assert isinstance(text, ast.Expr)
            assert isinstance(text.value, ast.Constant)
            words = " ".join(str(text.value.value).split()).replace("|", "\\|")
            lines.append(f"| `{field.target.id}` | {getattr(priors.PRIORS, field.target.id):g} | {words} |")
    return "\n".join(lines)
