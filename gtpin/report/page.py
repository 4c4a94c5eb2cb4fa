"""Pages: one self-contained HTML file each, from templates, with interactive plots if plotly is installed."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from gtpin.report.embedded import Embedded, Plot, Shared, key_of
from gtpin.report.figure import has_plotly
from gtpin.report.palette import DARK, LIGHT
from gtpin.report.words import typeset


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
    provenance: Table | None = None,
    **content: Any,
) -> str:
    """Make a page from a template that extends ``base.html``.

    Parameters
    ----------
    template
        A file in ``gtpin/report/templates``.
    title
        Title in the browser's tab.
    contents
        (id, title) of the sections that the page links to at its top.
    plots
        Plots by their names in the template; none is drawn if plotly is not installed.
    provenance
        Versions, and digests of the data of the page.
    content
        Other values for the template. Text is escaped.
    """
    library = plotly_js() if plots else None
    scripts = (library, _own_script()) if library else ()
    shared = Shared()
    drawn = {name: _embedded(shared, some) for name, some in (plots or {}).items() if some} if library else {}
    return (
        _environment()
        .get_template(template)
        .render(
            title=title,
            contents=contents,
            plots=drawn,
            drawn=library is not None or not plots,
            scripts=scripts,
            script_hashes=[_hash(script) for script in scripts],
            shared=shared.json,
            provenance=provenance,
            version=version("gtpin"),
            **content,
        )
    )


def _embedded(shared: Shared, plots: Plot | Sequence[Plot]) -> Embedded | list[Embedded]:
    if isinstance(plots, Plot):
        return shared.embed(plots)
    return [shared.embed(plot) for plot in plots]


def _hash(script: str) -> str:
    """Hash of a script for the page's security policy, which allows only scripts with these hashes."""
    return "'sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() + "'"


@cache
def _own_script() -> Markup:
    return Markup(_environment().get_template("plots.js").render())


@cache
def plotly_js() -> Markup | None:
    """The script of plotly, which draws the plots; None where plotly (the extra ``plots``) is not installed."""
    if not has_plotly():
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
    found.globals.update(light=LIGHT, dark=DARK, key_of=key_of)
    found.filters["typeset"] = lambda cell: cell if isinstance(cell, Markup) else typeset(str(cell))
    return found
