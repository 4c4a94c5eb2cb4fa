"""How poses are shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from gtpin.output.shown import Presentation
from gtpin.report.show.positions import position_map

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from gtpin.kinematics.poses import Poses


@dataclass(frozen=True)
class PosesPresentation(Presentation):
    """Poses; their table has positions and quaternions."""

    poses: Poses

    def short(self) -> str:
        """The number of poses, and the box that they span."""
        poses = self.poses
        there = poses.T[poses.reached]
        first = f"Poses: {len(poses)}"
        if len(there) < len(poses):
            first += f", of which {len(poses) - len(there)} could not be computed"
        if not len(there):
            return first
        ends = zip("xyz", there.min(axis=0), there.max(axis=0), strict=True)
        return f"{first}\n{', '.join(f'{axis} {low:.4f} to {high:.4f}' for axis, low, high in ends)} m"

    def text(self) -> str:
        """The text of :meth:`short`, and the table."""
        return f"{self.short()}\n\n{self.table().to_string(max_rows=60)}\n"

    def table(self) -> pd.DataFrame:
        """The columns ``x y z qw qx qy qz``: m, and unit quaternions."""
        values = np.hstack([self.poses.T, self.poses.quaternions])
        return pd.DataFrame(values, columns=["x", "y", "z", "qw", "qx", "qy", "qz"])

    def workspace(self, view: str) -> Figure:
        """The positions in a plane of their frame."""
        return position_map(self.poses.T, range(1, len(self.poses) + 1), view, "Positions of the TCP")


present = PosesPresentation
