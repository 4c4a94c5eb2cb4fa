"""The page of an accuracy analysis: expected errors over the workspace, and the influence of each parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.steps import PARAMETERS
from gtpin.report.drawing import drawing
from gtpin.report.page import Table, render
from gtpin.report.provenance import provenance
from gtpin.report.words import quantity
from gtpin.report.workspace_maps import slices

CONTENTS = (
    ("maps", "Over the workspace"),
    ("parameters", "What moves the TCP"),
    ("dexterity", "Dexterity"),
    ("provenance", "Provenance"),
)
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
    """The whole report of an accuracy analysis as one self-contained HTML file.

    Parameters
    ----------
    seed
        Seed of the analysis, to be recorded on the page.
    """
    model, values = found.model, found.to_json()
    quantities, plots = slices(found)
    return render(
        "sensitivity.html",
        title=f"Accuracy of {model.robot.name}",
        contents=CONTENTS,
        plots={"maps": plots},
        provenance=provenance(None, model.robot, seed),
        robot=model.robot.name,
        poses=values["poses"],
        headline=_headline(values),
        advice=[_greatest(found)],
        numbers=_numbers(values),
        sketch=drawing(model),
        quantities=quantities,
        table=step_table(found),
        shares=_shares(found),
        step=found.sensitivity.step,
        dexterity=_dexterity(values["dexterity"]),
        volume=f"{found.space.volume:.3g}",
    )


def _headline(values: Mapping[str, Any]) -> str:
    position = values["expected"]["position"]
    mean = quantity(position["mean"], "m")
    return f"Expect a position error of {mean} on average over the workspace, from {values['uncertainty']}."


def _greatest(found: Accuracy) -> str:
    """The parameter whose step moves the TCP most."""
    moved = np.nan_to_num(found.sensitivity.exact.position, nan=0.0) / (2.0 * found.sensitivity.poses)
    p, i = np.unravel_index(int(np.argmax(moved)), moved.shape)
    step = found.sensitivity.step
    by = f"{step:.0e}" if PARAMETERS[p].startswith("v") else quantity(step, "m")
    name, far = f"{PARAMETERS[p]} of link {found.sensitivity.links[i]}", quantity(float(moved[p, i]), "m")
    return f"{name} moves the TCP most: by {far} for a step of {by}, on average."


def _numbers(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    numbers = []
    for what, unit in (("position", "m"), ("orientation", "rad")):
        error = values["expected"][what]
        if error is None:
            continue
        numbers += [
            (quantity(error["mean"], unit), f"{what} error, mean"),
            (quantity(error["p95"], unit), "95 % of machines and poses have less"),
            (quantity(error["maximum"], unit), "largest of a machine, on average"),
        ]
    return numbers


def step_table(found: Accuracy) -> Table:
    """Mean change of the TCP's position for a step, by parameter and link, µm."""
    moved = 1e6 * found.sensitivity.exact.position / (2.0 * found.sensitivity.poses)
    rows = [
        [name, *("" if np.isnan(v) else f"{v:.2f}" for v in row)] for name, row in zip(PARAMETERS, moved, strict=True)
    ]
    return Table(("parameter", *found.sensitivity.links), rows)


def _shares(found: Accuracy) -> list[list[float]]:
    """Each cell of the table relative to the largest."""
    moved = np.nan_to_num(found.sensitivity.exact.position, nan=0.0)
    return [[0.0, *row] for row in (moved / max(float(moved.max()), 1e-300)).tolist()]


def _dexterity(values: Mapping[str, Any]) -> Table:
    rows = []
    for name, measure in values.items():
        title, unit = MEANINGS[name]
        parts = measure["median"] if isinstance(measure["median"], list) else None
        for k in range(len(parts)) if parts else (None,):
            cells = [_cell(measure[key] if k is None else measure[key][k]) for key in ("least", "median", "most")]
            rows.append([title if k is None else f"{title}, {k + 1}", *cells, unit])
    return Table(("measure", "least", "median", "most", "unit"), rows)


def _cell(value: float | None) -> str:
    return "infinite" if value is None else f"{value:.3g}"
