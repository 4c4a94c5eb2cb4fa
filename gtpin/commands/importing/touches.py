"""``gtpin import`` of touches: Klipper, RepRapFirmware, LinuxCNC."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.importing.options import (
    Folder,
    Name,
    Normal,
    Origin,
    ProbeOffset,
    RobotName,
    Sigma,
    SourceFile,
    Vector,
    written,
)
from gtpin.commands.terminal import AsJson, Force, Tcp
from gtpin.importers.folder import write_touches
from gtpin.importers.klipper_delta import read_klipper_delta
from gtpin.importers.klipper_mesh import read_klipper_mesh
from gtpin.importers.klipper_probe import read_klipper_probe
from gtpin.importers.linuxcnc_probe import Unit, read_linuxcnc_probe
from gtpin.importers.rrf_g32 import read_rrf_g32
from gtpin.importers.rrf_heightmap import read_rrf_heightmap

ZERO: Vector = (0.0, 0.0, 0.0)
UP: Vector = (0.0, 0.0, 1.0)


def klipper_delta(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    origin: Origin = ZERO,
    sigma: Sigma = None,
    name: Name = "bed",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Klipper: the touches of DELTA_CALIBRATE, from a printer.cfg that SAVE_CONFIG wrote."""
    touches = read_klipper_delta(file)
    rows = write_touches(touches, output, robot, tcp=tcp, name=name, origin=origin, sigma=sigma, force=force)
    written(rows, "touches", robot, output, as_json)


def klipper_probe(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    probe_offset: ProbeOffset = ZERO,
    origin: Origin = ZERO,
    sigma: Sigma = None,
    name: Name = "bed",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Klipper: the touches that klippy.log or the console reports (probe at X,Y is z=Z)."""
    touches = read_klipper_probe(file, probe_offset)
    rows = write_touches(touches, output, robot, tcp=tcp, name=name, origin=origin, sigma=sigma, force=force)
    written(rows, "touches", robot, output, as_json)


def klipper_mesh(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    profile: Annotated[str, typer.Option("--profile", help="Name of the mesh.")] = "default",
    probe_offset: ProbeOffset = ZERO,
    origin: Origin = ZERO,
    sigma: Sigma = None,
    name: Name = "bed",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Klipper: the points of a bed mesh, from a printer.cfg that SAVE_CONFIG wrote."""
    touches = read_klipper_mesh(file, profile, probe_offset)
    rows = write_touches(touches, output, robot, tcp=tcp, name=name, origin=origin, sigma=sigma, force=force)
    written(rows, "touches", robot, output, as_json)


def rrf_heightmap(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    probe_offset: ProbeOffset = ZERO,
    origin: Origin = ZERO,
    sigma: Sigma = None,
    name: Name = "bed",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """RepRapFirmware: the heights of G29, from its heightmap.csv."""
    touches = read_rrf_heightmap(file, probe_offset)
    rows = write_touches(touches, output, robot, tcp=tcp, name=name, origin=origin, sigma=sigma, force=force)
    written(rows, "touches", robot, output, as_json)


def rrf_g32(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    points: Annotated[Path, typer.Option("--points", help="The bed.g that was run.", show_default=False)],
    probe_offset: ProbeOffset = ZERO,
    origin: Origin = ZERO,
    sigma: Sigma = None,
    name: Name = "bed",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """RepRapFirmware: the heights that the console reports (G32 bed probe heights: ...), at the points of bed.g."""
    touches = read_rrf_g32(file, points, probe_offset)
    rows = write_touches(touches, output, robot, tcp=tcp, name=name, origin=origin, sigma=sigma, force=force)
    written(rows, "touches", robot, output, as_json)


def linuxcnc_probe(
    file: SourceFile,
    output: Folder,
    robot: RobotName,
    unit: Annotated[Unit, typer.Option("--unit", help="Of the program's lengths.", show_default=False)],
    axes: Annotated[
        str,
        typer.Option(
            "--axes",
            help="The letters that are q1, q2, ...: XYZ, XYZAC.",
            show_default="X Y Z is the TCP, and q follows from the robot",
        ),
    ] = "",
    target: Annotated[
        Vector, typer.Option("--target", metavar="X Y Z", help="Tip of the probe in the TCP frame, m.")
    ] = ZERO,
    origin: Origin = ZERO,
    normal: Normal = UP,
    sigma: Sigma = None,
    name: Name = "probe",
    tcp: Tcp = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """LinuxCNC: the touches of one plane, from the file of (PROBEOPEN file)."""
    touches = read_linuxcnc_probe(file, unit, axes, origin, target)
    rows = write_touches(
        touches, output, robot, tcp=tcp, name=name, origin=origin, normal=normal, sigma=sigma, force=force
    )
    written(rows, "touches", robot, output, as_json)
