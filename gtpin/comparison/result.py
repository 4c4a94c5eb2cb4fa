"""Errors of models 1 to 5 on held-out poses, side by side: the paper's Table I for any dataset, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions, log, zyz_change
from gtpin.output.shown import SavedResult, present
from gtpin.real import generator
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

RESAMPLES = 2000
"""Number of bootstrap samples for each interval."""


@dataclass(frozen=True)
class Held:
    """One model's errors on held-out poses.

    - ``model``: 1 to 5.
    - ``pose``: (N,) ids of the held-out poses.
    - ``position``: (N,) length of each position error, m.
    - ``orientation``: (N,) angle of each orientation error, rad; None where orientation was not measured.
    - ``angles``: (N, 3) measured less predicted ZYZ Euler angles, rad; None where orientation was not measured.
    """

    model: int
    pose: npt.NDArray[np.object_]
    position: Floats
    orientation: Floats | None
    angles: Floats | None

    @staticmethod
    def of(model: int, measured: Dataset, poses: Poses) -> Held:
        """The errors of a model that predicts ``poses`` (N) in place of those measured, both in the instrument's frame."""
        position = np.linalg.norm(measured.position - poses.T, axis=1)
        if measured.orientation is None:
            return Held(model, measured.pose, position, None, None)
        R = from_quaternions(measured.orientation)
        turned = np.linalg.norm(log(R @ np.swapaxes(poses.R, 1, 2)), axis=1)
        return Held(model, measured.pose, position, turned, zyz_change(R, poses.R))

    def figures(self, rows: npt.NDArray[np.intp] | slice = slice(None)) -> dict[str, float | None]:
        """Mean, largest and root mean square error of the poses ``rows``; the keys' last part is the unit (um, mrad)."""
        p = self.position[rows] * 1e6
        o = None if self.orientation is None else float(np.sqrt((self.orientation[rows] ** 2).mean()) * 1e3)
        return {
            "mean_um": float(p.mean()),
            "max_um": float(p.max()),
            "rms_um": float(np.sqrt((p**2).mean())),
            "orientation_rms_mrad": o,
        }

    def intervals(self, seed: int) -> dict[str, tuple[float, float] | None]:
        """95 % bootstrap intervals of :meth:`figures`; all visits to a pose are drawn together.

        The interval of the largest error ends at the largest observed error: resampling can't show poses that were not visited.
        """
        rng = generator(seed)
        names, visit = np.unique(self.pose.astype(str), return_inverse=True)
        samples = []
        for _ in range(RESAMPLES):
            times = np.bincount(rng.integers(0, len(names), len(names)), minlength=len(names))
            samples.append(self.figures(np.repeat(np.arange(len(visit)), times[visit])))
        return {name: _interval([sample[name] for sample in samples]) for name in samples[0]}


def _interval(values: Sequence[float | None]) -> tuple[float, float] | None:
    if values[0] is None:
        return None
    low, high = np.percentile(np.array(values, dtype=float), (2.5, 97.5))
    return float(low), float(high)


@dataclass(frozen=True, repr=False)
class Comparison(SavedResult):
    """The models that the dataset allows, side by side.

    Parameters
    ----------
    held
        The errors of each model, in the order of the models.
    seed
        Seed of the division into halves and of the bootstrap.
    dataset
        The data.
    warnings
        Texts of all warnings, also of those when the dataset was read.
    """

    held: tuple[Held, ...]
    seed: int
    dataset: Dataset
    warnings: tuple[str, ...] = ()

    def table(self) -> pd.DataFrame:
        """``model, mean_um, max_um, rms_um, orientation_rms_mrad, poses``, one row per model."""
        import pandas as pd

        return pd.DataFrame([{"model": h.model, **h.figures(), "poses": len(h.position)} for h in self.held])

    def intervals(self) -> list[dict[str, tuple[float, float] | None]]:
        """95 % bootstrap intervals of the errors in :meth:`table`, one entry per model."""
        return list(self._intervals)

    @cached_property
    def _intervals(self) -> list[dict[str, tuple[float, float] | None]]:
        return [held.intervals(self.seed) for held in self.held]

    def to_json(self) -> dict[str, Any]:
        """The content of ``compare.json``."""
        rows = [
            {
                "model": held.model,
                **held.figures(),
                "poses": len(held.position),
                "interval": {name: None if ends is None else list(ends) for name, ends in interval.items()},
            }
            for held, interval in zip(self.held, self.intervals(), strict=True)
        ]
        return {"schema": "gtpin-compare/1", "seed": self.seed, "models": rows, "warnings": list(self.warnings)}

    def plot_errors(self) -> Figure:
        """Mean, root mean square and largest position error of each model, with 95 % intervals."""
        figure: Figure = present(self).errors()
        return figure

    def plot_angles(self, angle: str = "alpha") -> Figure:
        """Plot the errors of an Euler angle (ZYZ: ``alpha``, ``beta`` or ``gamma``) at each held-out pose."""
        figure: Figure = present(self).angles(angle)
        return figure
