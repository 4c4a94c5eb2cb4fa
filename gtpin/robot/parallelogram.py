"""The reduced arm: a robot whose plate has a constant orientation, with equal and parallel rods at each cart."""

from __future__ import annotations

import numpy as np

from gtpin.robot.chain import Chain
from gtpin.robot.description import RobotDescription
from gtpin.robot.export import to_urdf
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats


def parallelogram(robot: Chain, R: Floats) -> Chain:
    """The robot with a plate of constant orientation: the rods of a cart are equal and parallel (Dressler et al. 2010, eqs. 1
    to 3).

    ``R``: (3, 3) the plate's constant rotation, base frame.
    """
    P = np.array([rod.P for rod in robot.rods])
    carrier = np.array(robot.rod_carriers)
    # Each rod is moved in parallel so that its joint on the platform is the TCP.
    joints = np.array([rod.C for rod in robot.rods]) - P @ R.T
    C = np.array([joints[carrier == i].mean(axis=0) for i in range(robot.n_actuators)])
    L = np.array([np.mean([rod.L for rod in robot.rods if rod.carrier == i]) for i in range(robot.n_actuators)])
    v = np.array([robot.actuators[i].axis for i in carrier])
    xml = to_urdf(Geometry(robot, (), np.zeros(0)), P, C[carrier] + P @ R.T, L[carrier], v, (_meet(robot, C, L), R))
    return Chain(RobotDescription.parse(xml, source=f"{robot.name} with a reduced arm"), robot.tcp_frame)


def _meet(robot: Chain, C: Floats, L: Floats) -> Floats:
    """(3,) TCP of the reduced arm at commands 0, base frame, m: the point near the nominal home at which its rods meet."""
    home = robot.description.home
    T = np.zeros(3) if home is None else np.array(home.tcp_xyz)
    for _ in range(50):
        d = T - C
        step = np.linalg.lstsq(d, (L**2 - (d**2).sum(axis=1)) / 2.0, rcond=None)[0]
        T = T + step
        if np.abs(step).max() < 1e-14:
            break
    return np.asarray(T)
