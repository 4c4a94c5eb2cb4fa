"""Figures of accuracy results. They need matplotlib, which the extra ``plots`` brings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.sensitivity import Sensitivity
from gtpin.accuracy.steps import PARAMETERS
from gtpin.accuracy.workspace import Workspace
from gtpin.output.figure import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

SLICES = 3
"""Slices of a map that are shown."""


def sensitivity_bars(result: Sensitivity) -> Figure:
    """Bars of the position, orientation and, where it is known, cost changes per pose and side, by parameter and link."""
    blocks = [
        ("position change (um)", 1e6 * result.exact.position),
        ("orientation change, sum of\nZYZ angles (urad)", 1e6 * result.exact.rotation),
    ]
    if result.exact.cost is not None:
        blocks.append(("change of squared\nclosure residual (m$^4$)", result.exact.cost))
    figure = new_figure(10.0, 2.6 * len(blocks) + 0.8)
    axes = np.atleast_1d(figure.subplots(len(blocks), 1, sharex=True))
    width = 0.8 / len(result.links)
    place = np.arange(len(PARAMETERS))
    for axis, (label, sums) in zip(axes, blocks, strict=True):
        for i, link in enumerate(result.links):
            axis.bar(place + (i + 0.5) * width - 0.4, sums[:, i] / (2 * result.poses), width, label=link)
        axis.set_ylabel(label)
        axis.grid(axis="y", alpha=0.3)
    axes[-1].set_xticks(place, PARAMETERS)
    axes[-1].set_xlabel("parameter")
    figure.suptitle(f"Mean change per pose by a step of {result.step:.0e} (m, or m/m for v), {result.poses} poses")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper", title="link", fontsize=9)
    return figure


def workspace_map(space: Workspace, values: Floats, title: str, unit: str) -> Figure:
    """Slices of a workspace orthogonal to the base frame's x, coloured by values; blank where the robot can't go.

    Parameters
    ----------
    values
        (M,) at the reachable points.
    title, unit
        What they are.
    """
    x, y, z = space.axes
    table = space.on_grid(values)
    there = np.flatnonzero(space.reachable.any(axis=(1, 2)))
    count = min(SLICES, len(there))
    shown = there[[(2 * i + 1) * len(there) // (2 * count) for i in range(count)]]  # the middles of as many parts
    figure = new_figure(3.1 * len(shown) + 1.6, 4.0)
    axes = np.atleast_1d(figure.subplots(1, len(shown), sharex=True, sharey=True))
    image = None
    for axis, layer in zip(axes, shown, strict=True):
        image = axis.pcolormesh(
            y, z, table[layer].T, shading="nearest", cmap="viridis", vmin=np.nanmin(table), vmax=np.nanmax(table)
        )
        axis.set_title(f"x = {x[layer]:.2f} m", fontsize=10)
        axis.set_xlabel("y (m)")
        axis.set_aspect("equal")
    axes[0].set_ylabel("z (m)")
    figure.colorbar(image, ax=list(axes), label=unit, shrink=0.85)  # type: ignore[arg-type]
    figure.suptitle(title)
    return figure
