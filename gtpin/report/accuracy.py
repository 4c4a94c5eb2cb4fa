"""An accuracy analysis as text, table, figures and page: expected errors over the workspace, and the influence of each
parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.figures import FILES, UNITS, write_accuracy
from gtpin.accuracy.workspace import Workspace
from gtpin.errors import ModelError
from gtpin.report.dataset import map_layout
from gtpin.report.figure import SCALE, Drawing, Plot, PlotChoice, alone, colorbar
from gtpin.report.page import Lead, PagePresentation, Plots, Section, Step, Table, provenance
from gtpin.report.residual_plots import scale_of
from gtpin.report.sketch import drawing
from gtpin.report.words import quantity, typeset, with_unit
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

MEANINGS = {
    "position_gain": ("TCP position per command", "m/m or m/rad"),
    "rotation_gain": ("TCP rotation per command", "rad/m or rad/rad"),
    "condition": ("condition number of TCP position by commands", ""),
    "position_amplification": ("TCP position per rod length error", "m/m"),
    "rotation_amplification": ("TCP rotation per rod length error", "rad/m"),
    "singularity": ("distance from singularity, {one_at}", ""),
    "limit": ("distance of the nearest actuator from its limit", "m or rad"),
}
WITHIN = {
    False: "Slices of the box that the poses span{volume}; blank where the robot can't reach.",
    True: "Slices of the workspace{volume}, from {postures:,} postures that fill the joints' ranges: a cell has the "
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


@dataclass(frozen=True)
class AccuracyPresentation(PagePresentation):
    """An accuracy analysis; its table is that of the sensitivity."""

    accuracy: Accuracy
    files = (*FILES, "report.html")

    @cached_property
    def lead(self) -> Lead:
        """The errors to expect, and the parameter that moves the TCP most."""
        found, values = self.accuracy, self.accuracy.to_json()
        name, numbers = f"Accuracy of {found.model.robot.name}", []
        for what, unit in (("position", "m"), ("orientation", "rad")):
            if error := values["expected"][what]:
                numbers += [
                    (quantity(error["mean"], unit), f"expected {what} error, mean"),
                    (quantity(error["p95"], unit), "95 % of machines and poses have less"),
                    (quantity(error["maximum"], unit), "largest of a machine, on average"),
                ]
            else:
                numbers.append(("none", f"{what} error: the arm is reduced"))
        where = "over the ranges of the drives" if found.filling else "at the given commands"
        mean = quantity(values["expected"]["position"]["mean"], "m")
        advice, step = [_greatest(found)], "To replace the tolerances by an identified geometry, measure poses:"
        if found.filling and found.model.covariance is not None:
            far = "Far from the measured poses a calibration is less certain; --poses takes the commands that matter."
            advice.append(far)
        return Lead(
            f"{name} · {values['poses']} poses",
            f"Expect a position error of {mean} on average {where}, from {values['uncertainty']}.",
            advice,
            numbers,
            sketch=drawing(found.model),
            steps=[Step(step, "gtpin calibrate DATASET -o calibrated")] if found.model.covariance is None else [],
            warnings=found.warnings,
            tab=name,
        )

    @cached_property
    def sections(self) -> Sequence[Section]:
        """Maps, the sensitivity to each parameter, and dexterity."""
        found, space, steps = self.accuracy, self.accuracy.space, self.accuracy.sensitivity
        quantities, plots = slices(found)
        volume = f", about {space.volume:.3g} m³ within reach" if space.volume else ""  # a planar robot has none
        within = WITHIN[space.filled].format(volume=volume, postures=len(space.q))
        about = f"Mean change of the TCP's position, µm, by a step of {steps.step} {LEGEND['rx' in steps.parameters]}"
        one_at = {"home": "1 as at home", "best": "1 at the best of these poses"}[space.dexterity.one_at]
        measures = _dexterity(found.to_json()["dexterity"], one_at)
        return [
            Section("maps", "Over the workspace", [Plots(plots, within, [quantities])]),
            Section("parameters", "What moves the TCP", [about, _steps(found)]),
            Section("dexterity", "Dexterity", [measures]),
        ]

    @property
    def origin(self) -> Table:
        """Versions, and the seed of the analysis."""
        return provenance(None, self.accuracy.model.robot, self.accuracy.seed)

    def table(self) -> pd.DataFrame:
        """The columns of sensitivity.csv."""
        return self.accuracy.sensitivity.to_table()

    def write(self, folder: Path) -> dict[str, object]:
        """Write the files of ``gtpin sensitivity``; return the content of the JSON."""
        write_accuracy(self.accuracy, folder)
        (folder / "report.html").write_text(self.page(), encoding="utf-8")
        return self.accuracy.to_json()

    def parameters(self) -> Figure:
        """The report's table of steps."""
        title = f"Mean change of the TCP's position, µm, by a step of {self.accuracy.sensitivity.step:g}"
        return _steps(self.accuracy).figure(title)

    def workspace(self, quantity: str) -> Figure:
        """Slices of the workspace side by side, coloured by a quantity; blank out of reach.

        Raises `ModelError` if there is no such quantity: a reduced arm has no orientation error, and a condition number that
        is infinite everywhere has no map.
        """
        values, space = _quantities(self.accuracy), self.accuracy.space
        if quantity not in values:
            raise ModelError(f"there is no map of {quantity!r}", hint=f"give one of {', '.join(values)}")
        at, unit = values[quantity]
        layers, (across, _) = space.layers, _names(space)
        bar = colorbar(with_unit(quantity, unit))
        traces, layout = [], {}
        for k, layer in enumerate(layers):
            suffix, own = str(k + 1) if k else "", _layout(space)
            x, y, domain = f"x{suffix}", f"y{suffix}", [k / len(layers), (k + 0.8) / len(layers)]
            traces.append(_slice(space, at, layer) | {"xaxis": x, "yaxis": y, "showscale": k == 0, "colorbar": bar})
            title = typeset(f"{across} (m), at {_place(space, layer)}")
            layout[f"xaxis{suffix}"] = own["xaxis"] | {"domain": domain, "title": {"text": title}, "anchor": y}
            layout[f"yaxis{suffix}"] = own["yaxis"] | {"scaleanchor": x, "anchor": x}
            if k:
                layout[f"yaxis{suffix}"]["title"] = {"text": ""}
        return alone(Drawing(traces, layout), f"{quantity.capitalize()} over the workspace")


