"""The tables of all numbers that move a verdict, made from the two files in which they are defined."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from gtpin.diagnosis import priors
from gtpin.effects import modulation


def priors_listed() -> str:
    """Name, value and source of each prior, as Markdown."""
    return _listed(Path(priors.__file__), priors.PRIORS)


def modulation_listed() -> str:
    """The same of the sizes of modulations."""
    return _listed(Path(modulation.__file__), modulation.MODULATION)


def _listed(file: Path, values: object) -> str:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    (numbers,) = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    lines = ["| number | value | what it is, and its source |", "|---|---|---|"]
    for field, text in zip(numbers.body, numbers.body[1:], strict=False):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            assert isinstance(text, ast.Expr)
            assert isinstance(text.value, ast.Constant)
            words = _short(" ".join(str(text.value.value).split())).replace("|", "\\|")
            lines.append(f"| `{field.target.id}` | {getattr(values, field.target.id):g} | {words} |")
    return "\n".join(lines)


def _short(text: str) -> str:
    """What the number is, and the sentence of its source; the file has the reasons between them."""
    sentences = re.split(r"(?<=\.) (?=[A-Z])", text)
    if len(sentences) < 3:
        return text
    source = next((s for s in sentences[1:] if s.startswith(("Assumed", "Derived", "Measured"))), sentences[-1])
    return f"{sentences[0]} {source}"
