"""Plotly figures in the look of gtpin's pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from gtpin.errors import GtpinError
from gtpin.report.palette import ACCENT, BAD, FIT, GOOD, INK, LIGHT, LINE, MYSTERY, WARN, ZERO

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

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


def alone(made: Figure, title: str) -> Figure:
    """A figure for use outside a page, with its own layout and title."""
    made.update_layout(template={"layout": LOOK}, margin={"t": 80})
    made.update_layout(title={"text": title, "font": {"size": 14}, "x": 0, "xref": "paper"})
    return made
