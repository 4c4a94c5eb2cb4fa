"""A table over commands and temperatures of what to add to a controller's commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from gtpin.compensation.machine import CompensatedMachine
from gtpin.errors import ModelError
from gtpin.model.model import Model
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd


NODES = 11
"""Number of nodes of the grid along each actuator's range."""
ACTUATORS = 3
"""Largest number of actuators: with six, even five nodes for each actuator would give 15,625 rows per temperature."""
STEPS = 4
"""Number of Newton steps. Their Jacobian is that of the controller's geometry: each step leaves some thousandths of the
error."""


@dataclass(frozen=True, eq=False)
class GridTable:
    """What to add to commands, at the nodes of a grid.

    ``nodes``: for each actuator, (NODES,) commands, m or rad. ``temperatures``: for each of the table's temperature steps,
    the temperatures by covariate, degC. ``change``: (steps, NODES, ..., NODES, n) additions to the commands, m or rad; NaN
    where the robot can't reach the command.
    """

    nodes: tuple[Floats, ...]
    temperatures: tuple[Mapping[str, float], ...]
    change: Floats

    def applied(self, q: Floats, step: int) -> Floats:
        """(N, n) corrected commands for q (N, n), m or rad, at a temperature step, interpolated linearly.

        NaN in the cells of the grid that have a node out of reach.
        """
        from scipy.interpolate import RegularGridInterpolator

        return np.asarray(q + RegularGridInterpolator(self.nodes, self.change[step])(q))

    def frame(self) -> pd.DataFrame:
        """Columns ``q1 ... temp_... dq1 ...``, m or rad and degC. A row for each step and node; the last actuator varies
        fastest."""
        import pandas as pd

        n = len(self.nodes)
        q = np.stack(np.meshgrid(*self.nodes, indexing="ij"), axis=-1).reshape(-1, n)
        blocks = []
        for temperatures, change in zip(self.temperatures, self.change, strict=True):
            columns = {f"q{k + 1}": q[:, k] for k in range(n)} | {
                name: np.full(len(q), value) for name, value in temperatures.items()
            }
            blocks.append(pd.DataFrame(columns | {f"dq{k + 1}": change.reshape(-1, n)[:, k] for k in range(n)}))
        return pd.concat(blocks, ignore_index=True)


def grid_table(machine: CompensatedMachine, controller: Model, temperatures: Sequence[float] = ()) -> GridTable:
    """The table of a machine. It has a step for each combination of the ``temperatures``, degC, over the temperature columns.

    Raises `ModelError` if the robot has more than ``ACTUATORS`` actuators, or one without limits.
    """
    robot = machine.model.robot
    if robot.n_actuators > ACTUATORS:
        what = f"{robot.name} has {robot.n_actuators} actuators, too many for a table over commands"
        raise ModelError(what, hint="write corrected commands with --commands")
    if not np.isfinite([robot.lower, robot.upper]).all():
        raise ModelError(f"an actuator of {robot.name} has no range", hint="give its joint a <limit> in the URDF")
    nodes = tuple(np.linspace(a, b, NODES) for a, b in zip(robot.lower, robot.upper, strict=True))
    q = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, len(nodes))
    names = machine.temperature_columns if temperatures else ()
    steps = tuple(
        dict(zip(names, values, strict=True)) for values in product(sorted(set(temperatures)), repeat=len(names))
    )
    shape = (len(steps), *(NODES for _ in nodes), len(nodes))
    change = np.stack([_changes(replace(machine, temperatures=step), controller, q) for step in steps])
    return GridTable(nodes, steps, change.reshape(shape))


def _changes(machine: CompensatedMachine, controller: Model, q: Floats) -> Floats:
    """(N, n) additions to commands q (N, n) of the controller, m or rad; NaN for commands that the robot can't reach."""
    kinematics = controller.kinematics
    wanted = kinematics.forward(q)
    rows = np.flatnonzero(wanted.reached)
    change = np.full_like(q, np.nan)
    step = np.linalg.pinv(kinematics.command_jacobian(q[rows], wanted[rows])[:, :3])
    asked = q[rows].copy()
    for _ in range(STEPS):
        inside = np.isfinite(asked).all(axis=1)
        off = np.full((len(rows), 3), np.nan)
        off[inside] = wanted.T[rows[inside]] - machine.goes_to(asked[inside])
        asked += np.einsum("nij,nj->ni", step, off)
    change[rows] = asked - q[rows]
    return change
