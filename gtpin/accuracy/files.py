"""What ``gtpin sensitivity`` writes: a table, expected errors as JSON, and figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from gtpin.accuracy import figures
from gtpin.accuracy.analysis import Accuracy, analyse
from gtpin.accuracy.expected import Uncertainty, mean_length, response
from gtpin.accuracy.workspace import Workspace
from gtpin.model.model import Model
from gtpin.output.figure import write_figures
from gtpin.output.json_text import json_text
from gtpin.output.results import results_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

FILES = (
    "sensitivity.csv",
    "accuracy.json",
    "sensitivity.png",
    "map_position.png",
    "map_orientation.png",
    "map_condition.png",
    "map_singularity.png",
)
"""What ``write_sensitivity`` may write."""


def write_sensitivity(
    model: Model,
    q: Floats | None,
    folder: Path,
    *,
    costs: Mapping[str, float] | None = None,
    cost_poses: int = 61,
    uncertainty: Uncertainty | None = None,
    seed: int = 0,
    force: bool = False,
) -> Accuracy:
    """Write ``sensitivity.csv``, ``accuracy.json`` and figures into a folder; see :func:`analyse` for the rest.

    With ``force``, files of these names that gtpin has not written, or that were changed since, are moved aside
    (``NAME.old-1``).

    Raises
    ------
    GtpinError
        If, without ``force``, there are such files, or the folder can't be written.

    Warns
    -----
    GtpinWarning
        If matplotlib is missing: there are no figures then.
    """
    with results_folder(folder, FILES, force=force) as new:
        found = analyse(model, q, costs=costs, cost_poses=cost_poses, uncertainty=uncertainty, seed=seed)
        write_accuracy(found, new)
    return found


def write_accuracy(found: Accuracy, new: Path) -> None:
    """Write an analysis into a new folder; see :func:`write_sensitivity`."""
    found.sensitivity.to_table().to_csv(new / "sensitivity.csv", index=False, lineterminator="\n")
    (new / "accuracy.json").write_text(json_text(found.to_json()), encoding="utf-8")
    write_figures(lambda: all_figures(found), new)


def all_figures(found: Accuracy) -> dict[str, Figure]:
    """The figures of an analysis, by name: bars of the sensitivity, and maps over the box of the poses."""
    model, space = found.model, found.space
    made = {"sensitivity": figures.sensitivity_bars(found.sensitivity)}
    for name, (values, unit, title) in _maps(found, space).items():
        if name == "orientation" and model.geometry.reduced:
            continue  # its plate never turns
        made[f"map_{name}"] = figures.workspace_map(space, values, title, unit)
    return made


def _maps(found: Accuracy, space: Workspace) -> dict[str, tuple[Floats, str, str]]:
    covariance = response(found.model, space.q, found.uncertainty).covariance
    position, orientation = mean_length(covariance[:, :3, :3]), mean_length(covariance[:, 3:, 3:])
    at = space.dexterity
    return {
        "position": (*_small(position, "m"), f"Expected position error ({found.uncertain})"),
        "orientation": (*_small(orientation, "rad"), f"Expected orientation error ({found.uncertain})"),
        "condition": (at.condition, "largest / smallest gain", "Condition number of TCP position by commands"),
        "singularity": (at.singularity, "smallest singular value / at home", "Distance from singularity"),
    }


def _small(values: Floats, unit: str) -> tuple[Floats, str]:
    """Values in thousandths or millionths of a unit, whichever reads better."""
    return (1e3 * values, f"m{unit}") if values.max() >= 1e-3 else (1e6 * values, f"u{unit}")
