"""Commands of a program, corrected for all effects of a model: ``gtpin export --commands``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gtpin.compensation.compensate import compensate
from gtpin.data import Commands
from gtpin.errors import GtpinError, warn
from gtpin.export.loss import assumed_tool
from gtpin.extras.controllers.machine_error import left_of_commands
from gtpin.model.model import Model
from gtpin.model.predict import predict
from gtpin.output.results import result_file


def corrected_commands(model: Model, commands: Path, controller: Model | None, output: Path, *, force: bool) -> Path:
    """Write the commands that bring the TCP to the poses that the controller computed from the original commands.

    ``commands``: the table of these. ``controller``: the model of the controller's kinematics; None: the nominal robot.

    Raises `GtpinError` if the output is no ``.csv`` file, the table can't be read, or a pose can't be reached.
    """
    if output.suffix.lower() != ".csv":
        raise GtpinError("corrected commands are a table", file=output, hint="name a .csv file")
    with result_file(output, force=force) as new:
        given = Commands.read(commands, model.robot.n_actuators)
        nominal = Model(type(model.geometry).nominal(model.robot))
        believed = controller or nominal
        meant = predict(believed, Commands(given.pose, given.q, row=given.row, file=given.file))
        rotations = meant.R if model.robot.n_actuators >= 6 else None
        q = compensate(model, meant.T, given.covariates, rotations=rotations, start=given.q)
        replace(given, q=q).write(new)
    for note in (*left_of_commands(model, q), *assumed_tool(model)):
        warn(f"{output.name} {note}")
    return output
