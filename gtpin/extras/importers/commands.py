"""``gtpin import FORMAT FILE -o DATASET``: a file of another program becomes a dataset folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import Annotated, Any, Literal, get_origin

import typer

from gtpin.commands.terminal import ZERO, AsJson, Command, Force, Origin, Tcp, Vector, output_option, tell
from gtpin.data import Commands, Dataset
from gtpin.errors import DatasetError
from gtpin.extras.importers.klipper import read_klipper_delta, read_klipper_mesh, read_klipper_probe
from gtpin.extras.importers.linuxcnc_probe import Unit, read_linuxcnc_probe
from gtpin.extras.importers.matched import Match
from gtpin.extras.importers.points import (
    PRESETS,
    Angle,
    Length,
    Preset,
    PresetName,
    Rotations,
    Separator,
    instrument_of,
    read_commands,
    read_points,
)
from gtpin.extras.importers.ros_poses import read_ros_poses
from gtpin.extras.importers.rrf import read_rrf_g32, read_rrf_heightmap
from gtpin.extras.importers.touches import Touches, write_touches
from gtpin.references import seen_from
from gtpin.robot.library import load_robot

SourceFile = Annotated[Path, typer.Argument(metavar="FILE", help="The file to read.")]
Folder = Annotated[Path, output_option("Folder of the dataset; created.")]
RobotName = Annotated[str, typer.Option("--robot", help="Name of the robot, or path of its URDF or MJCF file.")]
ProbeOffset = Annotated[
    Vector,
    typer.Option(
        "--probe-offset", metavar="X Y Z", help="The probe's offset as the firmware's configuration has it, mm."
    ),
]
Normal = Annotated[
    Vector,
    typer.Option("--normal", metavar="X Y Z", help="Of the surface, towards the side that was touched, base frame."),
]
Sigma = Annotated[
    float | None, typer.Option("--sigma", help="1 sigma of a touch along the normal, m.", show_default="estimated")
]
Name = Annotated[str, typer.Option("--name", help="Of the instrument, and of its table.")]
Frame = Annotated[
    Literal["free", "robot"],
    typer.Option("--frame", help="free: the instrument stood elsewhere; robot: positions are in the base frame."),
]
Target = Annotated[
    Literal["free", "tcp"] | None,
    typer.Option(
        "--target",
        help="free: where the target sits is unknown; tcp: at the robot's TCP.",
        show_default="free; of a robot with rods tcp",
    ),
]
Within = Annotated[
    float | None,
    typer.Option("--within", help="Longest time from a command, s; other readings are left out."),
]
Read = Callable[..., Dataset | Touches]
UP: Vector = (0.0, 0.0, 1.0)
TOUCHES_NEEDED = """Touches of a printer's bed, what they leave over for a check, and the sigmas (mm) of the delta radius, the
arms and the end stops; none determines angles of towers or scales:

7 (DELTA_CALIBRATE): 0.0, too few for a calibration

13 (mesh of 5 x 5 on a round bed): 2.4, too few

29 (mesh of 7 x 7): 16.8; 0.38, 2.4, 0.79

49 (mesh of 9 x 9): 36.3; 0.37, 2.4, 0.79

For the shipped linear_delta, a sigma of 10 um of a touch. Probe a mesh of 7 x 7: klipper-mesh, rrf-heightmap.

"""
"""From examples/machines/touches_needed.py."""
ENOUGH = 25
"""Fewest touches of a printer's bed that leave something over in this table."""


import_app = typer.Typer(
    name="import",
    help="Turn a file that another program wrote into a dataset folder.",
    no_args_is_help=True,
    add_completion=False,
    epilog="Example: gtpin import klipper-delta printer.cfg --robot printer.urdf -o touches",
)


def importer(example: str, needed: str = "") -> Callable[[Read], Read]:
    """Decorator that makes a command of the reader of a format, which returns `Dataset` or `Touches`.

    The command's options are ``-o`` and ``--robot``, then those of the reader, then the other ones of the function that writes
    what was read. ``example``: a call of the command. ``needed``: text of its help before the example.
    """

    def register(read: Read) -> Read:
        reading = signature(read, eval_str=True)
        write: Callable[..., None] = _write_touches if reading.return_annotation is Touches else _write_poses
        writing = signature(write, eval_str=True).parameters
        own = reading.parameters
        first, *rest = (p for p in writing.values() if get_origin(p.annotation) is Annotated)
        options = {p.name: own.get(p.name, p) for p in (own["file"], first, *rest[:1], *own.values(), *rest)}

        @wraps(read)
        def command(**given: Any) -> None:
            found = read(**{name: given[name] for name in own})
            write(found, **{name: given[name] for name in writing if name in given})

        named = [p.replace(kind=p.KEYWORD_ONLY) for p in options.values()]
        command.__signature__ = Signature(named)  # type: ignore[attr-defined]
        import_app.command(cls=Command, epilog=f"{needed}Example:\n\n{example}")(command)
        return read

    return register


