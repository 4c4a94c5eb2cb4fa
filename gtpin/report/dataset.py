"""A dataset as text, table and map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from gtpin.calibration.checks.prepared import with_positions
from gtpin.data.names import command_names
from gtpin.errors import DatasetError
from gtpin.output.shown import Presentation
from gtpin.report.poses import position_map
from gtpin.report.words import covariate_unit, with_unit

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from gtpin.data.dataset import Dataset


@dataclass(frozen=True)
class DatasetPresentation(Presentation):
    """A dataset; its table has a row for each measurement."""

    dataset: Dataset

    def short(self) -> str:
        """Numbers of measurements and poses, the instruments, and the covariates."""
        data = self.dataset
        visits = len(set(data.pose.tolist()))
        what = "measured positions" if data.orientation is None else "measured positions and orientations"
        if data.readings.names:
            what = f"readings by {', '.join(data.readings.names)}"
        return (
            f"Dataset of {data.robot}: {len(data)} {what} at {visits} poses\n"
            f"covariates: {', '.join(data.covariates) or 'none'}"
        )

    def text(self) -> str:
        """The text of :meth:`short`, the instruments, and the range of every column."""
        data = self.dataset
        lines = [self.short(), "", "instrument"]
        named = {one.name: one.kind for one in data.readings.tables if one.name}
        about = named or data.instrument.model_dump(exclude_none=True)
        lines += [f"  {name:<24}{value}" for name, value in about.items()]
        lines += ["", f"  {'column':<24}{'least':>14}{'most':>14}"]
        for name, column in self.table().items():
            if column.dtype.kind in "fi":
                lines.append(f"  {name!s:<24}{column.min():>14.6g}{column.max():>14.6g}")
        return "\n".join(lines) + "\n"

    def table(self) -> pd.DataFrame:
        """The columns of the tables, and the instrument of each row where instruments have names."""
        data = self.dataset
        columns = {"pose": data.pose, **dict(zip(command_names(data.n_actuators), data.q.T, strict=True))}
        names = np.array(data.readings.names, dtype=object)
        instrument = {"instrument": names[data.readings.of]} if len(names) else {}
        return pd.DataFrame({**columns, **instrument, **data.readings.columns, **data.covariates})

    def workspace(self, view: str, color: str | None) -> Figure:
        """Measured positions, or for readings the nominal TCP positions; coloured by a column of numbers."""
        dataset = with_positions(self.dataset)
        table = DatasetPresentation(dataset).table()
        values = None
        if color is not None:
            numbers = [str(name) for name in table if table[name].dtype.kind in "fi"]
            if color not in numbers:
                raise DatasetError("no such column of numbers", column=color, hint=f"there are {', '.join(numbers)}")
            values = table[color].to_numpy(dtype=np.float64)
        title = f"Measured positions, {dataset.robot}"
        return position_map(
            dataset.position,
            dataset.pose.tolist(),
            view,
            title,
            values,
            with_unit(color or "", covariate_unit(color or "")),
        )


present = DatasetPresentation
