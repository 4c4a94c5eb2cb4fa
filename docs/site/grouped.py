"""Parameters that a docstring describes together, each with its own type in the tables of the site."""

import re
from typing import Any

import griffe

GROUP = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)+)\n((?:(?: {4}.*)?(?:\n|\Z))+)", re.MULTILINE)
"""A line of names between commas, and the indented lines that follow."""


class Grouped(griffe.Extension):
    """Describes each of the names alone: griffe gives all of a group the type of the first."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrites the docstring of an object when it is found, before its sections are parsed."""
        if obj.docstring is not None:
            obj.docstring.value = GROUP.sub(_alone, obj.docstring.value)


def _alone(found: re.Match[str]) -> str:
    words = found[2].rstrip()
    rest = found[2][len(words) :]
    return "\n".join(f"{name}\n{words}" for name in found[1].split(", ")) + rest
