"""Figures of accuracy results. They need matplotlib, which the extra ``plots`` installs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gtpin.accuracy.chain_workspace import ChainWorkspace
from gtpin.accuracy.sensitivity import Sensitivity
from gtpin.accuracy.steps import PARAMETERS
from gtpin.accuracy.workspace import Workspace
from gtpin.output.figure import new_figure
from gtpin.typing import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SLICES = 3
"""Largest number of slices of a map that are shown."""
BLOCKS = {
    "position": ("position change (um)", 1e6),
    "rotation": ("orientation change, sum of\nZYZ angles (urad)", 1e6),
    "cost": ("change of squared\nclosure residual (m$^4$)", 1.0),
}
"""Labels and factors of the bars."""


def sensitivity_bars(result: Sensitivity) -> Figure:
    """Bars of the position, orientation and, where it is known, cost changes per pose and side, by parameter and link."""
    exact = result.exact
    blocks = {"position": exact.position, "rotation": exact.rotation}
    if exact.cost is not None:
        blocks["cost"] = exact.cost
    return bars(blocks, PARAMETERS, result.links, result.step, result.poses, "m/m for v")


def bars(
    sums: Mapping[str, Floats], parameters: Sequence[str], links: Sequence[str], step: float, poses: int, unit: str
) -> Figure:
    """Bars of changes per pose and side.

    Parameters
    ----------
    sums
        (p, k) by parameter and link, summed over the poses and both sides: ``position``, m, ``rotation``, rad, ``cost``, m^4.
    unit
        The unit of the step where it is not m.
    """
    blocks = [(label, factor * sums[name]) for name, (label, factor) in BLOCKS.items() if name in sums]
    figure = new_figure(10.0, 2.6 * len(blocks) + 0.8)
    axes = np.atleast_1d(figure.subplots(len(blocks), 1, sharex=True))
    width = 0.8 / len(links)
    place = np.arange(len(parameters))
    for axis, (label, values) in zip(axes, blocks, strict=True):
        for i, link in enumerate(links):
            axis.bar(place + (i + 0.5) * width - 0.4, values[:, i] / (2 * poses), width, label=link)
        axis.set_ylabel(label)
        axis.grid(axis="y", alpha=0.3)
    axes[-1].set_xticks(place, parameters)
    axes[-1].set_xlabel("parameter")
    figure.suptitle(f"Mean change per pose by a step of {step:.0e} (m, or {unit}), {poses} poses")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper", title="link", fontsize=9)
    return figure


def workspace_map(space: Workspace | ChainWorkspace, values: Floats, title: str, unit: str) -> Figure:
    """Slices of a workspace, coloured by values; blank out of reach.

    Parameters
    ----------
    values
        (M,) values at the reachable points.
    title, unit
        Name and unit of the values.
    """
    a, b = (i for i in range(3) if i != space.across)
    names, along = "xyz", space.axes[space.across]
    table = space.on_grid(values)
    there = np.flatnonzero(space.reachable.any(axis=(a, b)))
    count = min(SLICES, len(there))
    shown = there[[(2 * i + 1) * len(there) // (2 * count) for i in range(count)]]  # in the middle of equal parts
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
