"""Commands of a program, corrected for all effects of a model: ``gtpin export --commands``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gtpin.compensation.compensate import TOLERANCE, attempted, machine_of, near_singular, nearest
from gtpin.data import Commands
from gtpin.errors import GtpinError, UnreachableError, listed, unheard, warn
from gtpin.export.loss import assumed_tool
from gtpin.extras.controllers.machine_error import left_of_commands
from gtpin.kinematics.inverse import INSIDE, errors_of
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.model.model_folder import in_doubt
from gtpin.model.predict import predicted
from gtpin.output.results import result_file
from gtpin.typing import Floats, Mask


def corrected_commands(model: Model, commands: Path, controller: Model | None, output: Path, *, force: bool) -> Path:
    """Write the commands that bring the TCP to the poses that the controller computed from the original commands.

    ``commands``: the table of these. ``controller``: the model of the controller's kinematics; None: the nominal robot.
    Where the machine can't reach a pose, or near a singular posture, the position is right and the orientation as near as it
    can be; where it can't reach the position, or the controller's model has no pose, the command stays as it is.

    Raises `GtpinError` if the output is no ``.csv`` file, or the table can't be read; or if no pose can be reached. Warns:
    names the poses that are not corrected, or in part, with their errors, and says which error to expect of the others.
    """
    if output.suffix.lower() != ".csv":
        raise GtpinError("corrected commands are a table", file=output, hint="name a .csv file")
    with result_file(output, force=force) as new:
        given = Commands.read(commands, model.robot.n_actuators)
        nominal = Model(type(model.geometry).nominal(model.robot))
        believed = controller or nominal
        meant = predicted(believed, Commands(given.pose, given.q, row=given.row, file=given.file))
        turning = model.robot.n_actuators >= 6
        q, left = attempted(model, meant.T, meant.R if turning else None, given.covariates, given.q)
        met, error = left <= TOLERANCE, np.full((len(q), 6), np.nan)
        if turning:
            met[met] &= ~near_singular(model, q[met])  # there a small error takes large motions
            hard = ~met & np.isfinite(meant.T).all(axis=1)
            some = {name: values[hard] for name, values in given.covariates.items()}
            with unheard():
                q[hard], error[hard] = nearest(model, meant.T[hard], meant.R[hard], some, given.q[hard])
        met |= (np.abs(error) <= TOLERANCE).all(axis=1)
        placed = ~met & (np.abs(error[:, :3]) <= TOLERANCE).all(axis=1)
        kept = ~(met | placed)
        if kept.all():
            hint = "check the commands, and the assembly that the robot's home chooses"
            raise UnreachableError("none of the poses can be reached", file=given.file, hint=hint)
        q[kept] = given.q[kept]
        replace(given, q=q).write(new)
    where = "these poses" if not kept.any() else f"the {(~kept).sum()} poses that it corrects"
    notes = left_of_commands(model, q[~kept], where)
    if placed.any():
        rows, why = _rows(given, placed, error), "their poses can't be reached, or only by large motions"
        notes = (f"brings {placed.sum()} of {len(q)} to the position alone, because {why}: {rows}", *notes)
    if kept.any():
        rows = _rows(given, kept, _off(model, given, meant, kept))
        why = "because their poses can't be reached"
        notes = (f"leaves {kept.sum()} of {len(q)} commands as they were, {why}: {rows}", *notes)
    robot = model.robot
    beyond = np.maximum(robot.lower - q, q - robot.upper) - np.maximum(
        robot.lower - given.q, given.q - robot.upper
    ).clip(0)
    if (far := (beyond > INSIDE)).any():
        rows = listed([f"q{j + 1} of {given.pose[i]} (row {given.row[i]})" for i, j in np.argwhere(far)])
        notes = (f"has commands outside of the robot's range: {rows}", *notes)
    for note in (*in_doubt(model), *notes, *assumed_tool(model)):
        warn(f"{output.name} {note}")
    return output


def _rows(given: Commands, rows: Mask, error: Floats) -> str:
    """The names of some rows (N,), with their errors (N, 6), m and rad, by the model, where these are known."""
    words = []
    for i in np.flatnonzero(rows):
        mm, mrad = (1e3 * float(np.linalg.norm(part)) for part in (error[i, :3], error[i, 3:]))
        sizes = [f"{mm:.3g} mm"] if mm > 1e3 * TOLERANCE else []
        off = f" off by {' and '.join([*sizes, f'{mrad:.3g} mrad'])}" if np.isfinite(mm + mrad) else ""
        words.append(f"{given.pose[i]} (row {given.row[i]}){off}")
    return listed(words)


def _off(model: Model, given: Commands, meant: Poses, rows: Mask) -> Floats:
    """(N, 6) errors of the machine at the commands of some rows (N,), by the model, m and rad; NaN where it can't be there."""
    error, rows = np.full((len(rows), 6), np.nan), rows & np.isfinite(meant.T).all(axis=1)
    with unheard():
        there = machine_of(model).predict(given.q[rows], {name: v[rows] for name, v in given.covariates.items()})
    rows[rows] = there.reached
    error[rows] = errors_of(there[there.reached], meant.T[rows], meant.R[rows])
    return error
