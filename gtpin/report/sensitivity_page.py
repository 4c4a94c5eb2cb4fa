"""The page of an accuracy analysis: what error to expect where, and which parameter makes it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.expected import mean_length, response
from gtpin.accuracy.report import Accuracy
from gtpin.accuracy.steps import PARAMETERS
from gtpin.report.page import Choice, Plot, Table, render
from gtpin.report.provenance import provenance
from gtpin.report.residual_plots import scale_of
from gtpin.report.skeleton import skeleton
from gtpin.report.sketch import sketch
from gtpin.report.words import quantity

Floats = npt.NDArray[np.float64]

CONTENTS = (
    ("maps", "Over the workspace"),
    ("parameters", "What moves the TCP"),
    ("dexterity", "Dexterity"),
    ("provenance", "Provenance"),
)
SLICES = 3
"""Slices of the workspace that are shown."""
MEANINGS = {
    "position_gain": ("TCP position per command", "m/m or m/rad"),
    "rotation_gain": ("TCP rotation per command", "rad/m or rad/rad"),
    "condition": ("condition number of TCP position by commands", ""),
    "position_amplification": ("TCP position per rod length error", "m/m"),
    "rotation_amplification": ("TCP rotation per rod length error", "rad/m"),
    "singularity": ("distance from singularity, 1 as at home", ""),
    "limit": ("distance of the nearest actuator from its limit", "m or rad"),
}


def sensitivity_page(found: Accuracy, *, seed: int = 0) -> str:
    """The whole report of an accuracy analysis as one HTML file that needs nothing else.

    Parameters
    ----------
    seed
        Of the analysis, for the record.
    """
    model, told = found.model, found.to_json()
    columns, quantity_choice, plots = _maps(found)
    machine = skeleton(model)
    return render(
        "sensitivity.html",
        title=f"Accuracy of {model.robot.name}",
        contents=CONTENTS,
        plots={"maps": plots},
        columns=columns,
        provenance=provenance(None, model.robot, seed),
        robot=model.robot.name,
        poses=told["poses"],
        headline=_headline(told),
        advice=[_greatest(found)],
        numbers=_numbers(told),
        sketch=sketch(machine, model.robot.rod_sites, {}, {}) if machine else None,
        quantities=quantity_choice,
        table=_table(found),
        shares=_shares(found),
        step=found.sensitivity.step,
        dexterity=_dexterity(told["dexterity"]),
        volume=f"{found.space.volume:.3g}",
    )


def _headline(told: Mapping[str, Any]) -> str:
    position = told["expected"]["position"]
    mean = quantity(position["mean"], "m")
    return f"Expect a position error of {mean} on average over the workspace, from {told['uncertainty']}."


def _greatest(found: Accuracy) -> str:
    """The parameter whose step moves the TCP most."""
    moved = np.nan_to_num(found.sensitivity.exact.position, nan=0.0) / (2.0 * found.sensitivity.poses)
    p, i = np.unravel_index(int(np.argmax(moved)), moved.shape)
    step = found.sensitivity.step
    by = f"{step:.0e}" if PARAMETERS[p].startswith("v") else quantity(step, "m")
    name, far = f"{PARAMETERS[p]} of link {found.sensitivity.links[i]}", quantity(float(moved[p, i]), "m")
    return f"{name} moves the TCP most: by {far} for a step of {by}, on average."


def _numbers(told: Mapping[str, Any]) -> list[tuple[str, str]]:
    numbers = []
    for what, unit in (("position", "m"), ("orientation", "rad")):
        error = told["expected"][what]
        if error is None:
            continue
        numbers += [
            (quantity(error["mean"], unit), f"{what} error, mean"),
            (quantity(error["p95"], unit), "95 % of machines and poses have less"),
            (quantity(error["maximum"], unit), "largest of a machine, on average"),
        ]
    return numbers


def _table(found: Accuracy) -> Table:
    """Mean change of the TCP's position for a step, by parameter and link, µm."""
    moved = 1e6 * found.sensitivity.exact.position / (2.0 * found.sensitivity.poses)
    rows = [
        [name, *("" if np.isnan(v) else f"{v:.2f}" for v in row)] for name, row in zip(PARAMETERS, moved, strict=True)
    ]
    return Table(("parameter", *found.sensitivity.links), rows)


