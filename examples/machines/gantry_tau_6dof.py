"""A Gantry-Tau with variable orientation: six carts on the three tracks, a link on each.

In the spirit of Williams, Hovland and Brogardh, "Kinematic error calibration of the Gantry-Tau parallel manipulator", ICRA
2006, whose own dimensions were not at hand. Tracks, joints and platform are those of the shipped Gantry-Tau (Table II of
Dressler, Brogardh and Robertsson 2010); the carts of one track stand apart by ``APART``, and the links are as long as that
asks. Masses are ours.
"""

from __future__ import annotations

import numpy as np
from machine_sketch import Carrier, Sketch, SketchRod

from gtpin import load_robot

APART = {"1": 0.0, "2a": 0.25, "2b": -0.25, "3a": 0.5, "3b": 0.0, "3c": -0.5}
"""How far ahead of the 3-DOF machine's cart each link's own stands at home, m."""


def sketch() -> Sketch:
    machine = load_robot("gantry_tau")
    home = machine.description.home
    assert home is not None
    carriers, rods = [], []
    for rod in machine.rods:
        assert rod.carrier is not None
        axis = machine.actuators[rod.carrier].axis
        seat = rod.C + APART[rod.name] * axis
        cart = f"cart{rod.name}"
        carriers.append(Carrier(cart, seat, axis, (-0.2, 0.2), mass=15.0))
        rods.append(SketchRod(rod.site, rod.P, seat, carrier=cart, mass=4.1))
    return Sketch(
        "gantry_tau_6dof",
        rods,
        carriers,
        home=np.zeros(6).tolist(),
        T=home.tcp_xyz,
        rotvec=home.tcp_rotvec,
        plate_mass=22.0,
        plate_center=(-0.09, 0.0, 0.02),
        tolerance={
            "link_length": 1e-3,
            "platform_joint": 1e-3,
            "cart_joint": 2e-3,
            "track_direction": 1e-3,
            "scale": 5e-4,
        },
        note="A Gantry-Tau with variable orientation: six carts on three tracks, in the spirit of Williams, Hovland, "
        "Brogardh 2006. Tracks, joints and platform: Table II of Dressler, Brogardh, Robertsson 2010; where the carts "
        "stand, link lengths and masses are ours. Written by examples/machines/gantry_tau_6dof.py.",
    )
