"""``gtpin export``: the model for other software."""

from __future__ import annotations

import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import (
    ZERO,
    Actuators,
    AsJson,
    Force,
    Home,
    ModelReference,
    Origin,
    Tcp,
    chosen,
    not_its_input,
    output_option,
    tell,
)
from gtpin.compensation.compensate import machine_of
from gtpin.errors import GtpinError, GtpinWarning, warn
from gtpin.export.box import Box
from gtpin.export.export import export as run_export
from gtpin.export.export import format_names, writer_of
from gtpin.export.loss import not_determined
from gtpin.export.writer import TablesFor
from gtpin.extensions import extension
from gtpin.model.measured_robot import check_alike
from gtpin.model.model import Model
from gtpin.model.model_folder import read_model


def _format(name: str) -> str:
    if name not in format_names():
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(format_names())}")
    return name


def export(
    model: ModelReference,
    output: Annotated[
        Path,
        output_option(
            "File; its suffix determines the format: .urdf, .yaml (plus a URDF, for example-parallel-robots), .diff, .sdf, "
            ".xml (MuJoCo), .csv (corrections of the actuators, or of --commands), .comp (LinuxCNC, a file for each joint), "
            ".cfg (Klipper), .g (RepRapFirmware, with a height map)."
        ),
    ],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar=f"<{'|'.join(format_names())}>",
            parser=_format,
            help="The format, where the suffix is another.",
        ),
    ] = None,
    diff: Annotated[
        bool, typer.Option("--diff", help="What changes in the robot's URDF: origins of joints and anchors of loops.")
    ] = False,
    session: Annotated[
        str | None, typer.Option(help="Tables of corrections, and .xml: whose zero shifts they hold.")
    ] = None,
    commands: Annotated[
        Path | None, typer.Option(help="Write these commands again (.csv), corrected for all effects of the model.")
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            help="With --commands, .cfg, .g and grid: the model of the controller's kinematics; by default the nominal robot."
        ),
    ] = None,
    temperature: Annotated[
        list[float] | None,
        typer.Option(
            help=".cfg, .g and grid: of all parts, degC, several times for several steps; by default that of the fit."
        ),
    ] = None,
    box: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(
            metavar="X0 X1 Y0 Y1 Z0 Z1",
            help=".cfg and .g: where the machine works, in the controller's coordinates, m.",
        ),
    ] = None,
    origin: Origin = ZERO,
    firmware: Annotated[
        Path | None,
        typer.Option(
            help=".cfg and .g: the present printer.cfg or config.g of a delta, to correct its dimensions too."
        ),
    ] = None,
    undetermined: Annotated[
        bool, typer.Option("--undetermined", help=".cfg and .g: change also settings that the data do not determine.")
    ] = False,
    tcp: Tcp = None,
    actuators: Actuators = "",
    home: Home = "",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write the model for other software: URDF, SDF, MJCF, tables of corrections, corrected commands."""
    form = "diff" if diff else form
    found = read_model(model, tcp=tcp, **chosen(actuators, home))
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always", GtpinWarning)
        if commands is None and controller is not None and not writer_of(output, form)[1].tables:
            raise GtpinError("--controller without --commands", hint="give the table of commands")
        believed = None if controller is None else _believed(found, controller)
        if commands is None:
            tables = None
            if temperature or box or firmware or undetermined or controller is not None:
                placed = None if box is None else Box.of(box, origin)
                tables = TablesFor(believed, tuple(temperature or ()), placed, firmware, undetermined)
            written = run_export(found, output, form, session=session, tables=tables, force=force)
        else:
            not_its_input(output, commands)
            correct = extension("gtpin.options", "commands")
            written = (correct(found, commands, believed, output, force=force),)
    notes = [str(warning.message) for warning in noticed]
    for note in notes:
        warn(note)
    files = [str(file) for file in written]
    parts = not_determined(found) if as_json else None
    result: dict[str, object] = {"robot": found.robot.name, "written": files, "warnings": notes}
    result |= {} if parts is None else {"not_determined": asdict(parts)}
    tell(result, "Written: " + ", ".join(files), as_json)


def _believed(model: Model, controller: str) -> Model:
    """The model of the controller's kinematics; raises `ModelError` where it is of another robot than the machine's model."""
    believed = read_model(controller)
    check_alike(believed.robot, model.robot, "the machine's is")
    return machine_of(believed)