def _mean_step(found: Accuracy) -> Floats:
    """(p, k) mean change of the TCP's position by a step, m: the sum over both signs and all poses by their number."""
    return found.sensitivity.exact.position / (2.0 * found.sensitivity.poses)


def _greatest(found: Accuracy) -> str:
    steps, by_step = found.sensitivity, np.nan_to_num(_mean_step(found), nan=0.0)
    p, i = np.unravel_index(int(np.argmax(by_step)), by_step.shape)
    parameter, step = steps.parameters[p], steps.step
    by = f"{step:.0e}" if parameter.startswith("v") else quantity(step, "rad" if parameter.startswith("r") else "m")
    site = "" if "rx" in steps.parameters else "link "
    name, far = f"{parameter} of {site}{steps.links[i]}", quantity(float(by_step[p, i]), "m")
    return f"{name} moves the TCP most: by {far} for a step of {by}, on average."


def _steps(found: Accuracy) -> Table:
    """Mean change of the TCP's position for a step, by parameter and link, µm; the colours are relative to the largest."""
    steps, by_step = found.sensitivity, _mean_step(found)
    shades = np.nan_to_num(by_step, nan=0.0) / max(float(np.nanmax(by_step)), 1e-300)
    cells = np.where(np.isnan(by_step), "", np.char.mod("%.2f", 1e6 * by_step)).tolist()
    rows = [[name, *row] for name, row in zip(steps.parameters, cells, strict=True)]
    numbers = range(1, 1 + len(steps.links))
    return Table(("parameter", *steps.links), rows, numbers, [[0.0, *row] for row in shades.tolist()])


def _dexterity(values: dict[str, Any], one_at: str) -> Table:
    rows = []
    for name, measure in values.items():
        title, unit = MEANINGS[name]
        several = isinstance(measure["median"], list)
        cells = [measure[key] if several else [measure[key]] for key in ("least", "median", "most")]
        for k, row in enumerate(zip(*cells, strict=True)):
            shown = ["infinite" if value is None else f"{value:.3g}" for value in row]
            rows.append([f"{title.format(one_at=one_at)}{f', {k + 1}' if several else ''}", *shown, unit])
    return Table(("measure", "least", "median", "most", "unit"), rows, (1, 2, 3))


def slices(found: Accuracy) -> tuple[PlotChoice, list[Plot]]:
    """The choice of the quantity that determines the colours, and the slices, orthogonal to an axis of the base frame."""
    values, space = _quantities(found), found.space
    choice = PlotChoice(
        "quantity", "Coloured by", [(name, with_unit(name, unit)) for name, (_, unit) in values.items()]
    )

    def draw(layer: int, quantity: str) -> Drawing:
        return Drawing([_slice(space, values[quantity][0], layer)], _layout(space))

    places = [(layer, _place(space, layer)) for layer in space.layers]
    return choice, [
        Plot(f"slice-{k}", f"Slice of the workspace at {title}", partial(draw, layer), (choice,), title, 300)
        for k, (layer, title) in enumerate(places)
    ]


def _quantities(found: Accuracy) -> dict[str, tuple[Floats, str]]:
    """The maps by name: (M,) values at the reachable points, and their unit."""
    relative = {"home": "as at home: 1", "best": "best posture: 1"}[found.space.dexterity.one_at]
    units = {"condition number": "", "distance from singularity": relative}
    values: dict[str, tuple[Floats, str]] = {}
    for name, at in found.maps.items():
        factor, unit = scale_of(at, UNITS[name]) if name in UNITS else (1.0, units[name])
        values[name] = (factor * at, unit)
    return values


def _slice(space: Workspace, at: Floats, layer: int) -> dict[str, Any]:
    a, b = _names(space)
    table = space.on_grid(at)
    finite = table[np.isfinite(table)]
    return {
        "type": "heatmap",
        "x": space.axes["xyz".index(a)],
        "y": space.axes["xyz".index(b)],
        "z": table.take(layer, axis=space.across).T,
        "zmin": float(finite.min()),
        "zmax": float(finite.max()),
        "colorscale": SCALE,
        "colorbar": {"thickness": 9, "outlinewidth": 0},
        "hovertemplate": f"{a} %{{x:.3f}} m, {b} %{{y:.3f}} m: %{{z:.3g}}<extra></extra>",
    }


def _names(space: Workspace) -> tuple[str, str]:
    a, b = (name for i, name in enumerate("xyz") if i != space.across)
    return a, b


def _place(space: Workspace, layer: int) -> str:
    return f"{'xyz'[space.across]} = {space.axes[space.across][layer]:.2f} m"


def _layout(space: Workspace) -> dict[str, Any]:
    return map_layout(np.zeros((0, 3)), "".join(_names(space)), margin={"t": 10})
