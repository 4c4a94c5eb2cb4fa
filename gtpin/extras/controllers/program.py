"""Commands of a program, corrected for all effects of a model: ``gtpin export --commands``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gtpin.compensation.compensate import TOLERANCE, attempted, machine_of
from gtpin.data import Commands
from gtpin.errors import GtpinError, UnreachableError, unheard, warn
from gtpin.export.loss import assumed_tool, um
from gtpin.extras.controllers.machine_error import left_of_commands
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.model.model_folder import in_doubt
from gtpin.model.predict import predicted
from gtpin.output.results import result_file
from gtpin.typing import Mask


def corrected_commands(model: Model, commands: Path, controller: Model | None, output: Path, *, force: bool) -> Path:
    """Write the commands that bring the TCP to the poses that the controller computed from the original commands.

    ``commands``: the table of these. ``controller``: the model of the controller's kinematics; None: the nominal robot.
    Commands whose pose the controller's model or the machine can't reach stay as they are.

    Raises `GtpinError` if the output is no ``.csv`` file, or the table can't be read; or if no pose can be reached. Warns:
    names the poses that are not corrected, and says which error to expect of the others.
    """
    if output.suffix.lower() != ".csv":
        raise GtpinError("corrected commands are a table", file=output, hint="name a .csv file")
    with result_file(output, force=force) as new:
        given = Commands.read(commands, model.robot.n_actuators)
        nominal = Model(type(model.geometry).nominal(model.robot))
        believed = controller or nominal
        meant = predicted(believed, Commands(given.pose, given.q, row=given.row, file=given.file))
        rotations = meant.R if model.robot.n_actuators >= 6 else None
        q, left = attempted(model, meant.T, rotations, given.covariates, given.q)
        met = left <= TOLERANCE
        if not met.any():
            hint = "check the commands, and the assembly that the robot's home chooses"
            raise UnreachableError("none of the poses can be reached", file=given.file, hint=hint)
        replace(given, q=np.where(met[:, None], q, given.q)).write(new)
    where = "these poses" if met.all() else f"the {met.sum()} poses that it corrects"
    notes = left_of_commands(model, q[met], where)
    if not met.all():
        named = ", ".join(f"{given.pose[i]} (row {given.row[i]})" for i in np.flatnonzero(~met))
        kept = f"{(~met).sum()} of {len(met)} commands as they were, because their poses can't be reached: {named}"
        notes = (f"leaves {kept}{_off(model, given, meant, ~met)}", *notes)
    for note in (*in_doubt(model), *notes, *assumed_tool(model)):
        warn(f"{output.name} {note}")
    return output


def _off(model: Model, given: Commands, meant: Poses, rows: Mask) -> str:
    """How far the machine is off at the rows that stay as they were, by the model, as text; empty where it can't be there."""
    rows = rows & np.isfinite(meant.T).all(axis=1)
    if not rows.any():
        return ""
    with unheard():
        there = machine_of(model).predict(given.q[rows], {name: v[rows] for name, v in given.covariates.items()})
    off = np.linalg.norm(there.T - meant.T[rows], axis=1)
    off = off[np.isfinite(off)]
    if not off.size:
        return ""
    rms, most = um(float(np.sqrt((off**2).mean()))), um(float(off.max()))
    return f"; there the TCP is off by {rms} um RMS, by the model, and {most} um at most"
