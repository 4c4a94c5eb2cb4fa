"""The paper's numbers, and gtpin's beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.euler import zyz
from gtpin.accuracy.sensitivity import sensitivity
from gtpin.accuracy.steps import PARAMETERS
from gtpin.model import Model
from gtpin.paper.grid import FITTED, RECOVERED, Grid
from gtpin.paper.table1 import expected_table1
from gtpin.paper.tables import tables

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """Printed numbers that belong together.

    Parameters
    ----------
    name, unit
        What they are.
    rows, columns
        Names of the rows and columns.
    printed, ours
        (r, c) the paper's numbers and gtpin's.
    """

    name: str
    unit: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    printed: Floats
    ours: Floats

    @property
    def ratio(self) -> Floats:
        """(r, c) gtpin's numbers over the paper's."""
        return self.ours / self.printed

    @property
    def worst(self) -> float:
        """Largest relative deviation."""
        return float(np.abs(self.ratio - 1.0).max())

    @property
    def rms(self) -> float:
        """Root mean square of the relative deviations."""
        return float(np.sqrt(((self.ratio - 1.0) ** 2).mean()))


def compare_table3(model: Model, grid: Grid = RECOVERED) -> tuple[Block, ...]:
    """Table III: blocks S_pos, S_rot and S_cost, each first for the rows L, P and C, then for the track directions.

    Sums over 61 poses are 61 times the mean over the grid; S_cost is the expectation over Gaussian residuals of model 5's
    costs. Links 2a and 2b have no track direction in model 5, so the last blocks leave them out.
    """
    printed = tables()
    q = grid.commands(model)
    found = sensitivity(model, q, sigmas=printed.closure_sigmas(5)).exact
    assert found.cost is not None
    share = printed.measurement.calibration_poses / len(q)
    own = np.array([source == 3 for source in printed.source])
    directions = tuple(name for name in PARAMETERS if name not in FITTED)
    blocks = []
    for rows, columns, what in ((FITTED, np.ones_like(own), ""), (directions, own, ", track directions")):
        index = [PARAMETERS.index(name) for name in rows]
        names = tuple(name for name, there in zip(printed.links, columns, strict=True) if there)
        sums: tuple[tuple[str, str, Mapping[str, Floats], Floats], ...] = (
            ("S_pos", "mm", printed.position_mm, 1e3 * found.position),
            ("S_rot", "rad", printed.rotation_rad, found.rotation),
            ("S_cost", "m^4", printed.cost_m4, found.cost),
        )
        for name, unit, told, ours in sums:
            table = np.array([told[row] for row in rows])[:, columns]
            blocks.append(Block(name + what, unit, rows, names, table, share * ours[index][:, columns]))
    return tuple(blocks)


def compare_table1(model: Model, grid: Grid = RECOVERED, seed: int = 0) -> tuple[Block, ...]:
    """Table I from Table II's costs: mean, and the largest of 61 poses."""
    printed = tables()
    found = expected_table1(model, grid.commands(model), seed=seed)
    models = ("1", "2", "3", "4", "5")
    mean = 1e6 * np.array([[error.position.mean for error in found]])
    largest = 1e6 * np.array([[error.position.maximum for error in found]])
    return (
        Block("Table I, mean", "um", ("mean",), models, printed.mean_um[None], mean),
        Block("Table I, maximum", "um", ("max",), models, printed.max_um[None], largest),
    )


def compare_orientation(model: Model, grid: Grid = RECOVERED) -> Block:
    """Ranges of the ZYZ angles alpha and beta over the whole grid; the paper prints one digit of each."""
    _, poses = grid.all_commands(model)
    ranges = np.rad2deg(np.ptp(zyz(poses.R), axis=0))[None, :2]
    told = tables().measurement.orientation_range_deg
    names = ("alpha", "beta")
    return Block("ZYZ ranges", "deg", ("range",), names, np.array([[told[name] for name in names]]), ranges)
