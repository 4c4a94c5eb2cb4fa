"""``gtpin predict``: what the instrument would read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import AsJson, Force, ModelReference, Tcp, not_its_input, output_path, tell
from gtpin.data import Commands
from gtpin.model.model_folder import read_model
from gtpin.model.predict import predict as run_prediction
from gtpin.model.predict import prediction_table
from gtpin.output.results import result_file


def predict(
    model: ModelReference,
    commands: Annotated[
        Path, typer.Argument(help="CSV or Parquet table with the columns pose, q1 .. qn.", show_default=False)
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="CSV file for the poses.", show_default=False, parser=output_path, metavar="<path>"
        ),
    ],
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Predict what the instrument would read, without noise."""
    not_its_input(output, commands)
    with result_file(output, force=force) as new:
        found = read_model(model, tcp=tcp)
        given = Commands.read(commands, found.robot.n_actuators)
        table = prediction_table(given, run_prediction(found, given))
        table.to_csv(new, index=False, lineterminator="\n")
    tell(table.to_dict(orient="records"), f"{len(table)} poses predicted. Written: {output}", as_json)
