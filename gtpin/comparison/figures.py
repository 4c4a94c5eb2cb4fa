"""The files of a comparison. Its figure needs matplotlib, which the extra ``plots`` brings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gtpin.comparison.result import Comparison
from gtpin.output.figure import new_figure, write_figures
from gtpin.output.results import json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = {1: "#7f7f7f", 2: "#d98b00", 3: "#1f5fa8", 4: "#2e8b57", 5: "#c0392b"}
"""Colours of models 1 to 5; for 3 to 5 the paper's blue, green and red."""
FILES = ("compare.csv", "compare.json", "position_errors.png")
"""What ``write_comparison`` may write."""


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


def write_comparison(comparison: Comparison, new: Path) -> None:
    """Write ``compare.csv``, ``compare.json`` and a figure (without matplotlib: a warning) into a new folder."""
    comparison.table().to_csv(new / "compare.csv", index=False, lineterminator="\n")
    (new / "compare.json").write_text(json_text(comparison.to_json()), encoding="utf-8")
    write_figures(lambda: {"position_errors": position_errors(comparison)}, new)
