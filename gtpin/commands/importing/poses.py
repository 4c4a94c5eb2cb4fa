"""``gtpin import`` of positions and poses: lists of metrology programs, ROS."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from gtpin.commands.importing.options import Folder, RobotName, SourceFile, written
from gtpin.commands.terminal import AsJson, Force, Tcp
from gtpin.data import Commands, Dataset, Instrument
from gtpin.importers.matched import Match
from gtpin.importers.named_columns import Angle, Length, Separator
from gtpin.importers.points import read_points
from gtpin.importers.ros_poses import read_ros_poses
from gtpin.references import seen_from
from gtpin.robot.library import load_robot

Frame = Annotated[
    Literal["free", "robot"],
    typer.Option("--frame", help="free: the instrument stood elsewhere; robot: positions are in the base frame."),
]
Target = Annotated[
    Literal["free", "tcp"],
    typer.Option("--target", help="free: where the target sits is unknown; tcp: at the robot's TCP."),
]
Within = Annotated[
    float | None,
    typer.Option("--within", help="Longest time between a reading and its command, s.", show_default=False),
]


def points(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    columns: Annotated[
        str,
        typer.Option(
            "--columns",
            help="Names of the columns in their order, between commas: pose, x, y, z, qw, qx, qy, qz, q1 ..., -.",
            show_default=False,
        ),
    ],
    unit: Annotated[Length, typer.Option("--unit", help="Of lengths.", show_default=False)],
    separator: Annotated[Separator, typer.Option("--separator", help="Between columns.", show_default=False)],
    angle: Annotated[
        Angle | None, typer.Option("--angle", help="Unit of commands that are angles.", show_default=False)
    ] = None,
    commands: Annotated[
        Path | None,
        typer.Option("--commands", help="Table with the columns pose, q1 .. qn, SI units.", show_default=False),
    ] = None,
    match: Annotated[
        Match | None,
        typer.Option("--match", help="How rows and commands belong together.", show_default=False),
    ] = None,
    within: Within = None,
    header: Annotated[int, typer.Option("--header", help="Lines at the beginning to pass over.", min=0)] = 0,
    decimal_comma: Annotated[bool, typer.Option("--decimal-comma", help="Numbers have a comma.")] = False,
    frame: Frame = "free",
    target: Target = "free",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """A list of points or poses, as SpatialAnalyzer exports it: columns, separator and units as you name them."""
    dataset = read_points(
        file,
        robot,
        [name.strip() for name in columns.split(",")],
        separator,
        unit,
        angle=angle,
        commands=None if commands is None else _commands(commands, robot, tcp),
        match=match,
        within=within,
        header=header,
        decimal_comma=decimal_comma,
        instrument=Instrument(frame=frame, target=target),
        tcp=tcp,
    )
    _write(dataset, output, robot, force, as_json)


def ros_poses(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    commands: Annotated[
        Path,
        typer.Option("--commands", help="Table with the columns pose, q1 .. qn, time, SI units.", show_default=False),
    ],
    match: Annotated[
        Literal["row", "time"],
        typer.Option("--match", help="How rows and commands belong together.", show_default=False),
    ],
    within: Within = None,
    prefix: Annotated[
        str | None,
        typer.Option("--prefix", help="Which pose, where the message has several.", show_default=False),
    ] = None,
    frame: Frame = "free",
    target: Target = "free",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """ROS: the poses of a topic, as rostopic echo -p or ros2 topic echo --csv writes them."""
    dataset = read_ros_poses(
        file,
        robot,
        _commands(commands, robot, tcp),
        match,
        within=within,
        prefix=prefix,
        instrument=Instrument(frame=frame, target=target),
        tcp=tcp,
    )
    _write(dataset, output, robot, force, as_json)


def _commands(file: Path, robot: str, tcp: str | None) -> Commands:
    return Commands.read(file, load_robot(robot, tcp).n_actuators)


def _write(dataset: Dataset, output: Path, robot: str, force: bool, as_json: bool) -> None:
    replace(dataset, robot=seen_from(robot, output)).write(output, force=force)
    written(len(dataset), "measured poses", robot, output, as_json)
