"""The meaning of an effect and its parameters, from the docstring of its class."""

from __future__ import annotations

import inspect
import re

from markupsafe import Markup, escape

from gtpin.effects.effect import Effect


def meaning(effect: Effect) -> tuple[Markup, ...]:
    """Equation, signs and parameters of an effect, a paragraph each; empty without a docstring.

    Paragraphs on typical sizes are omitted, because the data have determined the size.
    """
    text = inspect.cleandoc(type(effect).__dict__.get("__doc__") or "")
    paragraphs = [" ".join(part.split()) for part in text.split("\n\n")]
    return tuple(_marked(part) for part in paragraphs if part and not part.startswith("Typical size"))


def _marked(text: str) -> Markup:
    """A paragraph with its names set as code, and references to classes as the class name."""
    plain = re.sub(r":\w+:`~?(?:[\w.]+\.)?(\w+)`", r"``\1``", text)
    parts = plain.split("``")
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in enumerate(parts)
    )
