"""The files that ``gtpin sensitivity`` writes: a table, expected errors as JSON, and figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from gtpin.accuracy import figures
from gtpin.accuracy.analysis import Accuracy, analyse
from gtpin.accuracy.expected import Uncertainty
from gtpin.accuracy.map_figures import map_figures
from gtpin.model.model import Model
from gtpin.output.figure import write_figures
from gtpin.output.json_text import json_text
from gtpin.output.results import results_folder
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
"""Names of the files that ``write_sensitivity`` may write."""


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

    With ``force``, files of these names that gtpin has not written, or that were changed since, are renamed (``NAME.old-1``).

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
    return {"sensitivity": figures.sensitivity_bars(found.sensitivity), **map_figures(found)}
