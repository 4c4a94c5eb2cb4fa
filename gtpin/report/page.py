"""Pages: one self-contained HTML file each, from templates, with interactive plots where plotly is there."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from gtpin.report.words import typeset


@dataclass(frozen=True)
class Plot:
    """An interactive plot, in the words of plotly.js.

    In place of an array, ``#name`` is a column of the page, and ``{choice}`` within it what the reader has chosen; in a text
    that begins with ``$``, ``{choice}`` is that choice's label.

    A colour ``@name`` is the page's own: ``@data``, ``@fit``, ``@band``, ``@accent``, ... of ``style.css``, in light and dark.

    Parameters
    ----------
    name
        By which the page knows it.
    title
        Read to those who can't see it.
    data, layout
        Traces and layout. Numbers may be arrays; they are written with six digits, what is not finite as a gap.
    caption
        Below it.
    height
        In pixels; the width is the page's.
    whole
        Whether it takes a row of its own among others.
    """

    name: str
    title: str
    data: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any] = field(default_factory=dict)
    caption: str = ""
    height: int = 340
    whole: bool = False

    @property
    def json(self) -> Markup:
        """What plotly.js draws, so written that no text in it can end the script that holds it."""
        return _script({"data": self.data, "layout": self.layout})


@dataclass(frozen=True)
class Choice:
    """What the reader can choose for several plots together: its name in plots, a label, and (value, label) of the options."""

    name: str
    label: str
    options: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Table:
    """A table of texts: its head, and its rows."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def render(
    template: str,
    *,
    title: str,
    contents: Sequence[tuple[str, str]] = (),
    plots: Mapping[str, Plot | Sequence[Plot] | None] | None = None,
    columns: Mapping[str, Any] | None = None,
    provenance: Table | None = None,
    **content: Any,
) -> str:
    """Make a page of a template that extends ``base.html``.

    Parameters
    ----------
    template
        A file in ``gtpin/report/templates``.
    title
        Of the browser's tab.
    contents
        (id, title) of the sections that the page links to at its top.
    plots
        By the names that the template knows them by; none of them is drawn where plotly is not installed.
    columns
        Arrays that plots share.
    provenance
        Where the page's numbers come from.
    content
        What else the template knows. Text is escaped.
    """
    library = plotly_js() if plots else None
    scripts = (library, _own_script()) if library else ()
    return (
        _environment()
        .get_template(template)
        .render(
            title=title,
            contents=contents,
            plots=dict(plots or {}) if library else {},
            drawn=library is not None or not plots,
            scripts=scripts,
            script_hashes=[_hash(script) for script in scripts],
            columns=_script(columns or {}) if library else None,
            provenance=provenance,
            version=version("gtpin"),
            **content,
        )
    )


def _hash(script: str) -> str:
    """By which the page's security policy knows a script: none but the page's own may run in it."""
    return "'sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() + "'"


@cache
def _own_script() -> Markup:
    return Markup(_environment().get_template("plots.js").render())


@cache
def plotly_js() -> Markup | None:
    """The script that draws plots, from the extra ``plots``; None where that is not installed."""
    if find_spec("plotly") is None:
        return None
    from plotly.offline import get_plotlyjs

    return Markup(get_plotlyjs())


@cache
def _environment() -> Environment:
    found = Environment(
        loader=PackageLoader("gtpin.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["typeset"] = lambda cell: cell if isinstance(cell, Markup) else typeset(str(cell))
    return found


def _script(content: Mapping[str, Any]) -> Markup:
    text = json.dumps(_plain(content), allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _plain(value: Any) -> Any:
    """Arrays and numbers as JSON has them, with six digits; None for what is not finite."""
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def escaped(text: str) -> str:
    """Text as plots show it: they read a little HTML."""
    return str(Markup.escape(text))
