"""``gtpin sensitivity``: Jacobian-based accuracy analysis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.accuracy.report import Accuracy, write_sensitivity
from gtpin.commands.terminal import AsJson, ModelReference, Output, Seed, tell
from gtpin.data import Commands, check_commands
from gtpin.model_folder import read_model
from gtpin.output import results_folder


def sensitivity(
    model: ModelReference,
    output: Output,
    poses: Annotated[
        Path | None, typer.Option("--poses", help="Table of commands; by default some that fill the workspace.")
    ] = None,
    seed: Seed = 0,
    as_json: AsJson = False,
) -> None:
    """Tell how each parameter moves the TCP, and what error to expect over the workspace."""
    found = read_model(model)
    q = None
    if poses is not None:
        asked = Commands.read(poses, found.robot.n_actuators)
        robot = found.robot
        check_commands(asked, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
        q = asked.q
    with results_folder(output) as folder:
        accuracy = write_sensitivity(found, q, folder, seed=seed)
    tell(accuracy.to_json(), f"{_text(accuracy)}\nWritten: {output / 'sensitivity.csv'}, {output / 'accuracy.json'}", as_json)


def _text(accuracy: Accuracy) -> str:
    told = accuracy.to_json()
    position, orientation = told["expected"]["position"], told["expected"]["orientation"]
    return (
        f"Expected error of {told['robot']} over {told['poses']} poses, from {told['uncertainty']}:\n"
        f"  position     mean {_um(position['mean'])}, 95 % {_um(position['p95'])}, maximum {_um(position['maximum'])}\n"
        f"  orientation  mean {_urad(orientation['mean'])}, 95 % {_urad(orientation['p95'])}, "
        f"maximum {_urad(orientation['maximum'])}"
    )


def _um(value: float) -> str:
    return f"{value * 1e6:.1f} um"


def _urad(value: float) -> str:
    return f"{value * 1e6:.1f} urad"
