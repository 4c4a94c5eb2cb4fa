"""Figures in a page: one for each combination of the reader's choices. Parts that figures share are written once."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from gtpin.report.figure import LIGHT, LOOK, Drawing

FEW = 8
"""Largest number of entries of a list that is written where it is used."""
SHORT = 25
"""Largest length, in characters, of settings that are written where they are used."""


@dataclass(frozen=True)
class PlotChoice:
    """A choice of the reader for several plots together: its name in plots, its label, and (value, label) of each option."""

    name: str
    label: str
    options: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Plot:
    """A figure in a page, drawn when the page is made.

    - ``name``: name of the plot in the page.
    - ``title``: title, also read by screen readers.
    - ``draw``: makes the drawing; called with one option of each choice in ``follows``, by the choices' names.
    - ``follows``: choices of the reader that the figure depends on.
    - ``caption``: text below the figure.
    - ``height``: height in pixels; the width is the page's.
    - ``whole``: whether the plot takes a whole row of the page.
    """

    name: str
    title: str
    draw: Callable[..., Drawing]
    follows: Sequence[PlotChoice] = ()
    caption: str = ""
    height: int = 340
    whole: bool = False

    def drawings(self) -> list[Drawing]:
        """The drawings, one for each combination of options; those of the last choice vary fastest."""
        names = [choice.name for choice in self.follows]
        options = product(*([value for value, _ in choice.options] for choice in self.follows))
        return [self.draw(**dict(zip(names, chosen, strict=True))) for chosen in options]


class Embedded(NamedTuple):
    """A plot for the page's template, and its JSON."""

    plot: Plot
    json: Markup


@dataclass
class Shared:
    """Parts that the plots of a page share, each once: arrays, and settings of traces and layouts; and the traces' kinds."""

    parts: list[Any] = field(default_factory=list)
    kinds: set[str] = field(default_factory=set)
    _known: dict[object, int] = field(default_factory=dict)

    def embed(self, plot: Plot) -> Embedded:
        """Draw a plot's figures, and write them with references to the shared parts."""
        figures = []
        for made in plot.drawings():
            self.kinds |= {trace.get("type", "scatter") for trace in made.traces}
            figures.append(self._written({"data": made.traces, "layout": made.layout}))
        follows = [[choice.name, len(choice.options)] for choice in plot.follows]
        return Embedded(plot, script({"follows": follows, "figures": figures}))

    @property
    def json(self) -> Markup:
        """The shared parts, the layout of all figures, and the names of their colours."""
        return script({"parts": self.parts, "look": LOOK, "palette": {value: name for name, value in LIGHT.items()}})

    def _written(self, value: Any) -> Any:
        if isinstance(value, Mapping):
            settings = {name: self._written(one) for name, one in value.items()}
            text = json.dumps(settings)
            return self._reference(text, settings) if len(text) > SHORT else settings
        if isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.ndim == 1 and value.size > FEW:
            small = np.where(np.isfinite(value), value, np.nan).astype("<f4").tobytes()
            return self._reference(small, {"dtype": "f4", "bdata": b64encode(small).decode()})
        if isinstance(value, np.ndarray):
            key = (value.dtype.str, value.shape, tuple(value) if value.dtype == object else value.tobytes())
            return self._reference(key, value) if value.size > FEW else plain(value)
        if isinstance(value, list | tuple):
            if len(value) > FEW and all(isinstance(one, str | float | int) for one in value):
                return self._reference(tuple(value), value)
            return [self._written(one) for one in value]
        return self._reference(value, value) if isinstance(value, str) and len(value) > SHORT else plain(value)

    def _reference(self, key: object, value: npt.NDArray[Any] | Sequence[Any] | str | dict[str, Any]) -> dict[str, int]:
        if key not in self._known:
            self._known[key] = len(self.parts)
            self.parts.append(plain(value))
        return {"ref": self._known[key]}


def script(content: Mapping[str, Any]) -> Markup:
    """JSON for a script element of HTML, of values that are :func:`plain`: no text in it can end the element."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def plain(value: Any) -> Any:
    """Arrays and numbers as JSON values, with five digits, more than a screen shows. A number that is not finite becomes
    None."""
    if isinstance(value, float):  # first, because a page has some 100,000 numbers
        return float(f"{value:.5g}") if isfinite(value) else None
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value


def escaped(text: str) -> str:
    """Text escaped for plots, which interpret some HTML."""
    return str(Markup.escape(text))
