"""A dataset of a virtual machine, and its truth: effects and true poses."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomli_w

from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.recipe import Machine, Recipe
from gtpin.bench.simulator.visits import VirtualVisits
from gtpin.data import Commands, Dataset
from gtpin.data.files import write_table
from gtpin.data.folder import FILES
from gtpin.data.ids import Ids
from gtpin.data.table import Column
from gtpin.errors import renamed
from gtpin.output.ownership import foreign
from gtpin.output.results import results_folder
from gtpin.typing import Floats

SCHEMA = "gtpin-dataset/2"
TABLES = tuple(f"{name}.csv" for name in ("tracker", "camera", "wire", "bed", "cup", "level", "encoder", "ballbar"))
"""Files with the tables of the simulator's instruments."""
DATASET_FILES = (*FILES, *TABLES, "commands.csv", "truth.csv")
"""Files that the folder of a virtual machine's dataset may contain."""


@dataclass(frozen=True, eq=False)
class EffectTruth:
    """An effect that a machine has."""

    effect: str
    site: str
    noncentrality: float  # Its E
    amplitude: float  # Its size in typical sizes
    displacement: Floats  # (N, 6) of the TCP by it alone at the dataset's rows: m, and rotation vector, rad, base frame
    energy = renamed("energy", "noncentrality")


@dataclass(frozen=True, eq=False, kw_only=True)
class Simulation:
    """A dataset whose truth is known.

    - ``name``: name of its folder.
    - ``dataset``, ``commands``: the measurements, and the held-out commands with their covariates.
    - ``truth``: the machine's poses at the commands, without noise and errors by repeatability: where there is a tracker,
      as it measures them (in its frame, with effects of the frame), else those of the TCP in the base frame.
    - ``effects``: the true effects; empty for a machine without an effect. Displacements are at the rows of all tables, one
      after the other.
    - ``machine``: the machine.
    - ``true``: poses without the instrument's noise: of :class:`Case` at the dataset's rows, in the instrument's frame; of
      :class:`InstrumentCase` at the stops, in the base frame, with effects of the frame.
    - ``recipe``: what it was made from; None for a machine without effects.
    """

    name: str
    dataset: Any
    commands: Commands
    truth: VirtualPoses
    effects: tuple[EffectTruth, ...] = ()
    machine: Any
    true: VirtualPoses
    recipe: Recipe | None = None

    @property
    def more(self) -> dict[str, object]:
        """Further keys of ``NAME.truth.json``."""
        return {}

    def write(self, folder: Path | str, name: str | None = None, *, force: bool = False) -> None:
        """Write ``FOLDER/NAME/`` (the dataset and commands.csv), ``NAME.truth.json`` and ``NAME.truth.csv``.

        Files that gtpin wrote are replaced; with ``force``, other files of these names are renamed (``NAME.old-1``).

        Raises `GtpinError` if the folder can't be written, or, without ``force``, contains files of these names that gtpin
        has not written or that were changed since.
        """
        name = name or self.name
        with case_folders(Path(folder) / name, force=force) as (inside, outside):
            self.write_dataset(inside)
            self.write_truth(outside, name)

    def write_dataset(self, folder: Path) -> None:
        """Write the dataset and commands.csv."""
        self.dataset.write(folder)
        self.commands.write(folder / "commands.csv")

    def write_truth(self, folder: Path, name: str) -> None:
        """Write ``NAME.truth.json``, and ``NAME.truth.csv`` with the poses at the commands."""
        json_name, csv_name = truth_names(name)
        listed = [{"effect": t.effect, "site": t.site, "energy": t.noncentrality} for t in self.effects]
        text = json.dumps({"effects": listed, **self.more}, indent=1, allow_nan=False) + "\n"
        (folder / json_name).write_text(text, encoding="utf-8")
        columns = dict(zip("xyz", self.truth.T.T, strict=True))
        columns |= dict(zip(("qw", "qx", "qy", "qz"), self.truth.quaternions.T, strict=True))
        write_table(folder / csv_name, {"pose": self.commands.pose, **columns})


@dataclass(frozen=True, eq=False, kw_only=True)
class Case(Simulation):
    """A case that a tracker measured.

    ``visits``: the visits of the dataset's rows, in their order. ``background``: joint energy E of the weak effects.
    """

    dataset: Dataset
    machine: Machine
    recipe: Recipe
    visits: VirtualVisits
    background: float


