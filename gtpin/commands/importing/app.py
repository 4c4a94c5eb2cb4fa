"""Registers the formats of ``gtpin import``."""

from __future__ import annotations

import typer

from gtpin.commands.importing.poses import points, ros_poses
from gtpin.commands.importing.touches import (
    klipper_delta,
    klipper_mesh,
    klipper_probe,
    linuxcnc_probe,
    rrf_g32,
    rrf_heightmap,
)

import_app = typer.Typer(
    name="import",
    help="Turn a file that another program wrote into a dataset folder.",
    no_args_is_help=True,
    epilog="Example: gtpin import klipper-delta printer.cfg --robot printer.urdf -o touches",
)
for command, example in (
    (klipper_delta, "gtpin import klipper-delta printer.cfg --robot printer.urdf -o touches"),
    (
        klipper_probe,
        "gtpin import klipper-probe klippy.log --robot printer.urdf --probe-offset -25 5 1.2 -o touches",
    ),
    (klipper_mesh, "gtpin import klipper-mesh printer.cfg --robot printer.urdf -o touches"),
    (rrf_heightmap, "gtpin import rrf-heightmap heightmap.csv --robot printer.urdf -o touches"),
    (rrf_g32, "gtpin import rrf-g32 console.txt --points bed.g --robot printer.urdf -o touches"),
    (linuxcnc_probe, "gtpin import linuxcnc-probe probe.txt --unit mm --axes XYZ --robot mill.urdf -o touches"),
    (
        points,
        "gtpin import points points.txt --columns=-,-,pose,x,y,z --separator space --unit mm --commands commands.csv "
        "--match pose --robot ur10 -o measured",
    ),
    (
        ros_poses,
        "gtpin import ros-poses tag.csv --commands commands.csv --match time --within 0.02 --robot ur5 -o measured",
    ),
):
    import_app.command(epilog=f"Example:\n\n{example}")(command)
