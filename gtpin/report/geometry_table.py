"""Identified geometry as a table."""

from __future__ import annotations

from gtpin.calibration.result import Calibration
from gtpin.model.dh import DhParameter, controller_table
from gtpin.model.model import Model
from gtpin.report.page import Block, Heading, Table
from gtpin.report.words import quantity, whole

MOVED = 8
"""Number of parameters with the largest changes, which are shown first."""
SIGNIFICANT = 3.0
"""Number of sigmas from which a correction of an arm's table is named."""


def geometry_tables(calibration: Calibration, model: Model | None = None) -> tuple[Table, Table]:
    """Two tables: the parameters with the largest changes in units of the tolerances, and all parameters.

    ``model``: geometry that was fitted together with causes; it is shown in addition to the geometry alone.
    """
    geometry = calibration.model.geometry
    head = ["parameter", "nominal", "identified − nominal", "in tolerances", "variance reduction"]
    if model is not None:
        head.append("with the causes − nominal")
    rows = []
    for p, value, sigma, reduction in zip(
        geometry.parameters, calibration.values, calibration.sigma, calibration.variance_reduction, strict=True
    ):
        moved = float(value - p.nominal)
        row = [
            p.name,
            whole(f"{p.nominal:.6f} {p.unit}"),
            quantity(moved, p.unit, float(sigma)),
            whole(f"{moved / p.tolerance:+.1f}"),
            f"{100.0 * reduction:.0f} %",
        ]
        if model is not None:
            row.append(quantity(model.geometry[p.name] - p.nominal, p.unit))
        rows.append((abs(moved / p.tolerance), row))
    moved_most = sorted(rows, key=lambda pair: -pair[0])[:MOVED]
    return Table(head, [row for _, row in moved_most]), Table(head, [row for _, row in rows])


STEADY = 1e-3
"""Share of its sigma below which a correction that is not determined is zero."""
UNKNOWN = "What is unknown may move them beyond their sigmas."
UNTESTED = "Effects may move them beyond their sigmas: run gtpin diagnose first."


def controller_words(model: Model, folder: str, doubt: str = "") -> list[str]:
    """What to change in a controller's table of a serial arm, and the command that writes it; empty for other robots.

    ``folder``: that of the model. ``doubt``: what else the changes may contain, a sentence.
    """
    moved = [
        f"{p.name} of {p.site} {'+' if p.correction > 0.0 else ''}{quantity(p.correction, p.unit, p.sigma)}"
        for p in controller_table(model)
        if p.site != "tool" and p.name != "beta" and p.determined and abs(p.correction) > SIGNIFICANT * p.sigma
    ]
    if not moved:
        return []
    said = f"Add to the controller's table (Denavit-Hartenberg): {', '.join(moved)}."
    return [" ".join(filter(None, [said, doubt, f"All of it: gtpin export {folder} -o dh.csv --format dh"]))]


def controller_blocks(model: Model, doubt: str = "") -> list[Block]:
    """The table of a serial arm with what to add to it; empty for other robots. ``doubt``: as in `controller_words`."""
    rows = [[p.site, p.name, _to_add(p), whole(f"{p.nominal:z.6f} {p.unit}")] for p in controller_table(model)]
    if not rows:
        return []
    words = (
        "What to add to the parameters of the controller; theta is the zero of a joint. They belong together; one that is not "
        "determined stays near nominal. Where the controller's a and alpha have the other sign, so have what is added to them."
    )
    return [
        Heading("The controller's table (Denavit-Hartenberg)"),
        " ".join(filter(None, [words, doubt])),
        Table(("joint", "parameter", "to add", "nominal"), rows, (2, 3)),
    ]


def _to_add(p: DhParameter) -> str:
    if not p.determined and not abs(p.correction) > STEADY * p.sigma:
        return "not determined"
    return quantity(p.correction, p.unit, p.sigma) + ("" if p.determined else " (hardly determined)")


def doubt_of(verdict: str) -> str:
    """What else the geometry of a diagnosis with this verdict may contain."""
    return UNKNOWN if verdict == "unknown" else ""
