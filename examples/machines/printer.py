"""A delta printer's URDF from its firmware's dimensions: python printer.py --radius R --arms A [A A] -o printer.urdf.

Lengths are millimetres, as in Klipper's printer.cfg (``delta_radius``, ``arm_length``, ``angle``) and RepRapFirmware's M665
(R, L). The base frame is the firmware's: z = 0 is the bed, where all is well adjusted. A firmware knows only the difference
between the radius of the towers and that of the effector's joints, and not how wide the pairs of arms are; measure these two
(``--effector``, ``--width``).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from machine_sketch import Carrier, Sketch, SketchRod

HOME = 0.05
"""Height of the nozzle over the bed at home, m."""
SHORTEST = 5.0
"""Radius, mm, below which it looks like metres."""
ABOVE = 0.60
"""Travel of the carriages over home, m; below it they go down to the bed."""


def sketch(
    radius: float,
    arms: list[float],
    angles: list[float],
    effector: float,
    width: float,
    nozzle: float,
) -> Sketch:
    """The printer's sketch; lengths in metres, angles in degrees."""
    carriers, rods = [], []
    for tower, (arm, angle) in enumerate(zip(arms, np.radians(angles), strict=True)):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        aside = np.array([-out[1], out[0], 0.0])
        cart = f"tower{'abc'[tower]}"
        height = HOME + nozzle + np.sqrt(arm**2 - radius**2)
        middle = (radius + effector) * out + np.array([0.0, 0.0, height])
        carriers.append(Carrier(cart, middle, (0.0, 0.0, 1.0), (-height, ABOVE), mass=0.3))
        for name, side in (("1", -0.5), ("2", 0.5)):
            joint = effector * out + side * width * aside + np.array([0.0, 0.0, nozzle])
            rods.append(
                SketchRod(f"arm{'abc'[tower]}{name}", joint, middle + side * width * aside, carrier=cart, mass=0.03)
            )
    return Sketch(
        "printer",
        rods,
        carriers,
        home=(0.0, 0.0, 0.0),
        T=(0.0, 0.0, HOME),
        plate_mass=0.3,
        plate_center=(0.0, 0.0, nozzle),
        tolerance={
            "link_length": 1e-3,
            "platform_joint": 1e-3,
            "cart_joint": 2e-3,
            "track_direction": 2e-3,
            "scale": 5e-4,
        },
        note="A delta printer, from the dimensions of its firmware. Written by examples/machines/printer.py.",
    )


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=f"{__doc__.splitlines()[0]} Lengths are millimetres.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument("--radius", type=float, required=True, help="delta_radius, R of M665")
    parser.add_argument("--arms", type=float, nargs="+", required=True, help="arm_length of each tower, or one for all")
    parser.add_argument("--angles", type=float, nargs=3, default=[210.0, 330.0, 90.0], help="of the towers, degrees")
    parser.add_argument(
        "--effector", type=float, default=30.0, help="from the nozzle's axis to the middle of a pair of joints"
    )
    parser.add_argument("--width", type=float, default=45.0, help="between the arms of a pair")
    parser.add_argument("--nozzle", type=float, default=20.0, help="of the nozzle below the joints")
    parser.add_argument("-o", dest="urdf", type=Path, required=True)
    given = parser.parse_args(arguments)
    arms = given.arms * 3 if len(given.arms) == 1 else given.arms
    if len(arms) != 3 or min(arms) <= given.radius:
        parser.error("give one arm or three, longer than the radius")
    if given.radius < SHORTEST:
        parser.error(f"a radius of {given.radius:g} mm looks like metres; give millimetres")
    found = sketch(
        given.radius / 1e3,
        [arm / 1e3 for arm in arms],
        given.angles,
        given.effector / 1e3,
        given.width / 1e3,
        given.nozzle / 1e3,
    )
    given.urdf.write_text(found.urdf(), encoding="utf-8")


if __name__ == "__main__":
    main()
