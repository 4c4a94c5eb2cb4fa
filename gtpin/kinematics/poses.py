"""Poses of the TCP, many at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from gtpin.kinematics.chunks import chunks
from gtpin.kinematics.rotations import log, to_quaternions
from gtpin.output.results import result_file
from gtpin.output.shown import Presentation, Shown

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Poses(Shown):
    """Positions T (N, 3), m, and rotations R (N, 3, 3) from the TCP frame to a frame that the maker names.

    A pose that could not be computed is NaN throughout.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.read_model("gantry_tau")
    >>> poses = model.predict(model.robot.home_q[None])
    >>> poses.T.shape, poses.R.shape
    ((1, 3), (1, 3, 3))
    >>> poses.to_dataframe().columns.tolist()
    ['x', 'y', 'z', 'qw', 'qx', 'qy', 'qz']
    """

    T: Floats
    R: Floats

    def __len__(self) -> int:
        return len(self.T)

    def __getitem__(self, rows: npt.NDArray[np.generic] | slice) -> Poses:
        return Poses(self.T[rows], self.R[rows])

    @property
    def reached(self) -> npt.NDArray[np.bool_]:
        """(N,) which poses are there."""
        return np.isfinite(self.T[:, 0])

    @property
    def quaternions(self) -> Floats:
        """(N, 4) unit quaternions, scalar first; NaN where a pose is not there."""
        wxyz = np.full((len(self), 4), np.nan)
        wxyz[self.reached] = to_quaternions(self.R[self.reached])
        return wxyz

    def moved(self, T: Floats, R: Floats) -> Poses:
        """The same poses in a frame in which the present one lies at T (3,), turned by R (3, 3)."""
        return Poses(self.T @ R.T + T, R @ self.R)

    def minus(self, other: Poses) -> Floats:
        """(N, 6) these poses less others: position, m, and rotation vector, rad, both in the common frame.

        NaN where one of the two is not there.
        """
        difference = np.full((len(self), 6), np.nan)
        for rows in chunks(len(self)):
            one, two, part = self[rows], other[rows], difference[rows]
            both = one.reached & two.reached
            part[both, :3] = one.T[both] - two.T[both]
            part[both, 3:] = log(one.R[both] @ np.swapaxes(two.R[both], 1, 2))
        return difference

    def save(self, file: Path | str, *, force: bool = False) -> None:
        """Write a CSV file with the columns ``pose x y z qw qx qy qz``, as ``gtpin predict`` does; poses count from 1.

        With ``force``, a file that gtpin has not written is moved aside (``NAME.old-1``), and not an error.
        """
        table = self.to_dataframe()
        table.insert(0, "pose", range(1, len(table) + 1))
        with result_file(Path(file), force=force) as new:
            table.to_csv(new, index=False, lineterminator="\n")

    def plot_workspace(self, view: str = "xy") -> Figure:
        """The positions, seen along two axes: ``xy``, ``xz`` or ``yz``."""
        from gtpin.report.show.positions import position_map

        return position_map(self.T, range(1, len(self) + 1), view, "Positions of the TCP")

    def _presentation(self) -> Presentation:
        from gtpin.report.show.poses import PosesPresentation

        return PosesPresentation(self)
