"""Errors of models 1 to 5 on held-out poses, side by side: the paper's Table I for any dataset, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.output.shown import Shown, present
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

Rows = npt.NDArray[np.intp]
Cost = Literal["pose", "closure"]

RESAMPLES = 2000
"""Number of bootstrap samples for each interval."""


@dataclass(frozen=True)
class Held:
    """One model's errors on held-out poses.

    - ``model``: 1 to 5.
    - ``row``: (N,) indices of the held-out poses among the dataset's poses within the measured tracks.
    - ``pose``: (N,) ids of these poses.
    - ``position``: (N,) length of each position error, m.
    - ``orientation``: (N,) angle of each orientation error, rad; None where orientation was not measured.
    - ``angles``: (N, 3) measured less predicted ZYZ Euler angles, rad; None where orientation was not measured.
    - ``closure_cost``: (k,) squared closure residual of each rod, summed over the held-out poses, m^4; None where it is not
      known.
    - ``measured``: (k,) True for rods on a measured track.
    """

    model: int
    row: Rows
    pose: npt.NDArray[np.object_]
    position: Floats
    orientation: Floats | None
    angles: Floats | None
    closure_cost: Floats | None
    measured: tuple[bool, ...]

    def figures(self, rows: Rows | slice = slice(None)) -> dict[str, float | None]:
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
        rng = np.random.default_rng(seed)
        _, visit = np.unique(self.pose.astype(str), return_inverse=True)
        order = np.argsort(visit, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(visit[order])) + 1)
        samples = []
        for _ in range(RESAMPLES):
            drawn = rng.integers(0, len(groups), len(groups))
            samples.append(self.figures(np.concatenate([groups[g] for g in drawn])))
        return {name: _interval([sample[name] for sample in samples]) for name in samples[0]}

    @staticmethod
    def joined(parts: Sequence[Held]) -> Held:
        """Join the errors of one model on several parts of a dataset, in the dataset's order."""
        row = np.concatenate([part.row for part in parts])
        order = np.argsort(row, kind="stable")
        costs = [part.closure_cost for part in parts if part.closure_cost is not None]

        def in_order(arrays: Sequence[npt.NDArray[Any] | None]) -> Any:
            known = [array for array in arrays if array is not None]
            return np.concatenate(known)[order] if known else None

        return replace(
            parts[0],
            row=row[order],
            pose=in_order([part.pose for part in parts]),
            position=in_order([part.position for part in parts]),
            orientation=in_order([part.orientation for part in parts]),
            angles=in_order([part.angles for part in parts]),
            closure_cost=np.sum(costs, axis=0) if costs else None,
            measured=tuple(any(rod) for rod in zip(*(part.measured for part in parts), strict=True)),
        )


def _interval(values: Sequence[float | None]) -> tuple[float, float] | None:
    if values[0] is None:
        return None
    low, high = np.percentile(np.array(values, dtype=float), (2.5, 97.5))
    return float(low), float(high)


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """The models that the dataset allows, side by side.

    Parameters
    ----------
    held
        The errors of each model, in the order of the models.
    seed
        Seed of the division into halves and of the bootstrap.
    cost
        What the fits minimised: see :func:`~gtpin.comparison.compare.compare`.
    dataset
        The data, for :meth:`save`; None where the comparison was not made by ``compare``.
    """

    held: tuple[Held, ...]
    seed: int
    cost: Cost
    dataset: Dataset | None = None

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
                "closure_cost_m4": None if held.closure_cost is None else held.closure_cost.tolist(),
                "measured_tracks": list(held.measured),
            }
            for held, interval in zip(self.held, self.intervals(), strict=True)
        ]
        return {"schema": "gtpin-compare/1", "cost": self.cost, "seed": self.seed, "models": rows}

    def save(self, folder: Path | str, *, force: bool = False) -> None:
        """Write what ``gtpin compare`` writes: ``compare.csv``, ``compare.json``, ``report.html`` and plots.

        With ``force``, files of these names that gtpin has not written are renamed (``NAME.old-1``).
        """
        present(self).save(Path(folder), force=force)

    def plot_errors(self) -> Figure:
        """Mean, root mean square and largest position error of each model, with 95 % intervals."""
        figure: Figure = present(self).errors()
        return figure

    def plot_angles(self, angle: str = "alpha") -> Figure:
        """Plot the errors of an Euler angle (ZYZ: ``alpha``, ``beta`` or ``gamma``) at each held-out pose."""
        figure: Figure = present(self).angles(angle)
        return figure
