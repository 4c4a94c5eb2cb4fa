"""The page of an accuracy analysis: expected errors over the workspace, and the influence of each parameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.sensitivity import Sensitivity
from gtpin.report.page import Table, render
from gtpin.report.provenance import provenance
from gtpin.report.sketch import drawing
from gtpin.report.words import quantity
from gtpin.report.workspace_maps import slices
from gtpin.typing import Floats

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
    "singularity": ("distance from singularity, {one_at}", ""),
    "limit": ("distance of the nearest actuator from its limit", "m or rad"),
}
ONE_AT = {"home": "1 as at home", "best": "1 at the best of these poses"}
WITHIN = {
    False: "Slices of the box that the poses span, about {volume} m³ of it within reach; blank where the robot can't reach.",
    True: "Slices of the workspace, about {volume} m³, from {postures:,} postures that fill the joints' ranges: a cell has the "
    "median over the postures that bring the TCP there; blank where none does.",
}
"""Text on what the maps show: whether postures fill the workspace, or a box has one in each cell."""
LEGEND = {
    False: "(m, or m/m for v) in each parameter of each link. L: length; P: joint on the platform; C: joint on the cart; v: "
    "direction of the track.",
    True: "(m, or rad for r) in the placement of each joint in its parent, and of the tool on the last link (platform), in "
    "their own axes.",
}
"""Text on the rows of the table: of rods, and of placements."""


def sensitivity_page(found: Accuracy, *, seed: int = 0) -> str:
    """The whole report of an accuracy analysis as one self-contained HTML file.

    Parameters
    ----------
    seed
        Seed of the analysis, to be recorded on the page.
    """
    model, values, space = found.model, found.to_json(), found.space
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
        advice=[_greatest(found.sensitivity)],
        numbers=_numbers(values),
        sketch=drawing(model),
        quantities=quantities,
        table=step_table(found),
        shares=_shares(_mean_step(found.sensitivity)),
        step=found.sensitivity.step,
        legend=LEGEND["rx" in found.sensitivity.parameters],
        dexterity=_dexterity(values["dexterity"], space.dexterity.one_at),
        within=WITHIN[space.filled].format(volume=f"{space.volume:.3g}", postures=len(space.q)),
    )


def _headline(values: Mapping[str, Any]) -> str:
    position = values["expected"]["position"]
    mean = quantity(position["mean"], "m")
    return f"Expect a position error of {mean} on average over the workspace, from {values['uncertainty']}."


def _mean_step(steps: Sensitivity) -> Floats:
    """(p, k) mean change of the TCP's position by a step, m: the sum over both signs and all poses by their number."""
    return steps.exact.position / (2.0 * steps.poses)


def _greatest(steps: Sensitivity) -> str:
    """The parameter whose step moves the TCP most."""
    by_step = np.nan_to_num(_mean_step(steps), nan=0.0)
    p, i = np.unravel_index(int(np.argmax(by_step)), by_step.shape)
    parameter, step = steps.parameters[p], steps.step
    by = f"{step:.0e}" if parameter.startswith("v") else quantity(step, "rad" if parameter.startswith("r") else "m")
    site = "" if "rx" in steps.parameters else "link "
    name, far = f"{parameter} of {site}{steps.links[i]}", quantity(float(by_step[p, i]), "m")
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
    steps = found.sensitivity
    rows = [
        [name, *("" if np.isnan(v) else f"{v:.2f}" for v in 1e6 * row)]
        for name, row in zip(steps.parameters, _mean_step(steps), strict=True)
    ]
    return Table(("parameter", *steps.links), rows)


def _shares(by_step: Floats) -> list[list[float]]:
    """Each cell of the table relative to the largest."""
    by = np.nan_to_num(by_step, nan=0.0)
    return [[0.0, *row] for row in (by / max(float(by.max()), 1e-300)).tolist()]


def _dexterity(values: Mapping[str, Any], one_at: str) -> Table:
    rows = []
    for name, measure in values.items():
        title, unit = MEANINGS[name]
        title = title.format(one_at=ONE_AT[one_at])
        parts = measure["median"] if isinstance(measure["median"], list) else None
        for k in range(len(parts)) if parts else (None,):
            cells = [_cell(measure[key] if k is None else measure[key][k]) for key in ("least", "median", "most")]
            rows.append([title if k is None else f"{title}, {k + 1}", *cells, unit])
    return Table(("measure", "least", "median", "most", "unit"), rows)


def _cell(value: float | None) -> str:
    return "infinite" if value is None else f"{value:.3g}"
