"""A table over commands and temperatures, as a CSV file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gtpin.compensation.grid_table import GridTable, grid_table
from gtpin.compensation.machine import Machine, parts
from gtpin.errors import ModelError
from gtpin.export.tables_for import TablesFor, Written
from gtpin.export.tables_left import POINTS, Left, both_approaches, by_parts, check_any
from gtpin.model.model import Model


def grid_file(model: Model, file: Path, wanted: TablesFor, session: str | None = None) -> Written:
    """The table; see :func:`~gtpin.compensation.grid_table.grid_table`.

    Raises
    ------
    GtpinError
        If the robot has too many actuators for such a table, or one without a range; if temperatures are given and no effect
        depends on one; or if there is nothing to correct.
    """
    if wanted.box is not None or wanted.firmware is not None:
        raise ModelError("a table over commands takes no --box and no --firmware", hint="leave them out")
    machine, unknown = wanted.machine(model, session)
    believed = wanted.believed(model)
    table = grid_table(machine, believed, wanted.temperatures)
    last = replace(machine, temperatures=table.temperatures[-1])

    def left(part: Machine) -> Left:
        return _left(part, believed, grid_table(part, believed, wanted.temperatures))

    remains = _left(last, believed, table)
    check_any([remains])
    words, absent = by_parts(parts(last, believed), left)
    notes = [remains.words("the range of the actuators", last.temperatures), *words]
    missing = np.isnan(table.change[0]).any(axis=-1)
    if missing.any():
        notes.append(f"has no numbers at {missing.sum()} of {missing.size} nodes, where the robot can't be")
    text = table.frame().to_csv(index=False, lineterminator="\n", float_format="%.10g")
    return Written({file.name: text}, (*unknown, *absent), tuple(notes))


def _left(machine: Machine, controller: Model, table: GridTable) -> Left:
    """Errors at commands of Halton's sequence, in cells of the table without NaN, at its last temperature step."""
    from scipy.stats import qmc

    low, high = (np.array([nodes[k] for nodes in table.nodes]) for k in (0, -1))
    q = low + (high - low) * qmc.Halton(len(low), scramble=False).random(POINTS + 1)[1:]
    asked = table.applied(q, len(table.temperatures) - 1)
    wanted = controller.kinematics.forward(q)
    inside = wanted.reached & np.isfinite(asked).all(axis=1)
    at = replace(machine, temperatures=table.temperatures[-1])
    approach = both_approaches(int(inside.sum()))
    before, after = (at.goes_to(some[inside], approach) - wanted.T[inside] for some in (q, asked))
    kept = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    if not kept.any():
        raise ModelError("the robot can't be anywhere between the nodes of the table", hint="check its limits")
    return Left(before[kept], after[kept])
