"""A dataset of a virtual machine, and the truth about it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtpin.data import Commands, Dataset
from gtpin.data.files import write_table
from gtpin.kinematics.poses import Poses
from gtpin.output import results_folder
from gtpin.plant.machine import Machine
from gtpin.plant.recipe import Recipe
from gtpin.plant.visits import Visits

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """An effect that a machine has.

    Parameters
    ----------
    effect, site
        What it is, and where.
    energy
        The E reached.
    amplitude
        Its size in multiples of the typical one.
    displacement
        (N, 6) what it alone does at the dataset's rows: position, m, and rotation vector, rad, base frame.
    """

    effect: str
    site: str
    energy: float
    amplitude: float
    displacement: Floats


@dataclass(frozen=True, eq=False)
class Case:
    """A dataset whose truth is known.

    Parameters
    ----------
    name
        Of its folder.
    dataset, commands
        What was measured, and the held-out commands with their covariates.
    truth
        The machine's poses at the commands: instrument's frame, no noise, no lack of repeatability.
    effects
        What it has; empty for a null.
    machine, visits
        What was measured and how: ``visits`` are those of the dataset's rows, in their order.
    true
        Poses at the dataset's rows without the instrument's noise.
    background
        E of all weak effects that are always on, together.
    recipe
        What the case was made from.
    """

    name: str
    dataset: Dataset
    commands: Commands
    truth: Poses
    effects: tuple[Truth, ...]
    machine: Machine
    visits: Visits
    true: Poses
    background: float
    recipe: Recipe

    def write(self, folder: Path | str, name: str | None = None) -> None:
        """Write ``FOLDER/NAME/`` (the dataset and commands.csv), ``NAME.truth.json`` and ``NAME.truth.csv``.

        Raises
        ------
        GtpinError
            If the folder can't be written.
        """
        name = name or self.name
        effects = [{"effect": t.effect, "site": t.site, "energy": t.energy} for t in self.effects]
        with results_folder(Path(folder)) as beside:
            self.dataset.write(beside / name)
            self.commands.write(beside / name / "commands.csv")
            text = json.dumps({"effects": effects}, indent=1, allow_nan=False) + "\n"
            (beside / f"{name}.truth.json").write_text(text, encoding="utf-8")
            columns = dict(zip("xyz", self.truth.T.T, strict=True))
            columns |= dict(zip(("qw", "qx", "qy", "qz"), self.truth.quaternions.T, strict=True))
            write_table(beside / f"{name}.truth.csv", {"pose": self.commands.pose, **columns})