def _shares(found: Accuracy) -> list[list[float]]:
    """Each cell of the table over the largest."""
    moved = np.nan_to_num(found.sensitivity.exact.position, nan=0.0)
    return [[0.0, *row] for row in (moved / max(float(moved.max()), 1e-300)).tolist()]


def _maps(found: Accuracy) -> tuple[dict[str, Any], Choice, list[Plot]]:
    """Slices orthogonal to the base frame's x, coloured by what the reader chooses."""
    space = found.space
    covariance = response(found.model, space.q, found.uncertainty).covariance
    values: dict[str, tuple[Floats, str]] = {}
    for name, error, unit in (
        ("position error", mean_length(covariance[:, :3, :3]), "m"),
        ("orientation error", mean_length(covariance[:, 3:, 3:]), "rad"),
    ):
        if unit == "m" or not found.model.geometry.reduced:
            factor, prefixed = scale_of(error, unit)
            values[name] = (factor * error, prefixed)
    values["condition number"] = (space.dexterity.condition, "")
    values["distance from singularity"] = (space.dexterity.singularity, "as at home: 1")
    there = np.flatnonzero(space.reachable.any(axis=(1, 2)))
    count = min(SLICES, len(there))
    layers = there[[(2 * i + 1) * len(there) // (2 * count) for i in range(count)]]  # the middles of as many parts
    x, y, z = space.axes
    columns: dict[str, Any] = {"grid y": y, "grid z": z}
    options = []
    for name, (at, unit) in values.items():
        grid = space.on_grid(at)
        finite = at[np.isfinite(at)]
        columns[f"{name} low"], columns[f"{name} high"] = float(finite.min()), float(finite.max())
        for number, layer in enumerate(layers):
            columns[f"{name} {number}"] = grid[layer].T
        options.append((name, f"{name} ({unit})" if unit else name))
    plots = [_slice(number, float(x[layer])) for number, layer in enumerate(layers)]
    return columns, Choice("quantity", "Coloured by", tuple(options)), plots


def _slice(number: int, x: float) -> Plot:
    trace = {
        "type": "heatmap",
        "x": "#grid y",
        "y": "#grid z",
        "z": f"#{{quantity}} {number}",
        "zmin": "#{quantity} low",
        "zmax": "#{quantity} high",
        "colorscale": [[0, "@low"], [0.45, "@mid"], [1, "@high"]],
        "colorbar": {"thickness": 9, "outlinewidth": 0},
        "hovertemplate": "y %{x:.3f} m, z %{y:.3f} m: %{z:.3g}<extra></extra>",
    }
    layout = {
        "xaxis": {"title": {"text": "y (m)"}, "constrain": "domain"},
        "yaxis": {"title": {"text": "z (m)"}, "scaleanchor": "x", "constrain": "domain"},
        "margin": {"t": 10},
    }
    return Plot(f"slice-{number}", f"Slice of the workspace at x = {x:.2f} m", [trace], layout, f"x = {x:.2f} m", 300)


def _dexterity(told: Mapping[str, Any]) -> Table:
    rows = []
    for name, measure in told.items():
        title, unit = MEANINGS[name]
        parts = measure["median"] if isinstance(measure["median"], list) else None
        for k in range(len(parts)) if parts else (None,):
            cells = [_cell(measure[key] if k is None else measure[key][k]) for key in ("least", "median", "most")]
            rows.append([title if k is None else f"{title}, {k + 1}", *cells, unit])
    return Table(("measure", "least", "median", "most", "unit"), rows)


def _cell(value: float | None) -> str:
    return "infinite" if value is None else f"{value:.3g}"
