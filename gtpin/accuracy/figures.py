"""Figures of accuracy results. They need matplotlib, which the extra ``plots`` brings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.changes import StepChange
from gtpin.accuracy.euler import zyz
from gtpin.accuracy.planning import Plan
from gtpin.accuracy.sensitivity import Sensitivity
from gtpin.accuracy.steps import PARAMETERS
from gtpin.accuracy.workspace import Workspace
from gtpin.errors import GtpinError
from gtpin.kinematics.poses import Poses

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

RED, BLUE = "#c0392b", "#1f5fa8"
"""The paper's colours of an increase and a decrease."""
SLICES = 3
"""Slices of a map that are shown."""


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of a size in inches.

    Raises
    ------
    GtpinError
        If matplotlib is not there.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise GtpinError("figures need matplotlib", hint="pip install 'gtpin[plots]'") from None
    return Figure(figsize=(width, height), layout="constrained", dpi=120)


def orientation_along_grid(poses: Poses, layers: int) -> Figure:
    """ZYZ angles less their means along a grid walked layer after layer, as in the paper's Fig. 4.

    Parameters
    ----------
    poses
        (N) along the walk.
    layers
        How many layers of equally many poses there are; every other is shaded.
    """
    angles = np.rad2deg(zyz(poses.R))
    figure = new_figure(9.0, 6.0)
    axes = figure.subplots(3, 1, sharex=True)
    for axis, name, values in zip(axes, ("alpha", "beta", "gamma"), angles.T, strict=True):
        axis.plot(np.arange(len(values)), values - values.mean(), color=BLUE, linewidth=1.2)
        axis.set_title(f"{name}: mean {values.mean():.2f} deg, range {np.ptp(values):.2f} deg", fontsize=10, loc="left")
        axis.set_ylabel("less mean (deg)")
        _shade(axis, len(values), layers)
    axes[-1].set_xlabel("pose along the grid (layers alternately shaded)")
    axes[-1].set_xlim(0, len(angles) - 1)
    figure.suptitle("Orientation of the platform along the grid, ZYZ Euler angles")
    return figure


def _shade(axis: Any, poses: int, layers: int) -> None:
    edges = np.linspace(0, poses, layers + 1) - 0.5
    for i in range(0, layers, 2):
        axis.axvspan(edges[i], edges[i + 1], color="0.92", zorder=0)


def cost_and_position(change: StepChange, links: Sequence[str]) -> Figure:
    """Position error and every link's cost, pose by pose, before and after a step to both sides, as in the paper's Fig. 9.

    Parameters
    ----------
    links
        (k,) names of the links.
    """
    figure = new_figure(9.0, 2.5 + 1.3 * len(links))
    upper, *lower = figure.subplots(1 + len(links), 1, sharex=True, height_ratios=[2.0] + [1.0] * len(links))
    worst = int(np.argmax(change.before.position))
    for errors, color, label in _three(change):
        upper.plot(1e6 * errors.position, color=color, linewidth=1.1, label=label)
        for i, axis in enumerate(lower):
            if i == links.index(change.link) or errors is change.before:
                axis.plot(errors.costs[:, i], color=color, linewidth=1.1)
    upper.set_ylabel("position error (um)")
    for link, axis in zip(links, lower, strict=True):
        axis.set_ylabel(f"link {link} (m$^4$)")
    lower[-1].set_xlabel("pose")
    lower[-1].set_xlim(0, len(change.before.position) - 1)
    for axis in (upper, *lower):
        axis.axvline(worst, color="0.75", zorder=0)
        axis.set_ylim(bottom=0.0)
        axis.grid(alpha=0.3)
    figure.suptitle(
        f"Step of {_step(change)} in {change.parameter} of link {change.link}: position error, and squared closure residuals"
    )
    figure.legend(*upper.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
    return figure


def orientation_change(change: StepChange) -> Figure:
    """Orientation errors, pose by pose, before and after a step to both sides, as in the paper's Fig. 10."""
    figure = new_figure(9.0, 6.0)
    axes = figure.subplots(3, 1, sharex=True)
    for column, (axis, name) in enumerate(zip(axes, ("alpha", "beta", "gamma"), strict=True)):
        for errors, color, label in _three(change):
            axis.plot(1e3 * errors.rotation[:, column], color=color, linewidth=1.1, label=label)
        axis.set_ylabel(f"{name} error (mrad)")
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("pose")
    axes[-1].set_xlim(0, len(change.before.position) - 1)
    figure.suptitle(
        f"Orientation error, ZYZ angles: step of {_step(change)} in {change.parameter} of link {change.link}"
    )
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9)
    return figure


def _three(change: StepChange) -> tuple[tuple[Any, str, str], ...]:
    return (
        (change.plus, RED, "increased"),
        (change.minus, BLUE, "decreased"),
        (change.before, "black", "unchanged"),
    )


def _step(change: StepChange) -> str:
    return f"{change.step:.0e}" if change.parameter.startswith("v") else f"{1e6 * change.step:.0f} um"


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


def gain_over_random(plan: Plan) -> Figure:
    """What the best poses tell, and how well the model then predicts, beside poses drawn at random."""
    figure = new_figure(9.0, 3.4)
    left, right = figure.subplots(1, 2)
    pairs: Sequence[tuple[Any, Floats, float, str]] = (
        (left, plan.random_nats, plan.nats, "log det(I + B'B) (nats)"),
        (right, 1e6 * plan.random_error, 1e6 * plan.error, "expected prediction error, RMS (um)"),
    )
    for axis, random, best, label in pairs:
        axis.hist(random, bins=20, color="0.75", label="random")
        axis.axvline(best, color=RED, linewidth=2.0, label="chosen")
        axis.set_xlabel(label)
        axis.set_ylabel("random choices")
    left.legend(fontsize=9)
    figure.suptitle(f"{len(plan.rows)} poses chosen, and {len(plan.random_nats)} random choices of as many")
    return figure
