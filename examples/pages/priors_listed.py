"""The tables of all numbers that move a verdict, made from the two files in which they are defined."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from gtpin.diagnosis import priors
from gtpin.effects import modulation


def priors_listed() -> str:
    """Name, value and source of each prior, as Markdown; those with the same source share a row."""
    return _listed(Path(priors.__file__), priors.PRIORS)


def modulation_listed() -> str:
    """The same of the sizes of modulations."""
    return _listed(Path(modulation.__file__), modulation.MODULATION)


def _listed(file: Path, values: object) -> str:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    (numbers,) = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    shared: dict[str, list[str]] = {}
    for field, text in zip(numbers.body, numbers.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            assert isinstance(text, ast.Expr)
            assert isinstance(text.value, ast.Constant)
            words = _source(" ".join(str(text.value.value).split())).replace("|", "\\|")
            shared.setdefault(words, []).append(f"`{field.target.id}` {getattr(values, field.target.id):g}")
    lines = ["| source | numbers, and their values |", "|---|---|"]
    return "\n".join([*lines, *(f"| {source} | {', '.join(names)} |" for source, names in shared.items())])


def _source(text: str) -> str:
    """The sentences that say where the number is from; what it is stands in the docstring, and in the reference."""
    sentences = re.split(r"(?<=\.) (?=[A-Z])", text)
    found = [sentence for sentence in sentences if sentence.startswith(("Assumed", "Derived", "Measured"))]
    return " ".join(found or sentences[-1:])
