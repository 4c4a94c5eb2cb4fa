"""Corrections as files of printers' firmwares: Klipper's configuration, RepRapFirmware's macro and height map.

Sources: github.com/Klipper3d/klipper, docs/Config_Reference.md, klippy/configfile.py, klippy/kinematics/delta.py and
klippy/extras/bed_mesh.py, skew_correction.py; github.com/Duet3D/RepRapFirmware, src/Movement/Move.cpp (AxisTransform),
src/Movement/BedProbing/Grid.cpp and src/Movement/Kinematics/LinearDeltaKinematics.cpp. Nothing is copied from them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.errors import ModelError
from gtpin.extras.controllers.plane_tables import PlaneTables
from gtpin.extras.importers.towers import ANGLES, Towers
from gtpin.typing import Floats

MM = 1e3
KLIPPER_TOWERS = ("stepper_a", "stepper_b", "stepper_c")


def named(temperature: float | None) -> str:
    """Suffix of a file's or macro's name for a temperature, degC: empty for None, else ``_25`` for 25 degC.

    Klipper allows digits only at the end of a command's name.

    Raises `ModelError` if the temperature is not a whole number of degrees, or below 0.
    """
    if temperature is None:
        return ""
    if temperature < 0.0 or temperature != round(temperature):
        what, hint = f"a table of a printer can't have the name of {temperature:g} degC", "give whole degrees above 0"
        raise ModelError(what, hint=hint)
    return f"_{temperature:.0f}"


def klipper_config(
    robot: str,
    tables: Sequence[tuple[float | None, PlaneTables]],
    towers: Towers | None = None,
    rotation: Floats | None = None,
) -> str:
    """A file for printer.cfg to include: the dimensions of a delta, and for each temperature a mesh, a skew and a macro.

    ``tables``: for each temperature, degC (None: only one table), the correction. ``towers``: the dimensions of a delta;
    None: they are not written. ``rotation``: (3,) ``rotation_distance`` before the correction, mm.
    """
    lines = [
        f"# Corrections of {robot}, written by gtpin.",
        "# Include it below all other sections of printer.cfg, which needs [bed_mesh] without fade.",
    ]
    if towers is not None and rotation is not None:
        lines += ["", "[printer]", f"delta_radius: {MM * towers.radius:.6f}"]
        for k, name in enumerate(KLIPPER_TOWERS):
            lines += ["", f"[{name}]", f"arm_length: {MM * towers.arms[k]:.6f}"]
            lines += [f"angle: {np.degrees(towers.angles[k]):.7f}", f"position_endstop: {MM * towers.ends[k]:.6f}"]
            lines += [f"rotation_distance: {rotation[k] * towers.scale[k]:.8f}"]
    lines += ["", "[skew_correction]"]
    for temperature, table in tables:
        end = named(temperature)
        xy, xz, yz = table.skew
        # Klipper subtracts: x -= y xy_skew + z (xz_skew - xy_skew yz_skew), y -= z yz_skew.
        skews = {"xy_skew": -xy, "xz_skew": -xz + xy * yz, "yz_skew": -yz}
        lines += ["", f"[skew_correction gtpin{end}]"]
        lines += [f"{name}: {value:.9f}" for name, value in skews.items()]
        lines += ["", f"[bed_mesh gtpin{end}]", "version: 1", "points:"]
        lines += ["  " + ", ".join(f"{value:.6f}" for value in MM * row) for row in table.height]
        lines += [f"x_count: {len(table.x)}", f"y_count: {len(table.y)}", "mesh_x_pps: 0", "mesh_y_pps: 0"]
        lines += ["algo: direct", "tension: 0.2"]
        for axis, nodes in (("x", table.x), ("y", table.y)):
            lines += [f"min_{axis}: {MM * nodes[0]:.6f}", f"max_{axis}: {MM * nodes[-1]:.6f}"]
        x, y = MM * table.offset
        lines += ["", f"[gcode_macro GTPIN{end.upper()}]", "gcode:", f"  SKEW_PROFILE LOAD=gtpin{end}"]
        lines += [f"  BED_MESH_PROFILE LOAD=gtpin{end}", f"  SET_GCODE_OFFSET X={x:.6f} Y={y:.6f}"]
    return "\n".join(lines) + "\n"


def rrf_macro(
    robot: str, table: PlaneTables, heightmap: str, towers: Towers | None = None, steps: Floats | None = None
) -> str:
    """A macro that sets the dimensions of a delta, skew and offset, and loads a height map.

    ``heightmap``: name of the file with the height map. ``towers``: the dimensions of a delta; None: they are not written.
    ``steps``: (3,) steps per mm before the correction.
    """
    lines = [f"; Corrections of {robot}, written by gtpin. Run it with M98 after homing; M376 H0: without taper."]
    if towers is not None and steps is not None:
        middle = float(towers.ends.mean())
        turned = np.degrees(towers.angles) - ANGLES
        lines += [
            "; Dimensions: home again after they have changed.",
            f"M665 L{':'.join(f'{MM * arm:.5f}' for arm in towers.arms)} R{MM * towers.radius:.5f} H{MM * middle:.5f} "
            + _words(turned, 6),
            "M666 " + _words(MM * (towers.ends - middle), 5),
            "M92 " + _words(steps / towers.scale, 6),
        ]
    xy, xz, yz = table.skew
    x, y = MM * table.offset
    lines += [
        # X is XY, Y is YZ, Z is XZ: M556 adds the tangents X/S y + Z/S z to x, and Y/S z to y.
        f"M556 S1000 X{1e3 * xy:.6f} Y{1e3 * yz:.6f} Z{1e3 * xz:.6f} P0",
        f"G10 L2 P1 X{x:.5f} Y{y:.5f}",
        "M376 H0",
        f'G29 S1 P"{heightmap}"',
    ]
    return "\n".join(lines) + "\n"


def rrf_heightmap(table: PlaneTables) -> str:
    """A height map, as G29 S1 loads it: version 2, mm.

    The spacing has six decimals. RepRapFirmware itself writes two, but it reads all, and computes the nodes' positions with
    them.
    """
    h = MM * table.height
    spacing = [MM * (nodes[1] - nodes[0]) for nodes in (table.x, table.y)]
    ends = [MM * value for nodes in (table.x, table.y) for value in (nodes[0], nodes[-1])]
    lines = [
        f"RepRapFirmware height map file v2 by gtpin, min error {h.min():.3f}, max error {h.max():.3f}, "
        f"mean {h.mean():.3f}, deviation {h.std():.3f}",
        "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1",
        f"X,Y,{','.join(f'{end:.4f}' for end in ends)},-1.00,{spacing[0]:.6f},{spacing[1]:.6f},{len(table.x)},{len(table.y)}",
    ]
    # With five decimals, a line of 21 nodes stays below the limit of 330 characters.
    lines += [",".join(f"{value:9.5f}" for value in row) for row in h]
    return "\n".join(lines) + "\n"


def _words(values: Floats, digits: int) -> str:
    return " ".join(f"{axis}{value:.{digits}f}" for axis, value in zip("XYZ", values, strict=True))
