"""Datasets and poses as text and table, and positions over the workspace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.before_fit import with_positions
from gtpin.data.names import command_names
from gtpin.errors import DatasetError, GtpinError
from gtpin.model.measured_robot import robot_of
from gtpin.output.shown import Presentation
from gtpin.report.figure import DATA, SCALE, ZERO, Drawing, alone, colorbar, escaped, scatter, titled
from gtpin.report.words import covariate_unit, with_unit
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

    from gtpin.data.dataset import Dataset
    from gtpin.kinematics.poses import Poses

VIEWS = ("xy", "xz", "yz")
"""Pairs of axes of a map of positions."""
FLAT = 0.3
"""Smallest height of a map over its width, and smallest width over its height for more than one tick: others overlap."""


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
        import pandas as pd

        data = self.dataset
        columns = {"pose": data.pose, **dict(zip(command_names(data.n_actuators), data.q.T, strict=True))}
        names = np.array(data.readings.names, dtype=object)
        instrument = {"instrument": names[data.readings.of]} if len(names) else {}
        return pd.DataFrame({**columns, **instrument, **data.readings.columns, **data.covariates})

    def workspace(self, view: str, color: str | None) -> Figure:
        """Measured positions, or for readings the nominal TCP positions; coloured by a column of numbers."""
        dataset = with_positions(self.dataset)
        table = DatasetPresentation(dataset).table()
        title, values, bar = f"Measured positions, {dataset.robot}", None, ""
        if color is not None:
            numbers = [str(name) for name in table if table[name].dtype.kind in "fi"]
            if color not in numbers:
                raise DatasetError("no such column of numbers", column=color, hint=f"there are {', '.join(numbers)}")
            values = table[color].to_numpy(dtype=np.float64)
            bar = with_unit(color, covariate_unit(color, robot_of(dataset)))
        return position_map(dataset.position, view, dataset.pose.tolist(), title, values, bar)


@dataclass(frozen=True)
class PosesPresentation(Presentation):
    """Poses; their table has positions and quaternions."""

    poses: Poses

    def short(self) -> str:
        """The number of poses, and the box that they span."""
        there, count = self.poses.T[self.poses.reached], len(self.poses)
        first = f"Poses: {count}"
        if len(there) < count:
            first += f", of which {count - len(there)} could not be computed"
        if not len(there):
            return first
        ends = zip("xyz", there.min(axis=0), there.max(axis=0), strict=True)
        return f"{first}\n{', '.join(f'{axis} {low:.4f} to {high:.4f}' for axis, low, high in ends)} m"

    def text(self) -> str:
        """The text of :meth:`short`, and the table."""
        return f"{self.short()}\n\n{self.table().to_string(max_rows=60)}\n"

    def table(self) -> pd.DataFrame:
        """The columns ``x y z qw qx qy qz``: m, and unit quaternions."""
        import pandas as pd

        values = np.hstack([self.poses.T, self.poses.quaternions])
        return pd.DataFrame(values, columns=["x", "y", "z", "qw", "qx", "qy", "qz"])

    def workspace(self, view: str) -> Figure:
        """The positions in a plane of their frame."""
        return position_map(self.poses.T, view, range(1, len(self.poses) + 1), "Positions of the TCP")


def position_map(
    T: Floats, view: str, names: Sequence[object], title: str, color: Floats | None = None, color_title: str = ""
) -> Figure:
    """A map of positions (N, 3), m, of poses with (N,) names, in the colours of (N,) values."""
    marker: dict[str, Any] = {"color": DATA}
    if color is not None:
        marker = {"color": color, "colorscale": SCALE, "showscale": True, "colorbar": colorbar(color_title)}
    text = [escaped(str(name)) for name in names]
    points = map_points(T, view, text, "pose %{text}: %{x:.4f} m, %{y:.4f} m<extra></extra>", marker)
    return alone(Drawing([points], map_layout(T, view)), title)


def map_points(T: Floats, view: str, text: npt.ArrayLike, hover: str, marker: Mapping[str, Any]) -> dict[str, Any]:
    """The trace of positions (N, 3), m, over two of their axes: ``xy``, ``xz`` or ``yz``.

    Raises `GtpinError` if there is no such view.
    """
    if view not in VIEWS:
        raise GtpinError(f"there is no view {view!r}", hint=f"give one of {', '.join(VIEWS)}")
    x, y = (T[:, "xyz".index(axis)] for axis in view)
    look = {"size": 6, "line": {"color": ZERO, "width": 0.5}, **marker}
    return scatter("markers", x, y, marker=look, text=text, hovertemplate=hover)


def map_layout(T: Floats, view: str, **more: Any) -> dict[str, Any]:
    """The layout of a map of positions (N, 3), m, over the two axes of ``view``, in equal scales."""
    layout = titled(f"{view[0]} (m)", f"{view[1]} (m)", **more)
    layout["yaxis"] |= {"scaleanchor": "x", "constrain": "domain"}
    layout["xaxis"]["constrain"] = "domain"
    across, up = (T[:, "xyz".index(name)] for name in view)
    wide, high = (float(np.ptp(values)) if len(T) else 0.0 for values in (across, up))
    if high < FLAT * wide:
        middle = float(up.max() + up.min()) / 2.0
        layout["yaxis"] |= {"range": [middle - FLAT * wide / 2.0, middle + FLAT * wide / 2.0], "nticks": 3}
    elif wide < FLAT * high:
        middle = float(across.max() + across.min()) / 2.0
        layout["xaxis"] |= {"tickvals": [middle], "ticktext": [f"{round(middle, 3) + 0.0:g}"]}
    return layout
