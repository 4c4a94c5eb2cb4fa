"""Commands of a program, corrected for all effects of a model: ``gtpin export --commands``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gtpin.compensation.compensate import TOLERANCE, attempted
from gtpin.data import Commands
from gtpin.errors import GtpinError, UnreachableError, warn
from gtpin.export.loss import assumed_tool
from gtpin.extras.controllers.machine_error import left_of_commands
from gtpin.model.model import Model
from gtpin.model.predict import predicted
from gtpin.output.results import result_file


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
    notes = left_of_commands(model, q[met])
    if not met.all():
        named = ", ".join(f"{given.pose[i]} (row {given.row[i]})" for i in np.flatnonzero(~met))
        text = (
            f"leaves {(~met).sum()} of {len(met)} commands as they were, because their poses can't be reached: {named}"
        )
        notes = (text, *notes)
    for note in (*notes, *assumed_tool(model)):
        warn(f"{output.name} {note}")
    return output
