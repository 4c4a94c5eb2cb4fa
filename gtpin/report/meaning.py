"""What an effect is and what its parameters mean, in the words of its own class."""

from __future__ import annotations

import inspect
import re

from markupsafe import Markup, escape

from gtpin.effects.catalogue import catalogue


def meaning(effect: str) -> tuple[Markup, ...]:
    """Equation, signs and parameters of an effect, a paragraph each; empty for one that says nothing of itself.

    What its class's description says of typical sizes is left out: the data have told the size.
    """
    known = catalogue().get(effect)
    text = inspect.cleandoc(type(known).__dict__.get("__doc__") or "") if known else ""
    paragraphs = [" ".join(part.split()) for part in text.split("\n\n")]
    return tuple(_marked(part) for part in paragraphs if part and not part.startswith("Typical size"))


def _marked(text: str) -> Markup:
    """A paragraph with its names set as code, and references to classes as their last word."""
    plain = re.sub(r":\w+:`~?(?:[\w.]+\.)?(\w+)`", r"``\1``", text)
    parts = plain.split("``")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in enumerate(parts)
    )
