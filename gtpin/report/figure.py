"""Plotly figures in the look of gtpin's pages, and the colours of both, in light and in dark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

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
EXTRA = "plots"
"""The extra that installs plotly."""
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
            raise GtpinError("figures need plotly", hint=f"pip install 'gtpin[{EXTRA}]'") from None
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
