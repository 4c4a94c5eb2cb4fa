"""Figures in the spirit of the paper's 4 to 6 and 8 to 10."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from paper_steps import StepChange

from gtpin.comparison.compare import Comparison
from gtpin.data import CartMeasurements
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import zyz
from gtpin.output.figure import new_figure

Floats = npt.NDArray[np.float64]

RED, BLUE = "#c0392b", "#1f5fa8"
"""The paper's colours of an increase and a decrease."""
COLORS = {1: "#7f7f7f", 2: "#d98b00", 3: BLUE, 4: "#2e8b57", 5: RED}
"""Colours of models 1 to 5; for 3 to 5 the paper's."""
LINES = ("-", "--", ":")
"""Line styles of carts 1 to 3, as in the paper."""


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


def residuals(carts: CartMeasurements, cart: int) -> tuple[Floats, Floats, Floats]:
    """What a linear function of the command leaves of the positions of cart number ``cart``, from 1, in any frame (eq. 2).

    Returns (K,) commands, ascending, m, (K,) residuals along the fitted track, m, and (K,) distances from it, m.
    """
    rows = np.flatnonzero(carts.cart == cart)
    rows = rows[np.argsort(carts.q[rows], kind="stable")]
    q, position = carts.q[rows], carts.position[rows]
    slope, start = np.polyfit(q, position, 1)
    left, direction = position - start - np.outer(q, slope), slope / np.linalg.norm(slope)
    along = left @ direction
    return q, along, np.linalg.norm(left - np.outer(along, direction), axis=1)


def linearity(carts: CartMeasurements) -> Figure:
    """Plot the length of the residual of a linear fit over each track, as in the paper's Fig. 5.

    ``carts``: poses of the carts, measured along the guideways, in any frame.
    """
    figure = new_figure(8.0, 4.5)
    axis = figure.subplots()
    for i in range(carts.n_actuators):
        q, along, across = residuals(carts, i + 1)
        axis.plot(1e3 * q, 1e6 * np.hypot(along, across), LINES[i % 3], color=f"C{i}", label=f"cart {i + 1}")
    axis.set_xlabel("commanded cart position (mm)")
    axis.set_ylabel("absolute residual (um)")
    axis.set_ylim(bottom=0.0)
    axis.grid(alpha=0.3)
    axis.legend()
    figure.suptitle("Linearity error of the carts: what a linear fit leaves")
    return figure


def along_and_across(carts: CartMeasurements, roaming: CartMeasurements | None = None) -> Figure:
    """Plot the residuals of a linear fit, along each track and across it, as in the paper's Fig. 6.

    ``carts``: cart poses that were measured while all carts moved together, in any frame; drawn as lines. ``roaming``: cart
    poses that were measured while the TCP moved freely, drawn as stars. They can be in another frame: each set has a
    separate linear fit.
    """
    n = carts.n_actuators
    figure = new_figure(3.4 * n, 5.5)
    axes = figure.subplots(2, n, sharex=True, sharey="row", squeeze=False)
    for i in range(n):
        if roaming is not None:
            q, *stars = residuals(roaming, i + 1)
            for axis, values in zip(axes[:, i], stars, strict=True):
                axis.plot(1e3 * q, 1e6 * values, "*", color="0.6", markersize=4, label="TCP anywhere")
        q, *lines = residuals(carts, i + 1)
        for axis, values in zip(axes[:, i], lines, strict=True):
            axis.plot(1e3 * q, 1e6 * values, "k-", label="carts together")
        axes[0, i].set_title(f"cart {i + 1}", fontsize=10)
        axes[1, i].set_xlabel("commanded position (mm)")
        for axis in axes[:, i]:
            axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("along the track (um)")
    axes[1, 0].set_ylabel("across the track (um)")
    axes[1, 0].set_ylim(bottom=0.0)
    figure.suptitle("Linearity error of the carts, along and across their tracks")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
    return figure


def orientation_errors(comparison: Comparison, models: tuple[int, ...] = (3, 4, 5)) -> Figure:
    """Measured less predicted ZYZ Euler angles of held-out poses, as in the paper's Fig. 8."""
    figure = new_figure(9.0, 6.0)
    axes = figure.subplots(3, 1, sharex=True)
    for held in comparison.held:
        if held.model in models and held.angles is not None:
            for axis, values in zip(axes, held.angles.T, strict=True):
                axis.plot(1e3 * values, color=COLORS[held.model], linewidth=1.1, label=f"model {held.model}")
    for axis, name in zip(axes, ("alpha", "beta", "gamma"), strict=True):
        axis.set_ylabel(f"{name} error (mrad)")
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("held-out pose, in the dataset's order")
    figure.suptitle("Orientation errors, ZYZ Euler angles")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(models), fontsize=9)
    return figure
