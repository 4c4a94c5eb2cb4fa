"""An instrument after a calibration: its declaration, and the values of its unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gtpin.data.instrument_tables import InstrumentTable


@dataclass(frozen=True)
class FittedInstrument:
    """An instrument whose unknowns were identified together with a model.

    Parameters
    ----------
    table
        Its ``[[instrument]]`` section of dataset.toml.
    columns
        Names of the columns of numbers in its table of rows. They determine what is predicted: an orientation only where it
        was measured.
    known
        By name of a column of ids (``station``, ``target``, ...): the ids in it.
    unknowns
        By name, the identified value of each unknown less its declared value, m or rad.
    """

    table: InstrumentTable
    columns: tuple[str, ...] = ()
    known: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    unknowns: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Its name in dataset.toml."""
        return self.table.name
