"""The colours of pages and figures, in light and in dark."""

from __future__ import annotations

LIGHT = {
    "paper": "#ffffff",
    "panel": "#f5f6f8",
    "ink": "#1b1f24",
    "soft": "#5a6472",
    "line": "#d9dee5",
    "accent": "#1f5fa8",
    "data": "#5b6b7f",
    "fit": "#c2410c",
    "band": "rgba(194, 65, 12, .18)",
    "band2": "rgba(31, 95, 168, .18)",
    "band3": "rgba(26, 127, 75, .18)",
    "zero": "#9aa4b0",
    "good": "#1a7f4b",
    "warn": "#9a6700",
    "bad": "#b42318",
    "mystery": "#6d3fc0",
    "low": "#eef2f7",
    "mid": "#7ba3d0",
    "high": "#b42319",
    "shade": "rgba(27, 31, 36, .28)",
}
"""Colours of figures and of light pages, as CSS, by name. All values differ, because a page finds a colour's name by its
value."""
DARK = {
    "paper": "#14171b",
    "panel": "#1d2127",
    "ink": "#e8ebef",
    "soft": "#a0aab6",
    "line": "#343b45",
    "accent": "#74aef0",
    "data": "#9db0c6",
    "fit": "#ff9a57",
    "band": "rgba(255, 154, 87, .22)",
    "band2": "rgba(116, 174, 240, .2)",
    "band3": "rgba(86, 201, 138, .2)",
    "zero": "#66707d",
    "good": "#56c98a",
    "warn": "#e2b340",
    "bad": "#ff7b6e",
    "mystery": "#b79bff",
    "low": "#2a313b",
    "mid": "#5f93cf",
    "high": "#ff7b6e",
    "shade": "rgba(232, 235, 239, .32)",
}
"""Colours of dark pages, with the same names; such a page replaces the colours of its figures by these."""
INK, LINE, ZERO, DATA, FIT = (LIGHT[name] for name in ("ink", "line", "zero", "data", "fit"))
ACCENT, GOOD, WARN, BAD, MYSTERY, SOFT = (LIGHT[n] for n in ("accent", "good", "warn", "bad", "mystery", "soft"))
LOW, MID, HIGH = (LIGHT[name] for name in ("low", "mid", "high"))
CURVES = ((FIT, LIGHT["band"]), (ACCENT, LIGHT["band2"]), (GOOD, LIGHT["band3"]))
"""Colours of curves and their bands."""
SCALE = [[0.0, LOW], [0.45, MID], [1.0, HIGH]]
"""Colour scale of values that are not negative."""
DIVERGING = [[0.0, ACCENT], [0.5, LOW], [1.0, HIGH]]
"""Colour scale of values of either sign."""


def name_of(color: str) -> str:
    """The name of a colour of figures."""
    return next(name for name, value in LIGHT.items() if value == color)