@dataclass(frozen=True, eq=False)
class Tables:
    """A dataset of schema 2."""

    robot: str
    tcp: str | None
    reference_temperature: float  # Temperature at which the geometry holds, degC
    # At N stops of the machine
    pose: Ids
    q: Floats  # (N, n)
    covariates: dict[str, Column]
    read: tuple[Gauge, ...]  # The instruments, with the true values of their unknowns and the columns of their tables

    def __len__(self) -> int:
        return sum(len(one.stop) for one in self.read)

    def write(self, folder: Path) -> None:
        """Write dataset.toml and a CSV file for each instrument into a folder, which is created if it is missing."""
        folder.mkdir(parents=True, exist_ok=True)
        head = {"schema": SCHEMA, "robot": self.robot, **({"tcp": self.tcp} if self.tcp else {})}
        about = {"conditions": {"reference_temperature": self.reference_temperature}}
        text = tomli_w.dumps({**head, **about, "instrument": [one.described for one in self.read]})
        (folder / "dataset.toml").write_text(text, encoding="utf-8", newline="\n")
        for one in self.read:
            write_table(folder / f"{one.name}.csv", self.table(one))

    def table(self, one: Gauge) -> dict[str, Column]:
        """All columns of an instrument's table."""
        columns: dict[str, Column] = {"pose": self.pose[one.stop]}
        columns |= {f"q{i + 1}": values for i, values in enumerate(self.q[one.stop].T)}
        return columns | one.columns | {name: values[one.stop] for name, values in self.covariates.items()}


@dataclass(frozen=True, eq=False, kw_only=True)
class InstrumentCase(Simulation):
    """A case that any instruments measured.

    - ``steady``: as ``true``, without errors by repeatability.
    - ``repeatability``: (n,) standard deviation of each actuator, m or rad.
    - ``held``: by instrument's name: (H, c) readings at the held-out commands without noise, for a tracker positions, and
      their sigmas; with ids in turn (:meth:`~gtpin.bench.simulator.instruments.gauge.Gauge.in_turn`). For a touching
      instrument, at the touches that are left out: the distance of the target from what it touches, of a machine that returns
      exactly to its commands (no model predicts the scatter of its repeatability), and the noise of the touch, m.
    - ``left_out``: the instruments with touches that are not in the dataset.
    """

    dataset: Tables
    steady: VirtualPoses
    repeatability: Floats
    held: dict[str, tuple[Floats, Floats]]
    left_out: tuple[Gauge, ...] = ()

    def write_dataset(self, folder: Path) -> None:
        """Write the dataset, commands.csv, and ``commands-NAME.csv`` with the touches that are left out."""
        super().write_dataset(folder)
        for gauge in self.left_out:
            write_table(folder / f"commands-{gauge.name}.csv", self.dataset.table(gauge))

    @property
    def gauges(self) -> tuple[Gauge, ...]:
        """The instruments."""
        return self.dataset.read

    @property
    def hidden(self) -> dict[str, float]:
        """True values of the instruments' unknowns, m or rad, by the names of the parameters."""
        return {one.name: float(one.value) for gauge in self.gauges for one in gauge.hidden if one.prior > 0.0}

    @property
    def more(self) -> dict[str, object]:
        return {"instruments": self.hidden, "geometry": self.machine.parameters}


def truth_names(name: str) -> tuple[str, str]:
    """Names of the two files with the truth of a dataset."""
    return f"{name}.truth.json", f"{name}.truth.csv"


@contextlib.contextmanager
def case_folders(dataset: Path, *, force: bool = False, truth: bool = True) -> Iterator[tuple[Path, Path]]:
    """Context with two folders to write to: one for the dataset's files, one for the truth.

    ``truth``: whether a truth is written. Else that of a dataset that is replaced is removed, if gtpin wrote it and nobody has
    changed it since.
    """
    place = Path(os.path.abspath(dataset))
    names = [name for name in truth_names(place.name) if truth or _is_own(place.with_name(name))]
    with contextlib.ExitStack() as stack:
        outside = place.parent
        if names:
            outside = stack.enter_context(results_folder(place.parent, names, force=force, key=names[0]))
        yield stack.enter_context(results_folder(dataset, DATASET_FILES, force=force)), outside


def _is_own(file: Path) -> bool:
    try:
        return file.is_file() and foreign(file) is None
    except OSError:
        return False
