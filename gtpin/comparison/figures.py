"""Figures of the carts' linearity and of a comparison. They need matplotlib, which the extra ``plots`` brings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gtpin.calibration.cart_tracks import TrackLinearity
from gtpin.comparison.result import Comparison
from gtpin.data import CartMeasurements
from gtpin.errors import DatasetError
from gtpin.output.figure import new_figure, write_figures
from gtpin.output.results import json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = {1: "#7f7f7f", 2: "#d98b00", 3: "#1f5fa8", 4: "#2e8b57", 5: "#c0392b"}
"""Colours of models 1 to 5; for 3 to 5 the paper's blue, green and red."""
FILES = (
    "compare.csv",
    "compare.json",
    "position_errors.png",
    "orientation_errors.png",
    "linearity.png",
    "along_and_across.png",
)
"""What ``write_comparison`` may write."""
LINES = ("-", "--", ":")
"""Line styles of carts 1 to 3, as in the paper."""


def linearity(carts: CartMeasurements) -> Figure:
    """Plot the length of the residual of a linear fit over each track, as in the paper's Fig. 5.

    ``carts``: poses of the carts, measured along the guideways, in any frame.
    """
    figure = new_figure(8.0, 4.5)
    axis = figure.subplots()
    for i in range(carts.n_actuators):
        found = TrackLinearity.of(carts, i + 1)
        axis.plot(1e3 * found.q, 1e6 * found.absolute, LINES[i % 3], color=f"C{i}", label=f"cart {i + 1}")
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
            stars = TrackLinearity.of(roaming, i + 1)
            axes[0, i].plot(1e3 * stars.q, 1e6 * stars.along, "*", color="0.6", markersize=4, label="TCP anywhere")
            axes[1, i].plot(1e3 * stars.q, 1e6 * stars.across, "*", color="0.6", markersize=4)
        line = TrackLinearity.of(carts, i + 1)
        axes[0, i].plot(1e3 * line.q, 1e6 * line.along, "k-", label="carts together")
        axes[1, i].plot(1e3 * line.q, 1e6 * line.across, "k-")
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
    """Measured less predicted ZYZ Euler angles of held-out poses, as in the paper's Fig. 8.

    Raises `DatasetError` if orientation was not measured, or none of the models was compared.
    """
    shown = [(held.model, held.angles) for held in comparison.held if held.model in models]
    figure = new_figure(9.0, 6.0)
    axes = figure.subplots(3, 1, sharex=True)
    for model, angles in shown:
        if angles is None:
            raise DatasetError("orientation was not measured", hint="give qw qx qy qz")
        for axis, values in zip(axes, angles.T, strict=True):
            axis.plot(1e3 * values, color=COLORS[model], linewidth=1.1, label=f"model {model}")
    if not shown:
        raise DatasetError(f"none of models {models} was compared", hint="add carts.csv")
    for axis, name in zip(axes, ("alpha", "beta", "gamma"), strict=True):
        axis.set_ylabel(f"{name} error (mrad)")
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("held-out pose, in the dataset's order")
    figure.suptitle("Orientation errors, ZYZ Euler angles")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(shown), fontsize=9)
    return figure


def position_errors(comparison: Comparison) -> Figure:
    """Mean, largest and root mean square error of each model, as in the paper's Table I, with 95 % intervals."""
    table, intervals = comparison.table(), comparison.intervals()
    columns = {"mean_um": "mean (um)", "max_um": "largest (um)", "rms_um": "rms (um)"}
    turned = "orientation_rms_mrad"
    if comparison.held[0].orientation is not None:
        columns[turned] = "orientation, rms (mrad)"
    figure = new_figure(3.0 * len(columns), 3.8)
    axes = figure.subplots(1, len(columns))
    for axis, (name, title) in zip(axes, columns.items(), strict=True):
        values = table[name].to_numpy(dtype=float)
        ends = np.array([interval[name] for interval in intervals], dtype=float)
        # A value can be outside its interval: a resampled maximum never exceeds the observed one. Bars are then not negative.
        bars = np.maximum(np.abs(ends - values[:, None]).T, 0.0)
        axis.bar(table["model"], values, yerr=bars, capsize=4, color=[COLORS[m] for m in table["model"]])
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("model")
        axis.set_xticks(table["model"])
        axis.grid(alpha=0.3, axis="y")
        axis.set_axisbelow(True)
    poses = len(comparison.held[0].position)
    figure.suptitle(f"Errors on {poses} held-out poses, 95 % bootstrap intervals")
    return figure


def write_comparison(comparison: Comparison, new: Path, carts: CartMeasurements | None = None) -> None:
    """Write ``compare.csv``, ``compare.json`` and figures (without matplotlib: a warning) into a new folder.

    ``carts``: cart measurements, whose linearity is also shown.
    """
    comparison.table().to_csv(new / "compare.csv", index=False, lineterminator="\n")
    (new / "compare.json").write_text(json_text(comparison.to_json()), encoding="utf-8")
    write_figures(lambda: all_figures(comparison, carts), new)


def all_figures(comparison: Comparison, carts: CartMeasurements | None = None) -> dict[str, Figure]:
    """The figures that the data allow, by name."""
    made = {"position_errors": position_errors(comparison)}
    if any(held.model in (3, 4, 5) and held.angles is not None for held in comparison.held):
        made["orientation_errors"] = orientation_errors(comparison)
    if carts is not None:
        made["linearity"] = linearity(carts)
        made["along_and_across"] = along_and_across(carts)
    return made
