"""A dataset of instruments whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.instruments.tables import Tables
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.truth import Truth, write_truth
from gtpin.data import Commands
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class InstrumentCase:
    """A case, as :class:`~gtpin.bench.simulator.truth.Case`, measured by any instruments.

    Parameters
    ----------
    name
        Name of its folder.
    dataset, commands
        The measurements, and the held-out commands with their covariates.
    truth
        The machine's poses at the commands, without noise and errors by repeatability: where there is a tracker, as it measures
        them (in its frame, with effects of the frame), else those of the TCP in the base frame.
    effects
        The true effects; their displacements are at the rows of all tables, one table after the other.
    gauges
        The instruments, with the true values of their unknowns.
    true
        Poses at the stops without noise, base frame, with effects of the frame.
    steady
        The same poses without errors by repeatability.
    geometry
        Deviations of the geometry's parameters from nominal, by name, m and rad.
    machine
        The machine.
    held
        By instrument's name: (H, c) readings at the held-out commands without noise, for a tracker positions, and their sigmas;
        with ids in turn (:meth:`~gtpin.bench.simulator.instruments.gauge.Gauge.in_turn`).
    """

    name: str
    dataset: Tables
    commands: Commands
    truth: Poses
    effects: tuple[Truth, ...]
    gauges: tuple[Gauge, ...]
    true: Poses
    steady: Poses
    geometry: dict[str, float]
    machine: Any
    held: dict[str, tuple[Floats, Floats]]

    @property
    def hidden(self) -> dict[str, float]:
        """True values of the instruments' unknowns, m or rad, by the names of the parameters."""
        return {one.name: float(one.value) for gauge in self.gauges for one in gauge.hidden if one.prior > 0.0}

    def write_dataset(self, folder: Path) -> None:
        """Write the dataset and commands.csv into a folder."""
        self.dataset.write(folder)
        self.commands.write(folder / "commands.csv")

    def write_truth(self, folder: Path, name: str) -> None:
        """Write ``NAME.truth.json`` and ``NAME.truth.csv`` into a folder that is being written."""
        more = {"instruments": self.hidden, "geometry": self.geometry}
        write_truth(folder, name, self.effects, self.commands, self.truth, more)
