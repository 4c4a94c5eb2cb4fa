"""A table as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gtpin.report.embedded import escaped
from gtpin.report.figure import Drawing, alone
from gtpin.report.page import Table
from gtpin.report.palette import INK, LIGHT, LINE
from gtpin.report.words import typeset

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

ROW = 26
"""Height of a row, in pixels."""
LEAST = 8
"""Width of the narrowest column, in characters."""
MOST = 600
"""Largest height of the figure, in pixels; a higher table scrolls."""


def table_figure(table: Table, title: str) -> Figure:
    """A table of a report as a figure."""
    columns = [[typeset(escaped(row[k])) for row in table.rows] for k in range(len(table.head))]
    look = {"align": "left", "line": {"color": LINE}, "font": {"color": INK}, "height": ROW}
    head = {"values": [f"<b>{escaped(name)}</b>" for name in table.head], "fill": {"color": LIGHT["panel"]}}
    cells = {"values": columns, "fill": {"color": LIGHT["paper"]}}
    widths = [
        max(LEAST, *(len(text) for text in (name, *column))) for name, column in zip(table.head, columns, strict=True)
    ]
    made = Drawing([{"type": "table", "header": head | look, "cells": cells | look, "columnwidth": widths}]).figure()
    made.update_layout(height=min(MOST, 120 + ROW * (len(table.rows) + 2)))
    return alone(made, title)
