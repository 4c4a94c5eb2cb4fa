"""A dataset of instruments whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.data import Commands
from gtpin.plant.instruments.gauge import Gauge
from gtpin.plant.instruments.tables import Tables
from gtpin.plant.poses import Poses
from gtpin.plant.truth import Truth, write_truth

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class InstrumentCase:
    """As :class:`~gtpin.plant.truth.Case`, of other instruments.

    Parameters
    ----------
    name
        Of its folder.
    dataset, commands
        What was measured, and the held-out commands with their covariates.
    truth
        The machine's poses at the commands, without noise and lack of repeatability: as the tracker would see them where
        there is one (frame of its own, effects of the frame), else those of the TCP in the base frame.
    effects
        What it has; the displacements are at the rows of all tables, one table after the other.
    gauges
        The instruments, with what is hidden of them.
    true
        Poses at the stops without noise, base frame, as instruments see them.
    steady
        The same poses without lack of repeatability.
    geometry
        Deviations of the geometry's parameters from nominal, by name, m and rad.
    machine
        What was measured.
    held
        What each instrument would read at the commands without noise, by its name, with ids in turn (see
        :meth:`~gtpin.plant.instruments.gauge.Gauge.in_turn`): (H, c) readings, of a tracker positions, and their sigmas.
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
        """What is hidden of the instruments, by the names of the parameters; without what their users know."""
        return {one.name: float(one.value) for gauge in self.gauges for one in gauge.hidden if one.prior > 0.0}

    def write_dataset(self, folder: Path) -> None:
        """Write the dataset and commands.csv into a folder."""
        self.dataset.write(folder)
        self.commands.write(folder / "commands.csv")

    def write_truth(self, folder: Path, name: str) -> None:
        """Write ``NAME.truth.json`` and ``NAME.truth.csv`` into a folder that is being written."""
        more = {"instruments": self.hidden, "geometry": self.geometry}
        write_truth(folder, name, self.effects, self.commands, self.truth, more)
