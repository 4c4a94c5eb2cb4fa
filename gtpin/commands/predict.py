"""``gtpin predict``: what the instrument would read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from gtpin.accuracy.expected import expected_rms, unexplained_error
from gtpin.commands.terminal import (
    Actuators,
    AsJson,
    Force,
    Home,
    ModelReference,
    Tcp,
    chosen,
    not_its_input,
    output_option,
    tell,
)
from gtpin.data import Commands
from gtpin.data.checks import CheckedRows
from gtpin.data.files import read_table, write_table
from gtpin.data.table import Column
from gtpin.diagnosis.earlier import Earlier
from gtpin.errors import warn
from gtpin.export.loss import not_oriented
from gtpin.instruments.predicted import as_seen, instrument_of, predicted_readings
from gtpin.kinematics.rotations import skew
from gtpin.model.model import Model
from gtpin.model.model_folder import read_model
from gtpin.model.place import free_motions, without_place
from gtpin.model.predict import predict as run_prediction
from gtpin.model.predict import prediction_columns
from gtpin.output.results import result_file
from gtpin.report.words import length


def predict(
    model: ModelReference,
    commands: Annotated[Path, typer.Argument(help="CSV or Parquet table with the columns pose, q1 .. qn.")],
    output: Annotated[Path, output_option("CSV file for the poses.")],
    tcp: Tcp = None,
    actuators: Actuators = "",
    home: Home = "",
    instrument: Annotated[
        str | None,
        typer.Option(help="Name of an instrument of the model's dataset: write its readings.", metavar="<name>"),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Predict what the instrument would read, without noise."""
    not_its_input(output, commands)
    with result_file(output, force=force) as new:
        found = read_model(model, tcp=tcp, **chosen(actuators, home))
        table, expected = _table(found, commands, instrument)
        write_table(new, table)
    for note in not_oriented(found, of_target=True) if "qw" in table else ():
        warn(f"{output.name} {note}")
    what = "poses" if instrument is None else f"readings of {instrument}"
    rows = [
        dict(zip(table, row, strict=True))
        for row in zip(*(np.asarray(c).tolist() for c in table.values()), strict=True)
    ]
    tell(rows, f"{len(rows)} {what} predicted{expected}. Written: {output}", as_json)


def _table(model: Model, file: Path, instrument: str | None) -> tuple[dict[str, Column], str]:
    """The poses that the first tracker reads, or an instrument's readings, at the commands of a file; and the error to expect
    of positions, in words."""
    seen, tracker = as_seen(model)
    name = instrument or tracker
    if name is None:
        given = Commands.read(file, model.robot.n_actuators)
        return prediction_columns(given, run_prediction(seen, given)), _expected(seen, given)
    table = instrument_of(model, name).table
    given = Commands.read(file, model.robot.n_actuators, ids=table.ids)
    columns = read_table(given.file or file, ids=table.ids).columns
    rows = CheckedRows.of(given.file, given.row, len(given))
    ids = {column: rows.ids(columns[column], column) for column in table.ids if column in columns}
    if "session" in instrument_of(model, name).known and "session" in given.covariates:  # its stations
        ids["session"] = given.covariates["session"]
    poses = run_prediction(model, given)
    words = _expected(model, given, getattr(table, "target", None)) if table.kind == "tracker" else ""
    return {"pose": given.pose, **ids, **predicted_readings(model, poses, name, ids, given)}, words


def _expected(model: Model, given: Commands, target: object = None) -> str:
    """The error to expect of predicted positions, where the uncertainty of the geometry is known: of what the data do not
    determine, less where the machine stands as far as no instrument shows it, and of what the model does not explain.

    ``target``: where the target sits, m, TCP frame, if it was declared: its positions are predicted.
    """
    if model.covariance is None:
        return ""
    earlier, plain = Earlier(model), model.kinematics.forward(given.q)
    motion = earlier.jacobian(given.q, given.covariates, plain) @ earlier.root
    lever = plain.R @ (np.array(target) if isinstance(target, tuple) else np.zeros(3))
    moved = motion[:, :3] - skew(lever) @ motion[:, 3:6]
    power = (without_place(moved, plain.T + lever, free_motions(model)) ** 2).sum(axis=(1, 2))
    left = 3.0 * unexplained_error(model, model.kinematics.command_jacobian(given.q, plain))[0] ** 2
    known = model.unexplained is None or model.unexplained.noise_known
    size, largest = (length(expected_rms(float(one), left, noise_known=known)) for one in (power.mean(), power.max()))
    return f", with an expected error of {size} RMS (largest {largest}, pose {given.pose[int(power.argmax())]})"
