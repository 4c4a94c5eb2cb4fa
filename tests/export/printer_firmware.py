"""What printers' firmwares do with the files that gtpin writes for them, from their documentation and sources; nothing copied.

Klipper: docs/Config_Reference.md, docs/Bed_Mesh.md, docs/Skew_Correction.md, klippy/configfile.py, klippy/kinematics/delta.py.
RepRapFirmware: docs.duet3d.com/User_manual/Reference/Gcodes (M92, M556, M665, M666, G10, G29), src/Movement/Move.cpp and
src/Movement/BedProbing/Grid.cpp. All in mm.
"""

from __future__ import annotations

import configparser
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

ARM, RADIUS, END, ROTATION = 999.0, 524.25, 900.0, 40.0
"""Of the shipped linear delta, as in tests/importers; its end stops and drives are chosen."""
BED = 300.0
"""Height of the firmware's zero in the robot's base frame."""

PRINTER_CFG = f"""[printer]
kinematics: delta
delta_radius: {RADIUS}
max_velocity: 100  # as usual
[stepper_a]
position_endstop: {END}
arm_length: {ARM}
rotation_distance: {ROTATION}
microsteps: 16
[stepper_b]
rotation_distance: {ROTATION}
microsteps: 16
[stepper_c]
rotation_distance: {ROTATION}
microsteps: 16
[bed_mesh]
mesh_min: -100,-100
mesh_max: 100,100

[include gtpin.cfg]
"""
CONFIG_G = f"""; config.g
M92 X80.00 Y80.00 Z80.00 E420 ; steps per mm
M665 R{RADIUS} L{ARM} B250 H{END}
M665 X0.0 Y0.0 Z0.0
M666 X0.0 Y0.0 Z0.0 A0.0 B0.0
G10 P0 X0 Y0
"""


@dataclass(frozen=True)
class Firmware:
    """What a firmware has read."""

    radius: float
    arms: np.ndarray
    angles: np.ndarray
    ends: np.ndarray
    step: np.ndarray
    offset: np.ndarray
    tangents: tuple[float, float, float]
    low: np.ndarray
    spacing: np.ndarray
    heights: np.ndarray

    def moves_to(self, xyz: np.ndarray) -> np.ndarray:
        """(N, 3) positions, after its corrections, for positions of a program: skew first, then the mesh."""
        x, y, z = (xyz + np.append(self.offset, 0.0)).T
        xy, xz, yz = self.tangents
        x, y = x + xy * y + xz * z, y + yz * z
        place = [(y - self.low[1]) / self.spacing[1], (x - self.low[0]) / self.spacing[0]]
        return np.column_stack([x, y, z + map_coordinates(self.heights, place, order=1, mode="nearest")])

    def steps(self, xyz: np.ndarray) -> np.ndarray:
        """(N, 3) steps down from the end stops, of positions after the corrections."""
        rad = np.radians(self.angles)
        foot = self.radius * np.column_stack([np.cos(rad), np.sin(rad)])
        height = np.sqrt(self.arms**2 - ((xyz[:, None, :2] - foot) ** 2).sum(axis=2)) + xyz[:, 2:]
        return (self.ends + np.sqrt(self.arms**2 - self.radius**2) - height) / self.step


