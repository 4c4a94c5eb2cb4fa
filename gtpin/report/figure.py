"""Plotly figures in the look of gtpin's pages, the colours of both in light and in dark, and figures in a page: one for each
combination of the reader's choices, with parts that figures share written once."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import product
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from gtpin.errors import GtpinError

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

COLORS = {
    "paper": ("#ffffff", "#14171b"),
    "panel": ("#f5f6f8", "#1d2127"),
    "ink": ("#1b1f24", "#e8ebef"),
    "soft": ("#5a6472", "#a0aab6"),
    "line": ("#d9dee5", "#343b45"),
    "accent": ("#1f5fa8", "#74aef0"),
    "data": ("#5b6b7f", "#9db0c6"),
    "fit": ("#c2410c", "#ff9a57"),
    "band": ("rgba(194, 65, 12, .18)", "rgba(255, 154, 87, .22)"),
    "band2": ("rgba(31, 95, 168, .18)", "rgba(116, 174, 240, .2)"),
    "band3": ("rgba(26, 127, 75, .18)", "rgba(86, 201, 138, .2)"),
    "zero": ("#9aa4b0", "#66707d"),
    "good": ("#1a7f4b", "#56c98a"),
    "warn": ("#9a6700", "#e2b340"),
    "bad": ("#b42318", "#ff7b6e"),
    "mystery": ("#6d3fc0", "#b79bff"),
    "low": ("#eef2f7", "#2a313b"),
    "mid": ("#7ba3d0", "#5f93cf"),
    "high": ("#b42319", "#ff7b6e"),
    "shade": ("rgba(27, 31, 36, .28)", "rgba(232, 235, 239, .32)"),
}
"""Colours by name, in light and in dark, as CSS. All light values differ, because a page finds a colour's name by its value; a
dark page replaces the colours of its figures by the dark ones."""
LIGHT, DARK = ({name: both[k] for name, both in COLORS.items()} for k in (0, 1))
INK, LINE, ZERO, DATA, FIT = (LIGHT[name] for name in ("ink", "line", "zero", "data", "fit"))
ACCENT, GOOD, WARN, BAD, MYSTERY, SOFT = (LIGHT[n] for n in ("accent", "good", "warn", "bad", "mystery", "soft"))
LOW, MID, HIGH = (LIGHT[name] for name in ("low", "mid", "high"))
CURVES = ((FIT, LIGHT["band"]), (ACCENT, LIGHT["band2"]), (GOOD, LIGHT["band3"]))
"""Colours of curves and their bands."""
SCALE = [[0.0, LOW], [0.45, MID], [1.0, HIGH]]
"""Colour scale of values that are not negative."""
DIVERGING = [[0.0, ACCENT], [0.5, LOW], [1.0, HIGH]]
"""Colour scale of values of either sign."""
_AXIS = {"gridcolor": LINE, "zerolinecolor": ZERO, "linecolor": LINE, "title": {"standoff": 8}}
LOOK: Mapping[str, Any] = {
    "paper_bgcolor": LIGHT["paper"],
    "plot_bgcolor": LIGHT["paper"],
    "colorway": [ACCENT, FIT, GOOD, MYSTERY, WARN, BAD],
    "font": {"family": "system-ui, sans-serif", "size": 12, "color": INK},
    "xaxis": _AXIS,
    "yaxis": _AXIS,
    "hoverlabel": {"bgcolor": LIGHT["panel"], "bordercolor": LINE, "font": {"color": INK}},
    "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
    "margin": {"l": 58, "r": 12, "t": 36, "b": 46},
}
"""Layout of all figures, as plotly's template. A page replaces its colours by those of the light or dark palette."""


def has_plotly() -> bool:
    """Whether plotly is installed."""
    return find_spec("plotly") is not None


@dataclass(frozen=True)
class Drawing:
    """Traces and a layout in plotly's terms. Pages embed them without plotly's checks, because a page has hundreds of them and
    one check takes 2 ms."""

    traces: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any] = field(default_factory=dict)

    def figure(self) -> Figure:
        """The drawing as a plotly figure.

        Raises `GtpinError` if plotly is not installed.
        """
        try:
            from plotly.graph_objects import Figure
        except ImportError:
            raise GtpinError("figures need plotly", hint="pip install 'gtpin[plots]'") from None
        return Figure(data=list(self.traces), layout=self.layout)


def scatter(mode: str, x: Any, y: Any, **look: Any) -> dict[str, Any]:
    """A trace of points or lines; ``mode``: ``markers`` or ``lines``."""
    return {"type": "scatter", "mode": mode, "x": x, "y": y} | look


def titled(x: str, y: str, **layout: Any) -> dict[str, Any]:
    """A layout with the titles of its axes."""
    return {"xaxis": {"title": {"text": x}}, "yaxis": {"title": {"text": y}}} | layout


def colorbar(title: str) -> dict[str, Any]:
    """A narrow colour bar with its title."""
    return {"thickness": 9, "outlinewidth": 0, "title": {"text": title, "side": "right"}}


def round_below(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is at most ``value``."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value))


def alone(drawing: Drawing, title: str, **layout: Any) -> Figure:
    """A drawing as a figure for use outside a page, with its own look, title and further settings of its layout."""
    made = drawing.figure()
    made.update_layout(template={"layout": LOOK}, margin={"t": 80})
    made.update_layout(title={"text": title, "font": {"size": 14}, "x": 0, "xref": "paper"}, **layout)
    return made


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


@dataclass
class Shared:
    """Parts that the plots of a page share, each once: arrays, and settings of traces and layouts; and the traces' kinds."""

    parts: list[Any] = field(default_factory=list)
    kinds: set[str] = field(default_factory=set)
    _known: dict[object, int] = field(default_factory=dict)

    def embed(self, plot: Plot) -> Markup:
        """The JSON of a plot's figures, with references to the shared parts."""
        figures = []
        for made in plot.drawings():
            self.kinds |= {trace.get("type", "scatter") for trace in made.traces}
            figures.append(self._written({"data": made.traces, "layout": made.layout}))
        follows = [[choice.name, len(choice.options)] for choice in plot.follows]
        return script({"follows": follows, "figures": figures})

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
