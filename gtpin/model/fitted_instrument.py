"""An instrument as a calibration has it: what was declared, and the values of its unknowns."""

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
        What dataset.toml says of it.
    columns
        Columns of numbers that its table had: an orientation is predicted where it was measured.
    known
        By name, the ids that columns of ids had.
    unknowns
        By name, the deviation of each unknown from what is declared, m or rad.
    """

    table: InstrumentTable
    columns: tuple[str, ...] = ()
    known: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    unknowns: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Its name in dataset.toml."""
        return self.table.name
