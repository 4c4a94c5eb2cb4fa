"""Files and figures of an accuracy analysis. Figures need matplotlib, which the extra ``plots`` installs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gtpin.accuracy.analysis import Accuracy
from gtpin.accuracy.sensitivity import Sensitivity
from gtpin.accuracy.workspace import Workspace
from gtpin.output.figure import new_figure, write_figures
from gtpin.output.results import json_text
from gtpin.typing import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FILES = (
    "sensitivity.csv",
    "accuracy.json",
    "sensitivity.png",
    "map_position.png",
    "map_orientation.png",
    "map_condition.png",
    "map_singularity.png",
)
"""Names of the files that :func:`write_accuracy` may write."""
UNITS = {"position error": "m", "orientation error": "rad"}
BLOCKS = {
    "position": ("position change (um)", 1e6),
    "rotation": ("orientation change, sum of\nZYZ angles (urad)", 1e6),
    "cost": ("change of squared\nclosure residual (m$^4$)", 1.0),
}
"""Labels and factors of the bars."""
SINGULARITY = {"home": "smallest singular value / at home", "best": "smallest singular value / at the best posture"}
"""Title of the measure of singularity, by where it is 1."""


def write_accuracy(found: Accuracy, new: Path) -> None:
    """Write ``sensitivity.csv``, ``accuracy.json`` and figures (without matplotlib: a warning) into a new folder."""
    found.sensitivity.to_table().to_csv(new / "sensitivity.csv", index=False, lineterminator="\n")
    (new / "accuracy.json").write_text(json_text(found.to_json()), encoding="utf-8")
    write_figures(lambda: all_figures(found), new)


def all_figures(found: Accuracy) -> dict[str, Figure]:
    """The figures of an analysis, by name: bars of the sensitivity, and maps of the workspace."""
    one_at, maps = found.space.dexterity.one_at, {}
    for name, values in found.maps.items():
        what = name.split()[0]
        if name in UNITS:
            shown, unit = _small(values, UNITS[name])
            title = f"Expected {name} ({found.uncertain})"
        elif what == "condition":
            shown, unit, title = values, "largest / smallest gain", "Condition number of TCP position by commands"
        else:
            what, shown, unit, title = "singularity", values, SINGULARITY[one_at], "Distance from singularity"
        maps[f"map_{what}"] = workspace_map(found.space, shown, title, unit)
    return {"sensitivity": sensitivity_bars(found.sensitivity), **maps}


def _small(values: Floats, unit: str) -> tuple[Floats, str]:
    """Values in mm or um (mrad or urad), depending on the largest value, and this unit."""
    return (1e3 * values, f"m{unit}") if values.max() >= 1e-3 else (1e6 * values, f"u{unit}")


def sensitivity_bars(result: Sensitivity) -> Figure:
    """Bars of the position, orientation and, where it is known, cost changes per pose and side, by parameter and link."""
    sums = ((label, factor, getattr(result.exact, name)) for name, (label, factor) in BLOCKS.items())
    blocks = [(label, factor * values) for label, factor, values in sums if values is not None]
    figure = new_figure(10.0, 2.6 * len(blocks) + 0.8)
    axes = np.atleast_1d(figure.subplots(len(blocks), 1, sharex=True))
    width = 0.8 / len(result.links)
    place = np.arange(len(result.parameters))
    for axis, (label, values) in zip(axes, blocks, strict=True):
        for i, link in enumerate(result.links):
            axis.bar(place + (i + 0.5) * width - 0.4, values[:, i] / (2 * result.poses), width, label=link)
        axis.set_ylabel(label)
        axis.grid(axis="y", alpha=0.3)
    axes[-1].set_xticks(place, result.parameters)
    axes[-1].set_xlabel("parameter")
    unit = "rad for rotations" if "rx" in result.parameters else "m/m for v"
    figure.suptitle(f"Mean change per pose by a step of {result.step:.0e} (m, or {unit}), {result.poses} poses")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper", title="link", fontsize=9)
    return figure


def workspace_map(space: Workspace, values: Floats, title: str, unit: str) -> Figure:
    """Slices of a workspace, coloured by values; blank out of reach.

    ``values``: (M,) values at the reachable points. ``title``, ``unit``: name and unit of the values.
    """
    a, b = (i for i in range(3) if i != space.across)
    names, along, shown = "xyz", space.axes[space.across], space.layers
    table = space.on_grid(values)
    figure = new_figure(3.1 * len(shown) + 1.6, 4.0)
    axes = np.atleast_1d(figure.subplots(1, len(shown), sharex=True, sharey=True))
    image = None
    for axis, layer in zip(axes, shown, strict=True):
        image = axis.pcolormesh(
            space.axes[a],
            space.axes[b],
            table.take(layer, axis=space.across).T,
            shading="nearest",
            cmap="viridis",
            vmin=np.nanmin(table),
            vmax=np.nanmax(table),
        )
        axis.set_title(f"{names[space.across]} = {along[layer]:.2f} m", fontsize=10)
        axis.set_xlabel(f"{names[a]} (m)")
        axis.set_aspect("equal")
    axes[0].set_ylabel(f"{names[b]} (m)")
    figure.colorbar(image, ax=list(axes), label=unit, shrink=0.85)  # type: ignore[arg-type]
    figure.suptitle(title)
    return figure
