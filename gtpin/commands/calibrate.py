"""``gtpin calibrate``: identify the geometry."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import typer

from gtpin.calibration.calibrate import calibrate as run_calibration
from gtpin.commands.terminal import (
    AsJson,
    CartOrientation,
    DatasetFolder,
    FewerPoses,
    Force,
    Output,
    Tcp,
    TrustData,
    progress_of,
    read_dataset,
    result_in,
)
from gtpin.effects.active import ActiveEffect
from gtpin.errors import ModelError
from gtpin.model.measured_robot import check_same_robot
from gtpin.model.model_folder import read_model
from gtpin.report.calibration import CALIBRATION


def calibrate(
    dataset: DatasetFolder,
    output: Output,
    model: Annotated[
        int | None,
        typer.Option(help="One of the paper's models 1 to 5 instead of the default parameters.", min=1, max=5),
    ] = None,
    orientations: CartOrientation = False,
    keep_effects: Annotated[
        str | None,
        typer.Option(
            help="Folder of an earlier model of this machine: its effects stay as they are.", metavar="<model>"
        ),
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            help="A parameter that is known (length[2a]=2.043, m or rad); may be repeated.", metavar="<name=value>"
        ),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(help="A parameter whose tolerance says nothing; may be repeated.", metavar="<name>"),
    ] = None,
    zeros: Annotated[
        bool, typer.Option("--zeros", help="The zeros of the joints are parameters too: zero[JOINT].")
    ] = False,
    tcp: Tcp = None,
    poses: FewerPoses = None,
    trust_data: TrustData = False,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Identify the robot's geometry from measured poses."""
    with result_in(output, CALIBRATION, force=force, as_json=as_json) as take:
        read = read_dataset(dataset, tcp, trust=trust_data)
        kept: tuple[ActiveEffect, ...] = ()
        if keep_effects is not None:
            earlier = read_model(keep_effects, tcp=tcp)
            check_same_robot(earlier.robot, read)
            kept = earlier.effects
        with progress_of("calibrating", {"rough fit": 0.1, "fit": 0.4}) as progress:
            found = run_calibration(
                read,
                model=model,
                orientations=orientations,
                zeros=zeros,
                fix=_fixed(fix or ()),
                free=free or (),
                keep_effects=kept,
                poses=poses,
                progress=progress,
            )
        take(found)


def _fixed(given: Iterable[str]) -> dict[str, float]:
    """Values by name of ``NAME=VALUE``; raises `ModelError` where one is no number."""
    found = {}
    for text in given:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            raise ModelError(f"--fix {text}", hint="give NAME=VALUE, in m or rad: length[2a]=2.043") from None
    return found
