"""Files in the formats of the firmwares, written from positions by formulas of their own, for the printer of ``linear_delta``.

The formats are those of the sources that gtpin/extras/importers names; nothing is copied from them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

Write = Callable[[str, str], Path]
"""Writes a text to a file of a name: see ``conftest.py``."""

ARM, RADIUS = 999.0, 524.25
"""Of the shipped linear delta, mm: three times Klipper's config/example-delta.cfg."""
ANGLES = (210.0, 330.0, 90.0)
END = 900.0
"""position_endstop, mm."""
STEP = 40.0 / (200.0 * 16.0)
"""Travel of a step, mm: rotation_distance over steps a turn."""
ORIGIN = (0.0, 0.0, 0.3)
"""Where the bed is in the robot's base frame, m: in the middle of the workspace."""


def carriages(
    xyz: np.ndarray, angles: tuple[float, ...] = ANGLES, arm: float = ARM, radius: float = RADIUS
) -> np.ndarray:
    """(N, 3) height of the carriages over the bed with the nozzle there, mm: a right triangle over each arm."""
    towers = radius * np.column_stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))])
    across = ((xyz[:, None, :2] - towers) ** 2).sum(axis=2)
    return xyz[:, 2:] + np.sqrt(arm**2 - across)


def places(count: int = 9, seed: int = 0) -> np.ndarray:
    """(N, 3) points on a bed that is a little tilted, mm."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-180.0, 180.0, (count, 2))
    return np.column_stack([xy, 0.2 + 1e-3 * xy[:, 0] - 5e-4 * xy[:, 1]])


def printer_cfg(
    xyz: np.ndarray,
    angles: tuple[float, ...] = ANGLES,
    believed_radius: float = RADIUS,
    height: float = 0.0,
    drive: str = "rotation_distance: 40\nmicrosteps: 16",
) -> str:
    """A printer.cfg after DELTA_CALIBRATE and SAVE_CONFIG, of a machine that was at these places when it touched."""
    top = END + np.sqrt(ARM**2 - RADIUS**2)
    steps = (top - carriages(xyz, angles)) / STEP
    lines = ["# my printer", "[printer]", "kinematics: delta  # three towers", "#delta_radius: 1.0"]
    for tower in "abc":
        lines += [f"[stepper_{tower}]", "step_pin: PF0", drive, ""]
    lines += ["[delta_calibrate]", "radius: 180", "", "#*# <---------------------- SAVE_CONFIG ---------------------->"]
    lines += ["#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.", "#*#", "#*# [printer]"]
    lines += [f"#*# delta_radius = {believed_radius:.6f}", "#*#"]
    for tower, angle in zip("abc", angles, strict=True):
        lines += [f"#*# [stepper_{tower}]", f"#*# angle = {angle:.6f}", f"#*# arm_length = {ARM:.6f}"]
        lines += [f"#*# position_endstop = {END:.6f}", "#*#"]
    lines.append("#*# [delta_calibrate]")
    for number, row in enumerate(steps):
        lines += [f"#*# height{number} = {height}", f"#*# height{number}_pos = " + ",".join(f"{s:.3f}" for s in row)]
    return "\n".join(lines) + "\n"


def mesh_cfg(points: str, round_: bool = True) -> str:
    """A printer.cfg with a saved mesh of 3 x 3 over 200 mm."""
    bed = "mesh_radius: 100\nround_probe_count: 3" if round_ else "mesh_min: -100,-100\nmesh_max: 100,100"
    grid = "\n".join(f"#*# \t  {line}" for line in points.splitlines())
    return f"""[bed_mesh]
{bed}

#*# <---------------------- SAVE_CONFIG ---------------------->
#*#
#*# [bed_mesh default]
#*# version = 1
#*# points =
{grid}
#*# min_x = -100.0
#*# max_x = 100.0
#*# min_y = -100.0
#*# max_y = 100.0
#*# x_count = 3
#*# y_count = 3
"""


MESH = "0.1, 0.1, 0.1\n0.2, 0.0, -0.2\n0.3, 0.3, 0.3"
PROBED = """Recv: // probe at 10.000,-20.000 is z=1.525000
Recv: ok
12:01:02 // probe at 10.000,-20.000 is z=1.527500
Send: M105
Recv: // probe at 0.000,120.500 is z=1.402500
"""
HEIGHTMAP = """RepRapFirmware height map file v2 generated at 2020-01-02 03:04, min error -0.107, max error 0.109, mean 0.010
axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1
X,Y,-100.00,100.00,-50.00,50.00,120.00,100.00,50.00,3,3
      0,  0.109,      0
 -0.054, -0.045, -0.107
      0,  0.000,      0
"""
BED_G = """; bed.g
M561
  G30 P0 X0.00 Y100.0 Z-99999 H0 ; north
G30 P1 X-86.6 Y-50 Z-99999
g30 p2 x86.6 y-50 z-99999 S-1
"""
G32 = """5.11.2019, 19:31:12 G32 bed probe heights: 0.085 -0.031 0.000, mean 0.018, deviation from mean 0.049
ok
5.11.2019, 19:33:15 G32 bed probe heights: 0.083 probing failed 0.002, mean 0.028, deviation from mean 0.040
"""
PROBE_LOG = """-50.000000 -50.000000 -0.032200 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000
-25.000000 -50.000000 -0.008866 0.000000 30.000000 90.000000 0.000000 0.000000 0.000000
0.000000 25.400000 0.011133 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000
"""
POINTS = """// SA export, working frame: A::TRACKER
Collection Poses p1 1203.4512 -877.1200 455.0031
Collection Poses p2 1198.0021 -870.5600 401.2500

Collection Poses p1 1203.4544 -877.1189 455.0010
"""
ROS = """%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,field.pose.position.y,\
field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w
175447000000,5,175447000000,tag,0.41,-0.02,0.31,0.0,0.6,0.0,0.8
175567000000,9,175567000000,tag,0.43,-0.07,0.33,0.6,0.0,0.0,0.8
175621000000,11,175621000000,tag,0.43,-0.07,0.34,0.0,0.0,0.6,0.8
"""
ROS2 = """175,447000000,tag,0.41,-0.02,0.31,0.0,0.6,0.0,0.8
175,567000000,tag,0.43,-0.07,0.33,0.6,0.0,0.0,0.8
175,621000000,tag,0.43,-0.07,0.34,0.0,0.0,0.6,0.8
"""
"""The same as a PoseStamped of ROS 2."""
