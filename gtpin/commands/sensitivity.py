"""``gtpin sensitivity``: Jacobian-based accuracy analysis."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from gtpin.accuracy.analysis import analyse
from gtpin.commands.terminal import (
    Actuators,
    AsJson,
    Force,
    Home,
    ModelReference,
    Output,
    Seed,
    Tcp,
    chosen,
    progress_of,
    result_in,
)
from gtpin.data import Commands
from gtpin.errors import noted, warn
from gtpin.export.loss import assumed_tool
from gtpin.model.model_folder import read_model
from gtpin.model.predict import predict
from gtpin.report.accuracy import AccuracyPresentation


def sensitivity(
    model: ModelReference,
    output: Output,
    poses: Annotated[
        Path | None, typer.Option(help="Table of commands; by default some that fill the workspace.")
    ] = None,
    tcp: Tcp = None,
    actuators: Actuators = "",
    home: Home = "",
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Show how each parameter moves the TCP, and the expected error over the workspace."""
    with (
        result_in(output, AccuracyPresentation.files, force=force, as_json=as_json) as take,
        progress_of("sensitivity") as progress,
        noted() as texts,
    ):
        measured = read_model(model, tcp=tcp, **chosen(actuators, home))
        for text in assumed_tool(measured):
            warn(f"the model {text}")
        found = measured.of_tool()
        q = None
        if poses is not None:
            given = Commands.read(poses, found.robot.n_actuators)
            # Only for its errors, which name the row of a command that the robot can't reach. Effects are left out: the
            # analysis is of the geometry alone.
            predict(replace(found, effects=()), given)
            q = given.q
        progress("each parameter at each pose", 0, float("nan"))
        accuracy = analyse(found, q, seed=seed)
        take(replace(accuracy, warnings=tuple(dict.fromkeys(texts))))