def _write_touches(
    touches: Touches,
    output: Folder,
    robot: RobotName,
    origin: Origin = ZERO,
    normal: Vector = UP,
    sigma: Sigma = None,
    name: Name = "bed",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    rows = write_touches(
        touches, output, robot, tcp=tcp, name=name, origin=origin, normal=normal, sigma=sigma, force=force
    )
    few = f"\n{rows} touches are few: a calibration needs about {ENOUGH}. Probe a mesh of 7 x 7."
    _tell_written(rows, "touches", robot, output, as_json, few if touches.bed and rows < ENOUGH else "")


def _write_poses(
    dataset: Dataset, output: Folder, robot: RobotName, force: Force = False, as_json: AsJson = False
) -> None:
    replace(dataset, robot=seen_from(robot, output)).write(output, force=force)
    elsewhere = "write target = [x, y, z], m, TCP frame, under [instrument] of dataset.toml"
    assumed = f"\nThe target is taken to be at the robot's TCP: if it sits elsewhere, {elsewhere}."
    targets = [dataset.instrument.target, *(table.model_dump()["target"] for table in dataset.readings.tables)]
    at_tcp = all(target in (None, "tcp") for target in targets)
    _tell_written(len(dataset), "measured poses", robot, output, as_json, assumed if at_tcp else "")


def _tell_written(rows: int, what: str, robot: str, dataset: Path, as_json: bool, more: str = "") -> None:
    result = {"dataset": str(dataset), "robot": robot, "rows": rows}
    tell(result, f"{rows} {what} of {robot}. Written: {dataset}{more}", as_json)


@importer("gtpin import klipper-delta printer.cfg --robot printer.urdf -o touches", TOUCHES_NEEDED)
def klipper_delta(file: SourceFile) -> Touches:
    """Klipper: the touches of DELTA_CALIBRATE, from a printer.cfg that SAVE_CONFIG wrote."""
    return read_klipper_delta(file)


@importer(
    "gtpin import klipper-probe klippy.log --robot printer.urdf --probe-offset -25 5 1.2 -o touches", TOUCHES_NEEDED
)
def klipper_probe(file: SourceFile, probe_offset: ProbeOffset = ZERO) -> Touches:
    """Klipper: the touches that klippy.log or the console reports (probe at X,Y is z=Z)."""
    return read_klipper_probe(file, probe_offset)


@importer("gtpin import klipper-mesh printer.cfg --robot printer.urdf -o touches", TOUCHES_NEEDED)
def klipper_mesh(
    file: SourceFile,
    profile: Annotated[str, typer.Option(help="Name of the mesh.")] = "default",
    probe_offset: ProbeOffset = ZERO,
) -> Touches:
    """Klipper: the points of a bed mesh, from a printer.cfg that SAVE_CONFIG wrote."""
    return read_klipper_mesh(file, profile, probe_offset)


@importer("gtpin import rrf-heightmap heightmap.csv --robot printer.urdf -o touches", TOUCHES_NEEDED)
def rrf_heightmap(file: SourceFile, probe_offset: ProbeOffset = ZERO) -> Touches:
    """RepRapFirmware: the heights of G29, from its heightmap.csv."""
    return read_rrf_heightmap(file, probe_offset)


@importer("gtpin import rrf-g32 console.txt --points bed.g --robot printer.urdf -o touches", TOUCHES_NEEDED)
def rrf_g32(
    file: SourceFile,
    points: Annotated[Path, typer.Option(help="The bed.g that was run.")],
    probe_offset: ProbeOffset = ZERO,
) -> Touches:
    """RepRapFirmware: the heights that the console reports (G32 bed probe heights: ...), at the points of bed.g."""
    return read_rrf_g32(file, points, probe_offset)


@importer("gtpin import linuxcnc-probe probe.txt --unit mm --axes XYZ --robot mill.urdf -o touches")
def linuxcnc_probe(
    file: SourceFile,
    unit: Annotated[Unit, typer.Option(help="Of the program's lengths.")],
    axes: Annotated[
        str,
        typer.Option(
            help="The letters that are q1, q2, ...: XYZ, XYZAC.",
            show_default="X Y Z is the TCP, and q follows from the robot",
        ),
    ] = "",
    target: Annotated[Vector, typer.Option(metavar="X Y Z", help="Tip of the probe in the TCP frame, m.")] = ZERO,
    origin: Origin = ZERO,
    normal: Normal = UP,
    name: Name = "probe",
) -> Touches:
    """LinuxCNC: the touches of one plane, from the file of (PROBEOPEN file)."""
    return read_linuxcnc_probe(file, unit, axes, origin, target)


@importer(
    "gtpin import points points.txt --columns=-,-,pose,x,y,z --separator space --unit mm --commands commands.csv "
    "--match pose --robot ur10 -o measured"
)
def points(
    file: SourceFile,
    robot: RobotName,
    columns: Annotated[
        str | None,
        typer.Option(
            help="Names of the columns in order, between commas: pose, x, y, z, qw, qx, qy, qz or rx, ry, rz, q1 ...; time, "
            "session (an id), payload or any other name of a covariate; - for what is not wanted."
        ),
    ] = None,
    unit: Annotated[Length | None, typer.Option(help="Of lengths.")] = None,
    separator: Annotated[Separator | None, typer.Option(help="Between columns.")] = None,
    preset: Annotated[
        PresetName | None,
        typer.Option(help="Columns, separator and units as this maker writes poses, where you do not give them."),
    ] = None,
    frame: Frame = "free",
    target: Target = None,
    sigma: Annotated[
        float | None,
        typer.Option(help="1 sigma of a measured position, per axis, m.", show_default="estimated"),
    ] = None,
    stations: Annotated[
        Literal["session"] | None,
        typer.Option(help="session: the instrument stood elsewhere in each session, a column that you name."),
    ] = None,
    angle: Annotated[Angle | None, typer.Option(help="Unit of commands that are angles.")] = None,
    commands: Annotated[
        Path | None,
        typer.Option(
            help="Table with the columns pose (or time), q1 .. qn, SI units; or joint values as a controller logs them: "
            "pose or nothing, then a column for each joint."
        ),
    ] = None,
    match: Annotated[Match | None, typer.Option(help="How rows and commands belong together.")] = None,
    within: Within = None,
    header: Annotated[int, typer.Option(help="Lines at the beginning to pass over.", min=0)] = 0,
    decimal_comma: Annotated[bool, typer.Option("--decimal-comma", help="Numbers have a comma.")] = False,
    rotation: Annotated[
        Rotations | None,
        typer.Option(
            help="What rx, ry, rz are: a vector, or Euler angles about fixed axes (zyx) or moving ones (ZYX)."
        ),
    ] = None,
    tcp: Tcp = None,
) -> Dataset:
    """A list of points or poses, as SpatialAnalyzer exports it: columns, separator and units as you name them, or as a maker
    of robots writes them."""
    usual = PRESETS[preset] if preset else Preset()
    names = [name.strip() for name in columns.split(",")] if columns else list(usual.columns)
    unit, separator = unit or usual.unit, separator or usual.separator
    if not names or unit is None or separator is None:
        lacking = "columns" if not names else "unit" if unit is None else "separator"
        hint = f"add --{lacking}, or --preset {'|'.join(PRESETS)}"
        raise DatasetError(f"the file itself does not say its {lacking}", file=file, hint=hint)
    if stations is not None and stations not in names:
        raise DatasetError(
            "--stations session without a session of each row", hint="name a column session in --columns"
        )
    return read_points(
        file,
        robot,
        names,
        separator,
        unit,
        angle=angle or usual.angle,
        commands=None
        if commands is None
        else read_commands(commands, robot, unit, angle=angle, decimal_comma=decimal_comma, tcp=tcp),
        match=match,
        within=within,
        header=header,
        decimal_comma=decimal_comma,
        rotations=rotation or usual.rotations,
        instrument=instrument_of(robot, tcp, frame, target, sigma, stations),
        tcp=tcp,
    )


@importer("gtpin import ros-poses tag.csv --commands commands.csv --match time --within 0.02 --robot ur5 -o measured")
def ros_poses(
    file: SourceFile,
    robot: RobotName,
    commands: Annotated[Path, typer.Option(help="Table with the columns pose, q1 .. qn, time, SI units.")],
    match: Annotated[Literal["row", "time"], typer.Option(help="How rows and commands belong together.")],
    within: Within = None,
    prefix: Annotated[str | None, typer.Option(help="Which pose, where the message has several.")] = None,
    frame: Frame = "free",
    target: Target = None,
    tcp: Tcp = None,
) -> Dataset:
    """ROS: the poses of a topic, as rostopic echo -p or ros2 topic echo --csv writes them."""
    return read_ros_poses(
        file,
        robot,
        Commands.read(commands, load_robot(robot, tcp).n_actuators, numbered=True),
        match,
        within=within,
        prefix=prefix,
        instrument=instrument_of(robot, tcp, frame, target),
        tcp=tcp,
    )