def klipper(folder: Path, name: str = "gtpin") -> Firmware:
    """Klipper with printer.cfg and the file that it includes at its end; a profile's name is the macro's."""
    config = configparser.RawConfigParser(strict=False, inline_comment_prefixes=(";", "#"))
    config.read_string((folder / "printer.cfg").read_text().split("[include")[0])
    if (folder / "gtpin.cfg").exists():
        config.read_string((folder / "gtpin.cfg").read_text())
    towers = [config[f"stepper_{letter}"] for letter in "abc"]
    first = towers[0]
    mesh = {"min_x": 0.0, "min_y": 0.0, "max_x": 1.0, "max_y": 1.0}
    heights, skew, offset = np.zeros((2, 2)), (0.0, 0.0, 0.0), np.zeros(2)
    if config.has_section(f"gcode_macro {name.upper()}"):
        told = [line.split() for line in config[f"gcode_macro {name.upper()}"]["gcode"].strip().splitlines()]
        assert [words[0] for words in told] == ["SKEW_PROFILE", "BED_MESH_PROFILE", "SET_GCODE_OFFSET"]
        given = [dict(word.split("=") for word in words[1:]) for words in told]
        skew_of, mesh_of = config[f"skew_correction {given[0]['LOAD']}"], config[f"bed_mesh {given[1]['LOAD']}"]
        offset = np.array([float(given[2]["X"]), float(given[2]["Y"])])
        assert config.has_section("skew_correction")
        assert mesh_of.getint("version") == 1
        assert mesh_of["algo"] == "direct"  # bilinear on the points themselves, with which no points are put between
        assert mesh_of.getint("mesh_x_pps") == mesh_of.getint("mesh_y_pps") == 0
        assert mesh_of.getfloat("tension") >= 0.0
        heights = np.array([[float(z) for z in line.split(",")] for line in mesh_of["points"].strip().split("\n")])
        assert heights.shape == (mesh_of.getint("y_count"), mesh_of.getint("x_count"))
        mesh = {key: mesh_of.getfloat(key) for key in mesh}
        xy, xz, yz = (skew_of.getfloat(f"{plane}_skew") for plane in ("xy", "xz", "yz"))
        skew = (-xy, -(xz - xy * yz), -yz)
    low, high = np.array([mesh["min_x"], mesh["min_y"]]), np.array([mesh["max_x"], mesh["max_y"]])
    return Firmware(
        config["printer"].getfloat("delta_radius"),
        np.array([tower.getfloat("arm_length", first.getfloat("arm_length")) for tower in towers]),
        np.array([t.getfloat("angle", a) for t, a in zip(towers, (210.0, 330.0, 90.0), strict=True)]),
        np.array([tower.getfloat("position_endstop", first.getfloat("position_endstop")) for tower in towers]),
        np.array([tower.getfloat("rotation_distance") / 200.0 / tower.getint("microsteps") for tower in towers]),
        offset,
        skew,
        low,
        (high - low) / (np.array(heights.shape[::-1]) - 1),
        heights,
    )


def reprapfirmware(folder: Path, name: str = "gtpin.g") -> Firmware:
    """RepRapFirmware after config.g and, where it is there, a macro; numbers are kept in 32 bits, as it does."""
    words: dict[str, str] = {}
    for file in (folder / "config.g", folder / name):
        for line in file.read_text().splitlines() if file.exists() else []:
            code, *rest = re.findall(r'[A-Z]\S*|"[^"]*"', line.split(";")[0]) or [""]
            words |= {f"{code} {word[0]}": word[1:] for word in rest}
    number = {key: float(np.float32(value)) for key, value in words.items() if re.fullmatch(r"-?[\d.]+", value)}

    def of(code: str) -> np.ndarray:
        return np.array([number.get(f"{code} {axis}", 0.0) for axis in "XYZ"])

    arms = [float(np.float32(arm)) for arm in words["M665 L"].split(":")]
    low, spacing, heights = np.zeros(2), np.ones(2), np.zeros((2, 2))
    if "G29 S" in words:
        assert (words["G29 S"], words["M376 H"]) == ("1", "0")
        low, spacing, heights = height_map(folder / words["G29 P"].strip('"'))
    tangents = of("M556") / number.get("M556 S", 1.0)
    return Firmware(
        number["M665 R"],
        np.array(arms * (3 // len(arms))),
        # Positive X, Y, Z turn the tower anticlockwise, seen from above.
        np.array([210.0, 330.0, 90.0]) + of("M665"),
        number["M665 H"] + of("M666"),
        1.0 / of("M92"),
        of("G10")[:2],
        (tangents[0], tangents[2], tangents[1]),  # X is XY, Y is YZ, Z is ZX
        low,
        spacing,
        heights,
    )


def height_map(file: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(2,) least x and y, (2,) spacings, and the heights, a row for each y, of a height map of version 2."""
    lines = file.read_text().splitlines()
    assert lines[0].startswith("RepRapFirmware height map file v2")
    assert lines[1] == "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1"
    assert all(len(line) <= 41 * 8 + 2 for line in lines)  # its buffer
    grid = lines[2].split(",")
    assert grid[:2] == ["X", "Y"]
    low, spacing = (np.array([float(grid[k]), float(grid[k + d])]) for k, d in ((2, 2), (7, 1)))
    shape = int(grid[10]), int(grid[9])
    assert shape[0] * shape[1] <= 441
    assert not any(re.search(r"(^|,)\s*0(,|$)", line) for line in lines[3:])  # 0 without decimals: not probed
    heights = np.array([[np.float32(z) for z in line.split(",")] for line in lines[3:]], dtype=float)
    assert heights.shape == shape
    return low, spacing, heights
