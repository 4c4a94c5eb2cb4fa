"""A dataset of a virtual machine, and its truth: effects and true poses."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.machine import Machine
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.recipe import Recipe
from gtpin.bench.simulator.visits import Visits
from gtpin.data import Commands, Dataset
from gtpin.data.dataset import FILES
from gtpin.data.files import write_table
from gtpin.output.ownership import foreign
from gtpin.output.results import results_folder
from gtpin.typing import Floats

TABLES = tuple(f"{name}.csv" for name in ("tracker", "camera", "wire", "bed", "cup", "level", "encoder", "ballbar"))
"""Files with the tables of the plant's instruments."""
DATASET_FILES = (*FILES, *TABLES, "commands.csv", "truth.csv")
"""Files that the folder of a virtual machine's dataset may contain."""


@dataclass(frozen=True, eq=False)
class Truth:
    """An effect that a machine has.

    Parameters
    ----------
    effect, site
        Its id and its site.
    energy
        Its E.
    amplitude
        Its size in typical sizes.
    displacement
        (N, 6) displacement of the TCP by this effect alone at the dataset's rows: position, m, and rotation vector, rad, base
        frame.
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
        Name of its folder.
    dataset, commands
        The measurements, and the held-out commands with their covariates.
    truth
        The machine's poses at the commands, instrument's frame, without noise and errors by repeatability.
    effects
        The true effects; empty for a machine without an effect.
    machine, visits
        The machine, and the visits of the dataset's rows, in their order.
    true
        Poses at the dataset's rows without the instrument's noise, instrument's frame.
    background
        Joint energy E of the weak effects.
    recipe
        The recipe of the case.
    """

    name: str
    dataset: Dataset
    commands: Commands
    truth: Poses
    effects: tuple[Truth, ...]
    machine: Machine | ArmMachine
    visits: Visits
    true: Poses
    background: float
    recipe: Recipe

    def write(self, folder: Path | str, name: str | None = None, *, force: bool = False) -> None:
        """Write ``FOLDER/NAME/`` (the dataset and commands.csv), ``NAME.truth.json`` and ``NAME.truth.csv``.

        Files that gtpin wrote are replaced; with ``force``, other files of these names are renamed (``NAME.old-1``).

        Raises
        ------
        GtpinError
            If the folder can't be written, or, without ``force``, contains files of these names that gtpin has not written or
            that were changed since.
        """
        name = name or self.name
        with case_folders(Path(folder) / name, force=force) as (inside, outside):
            self.write_dataset(inside)
            self.write_truth(outside, name)

    def write_dataset(self, folder: Path) -> None:
        """Write the dataset and commands.csv into a folder."""
        self.dataset.write(folder)
        self.commands.write(folder / "commands.csv")

    def write_truth(self, folder: Path, name: str) -> None:
        """Write ``NAME.truth.json`` and ``NAME.truth.csv`` into a folder that is being written."""
        write_truth(folder, name, self.effects, self.commands, self.truth)


def write_truth(
    folder: Path,
    name: str,
    effects: Sequence[Truth],
    commands: Commands,
    poses: Poses,
    more: Mapping[str, object] | None = None,
) -> None:
    """Write ``NAME.truth.json``, with the further keys ``more``, and ``NAME.truth.csv``, the poses at the commands."""
    json_name, csv_name = truth_names(name)
    listed = [{"effect": t.effect, "site": t.site, "energy": t.energy} for t in effects]
    text = json.dumps({"effects": listed, **(more or {})}, indent=1, allow_nan=False) + "\n"
    (folder / json_name).write_text(text, encoding="utf-8")
    columns = dict(zip("xyz", poses.T.T, strict=True))
    columns |= dict(zip(("qw", "qx", "qy", "qz"), poses.quaternions.T, strict=True))
    write_table(folder / csv_name, {"pose": commands.pose, **columns})


def truth_names(name: str) -> tuple[str, str]:
    """Names of the two files with the truth of a dataset."""
    return f"{name}.truth.json", f"{name}.truth.csv"


@contextlib.contextmanager
def dataset_folder(dataset: Path, *, force: bool = False) -> Iterator[Path]:
    """Context with a folder to which a dataset without a truth is written.

    If it replaces another dataset, the truth of that one is removed too, if gtpin wrote it and nobody has changed it since.
    """
    place = Path(os.path.abspath(dataset))
    old = [name for name in truth_names(place.name) if _is_own(place.with_name(name))] if place.name else []
    with contextlib.ExitStack() as stack:
        if old:
            stack.enter_context(results_folder(place.parent, old, force=force, key=old[0]))
        yield stack.enter_context(results_folder(dataset, DATASET_FILES, force=force))


def _is_own(file: Path) -> bool:
    try:
        return file.is_file() and foreign(file) is None
    except OSError:
        return False


@contextlib.contextmanager
def case_folders(dataset: Path, *, force: bool = False) -> Iterator[tuple[Path, Path]]:
    """Context with two folders to write to: one for the dataset's files, one for the truth."""
    truth = truth_names(dataset.name)
    with (
        results_folder(dataset.parent, truth, force=force, key=truth[0]) as outside,
        results_folder(dataset, DATASET_FILES, force=force) as inside,
    ):
        yield inside, outside
