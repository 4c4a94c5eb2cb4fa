"""The Gantry-Tau as gtpin has it, and as the tests' own closures."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from closures import Closures, nominal

import gtpin
from gtpin.accuracy.expected import closure_response
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.robot.description import RobotDescription

sys.path += [str(Path(__file__).parents[up] / folder) for up, folder in ((1, "kinematics"), (2, "examples/machines"))]
import machines

Floats = np.ndarray

ROBOT = gtpin.load_robot("gantry_tau")
MODEL = gtpin.Model(gtpin.Geometry.nominal(ROBOT))
LINKS = ("1", "2a", "2b", "3a", "3b", "3c")
NOMINAL = nominal("gantry_tau")


def commands(count: int, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).uniform(-0.6, 0.6, (count, 3))


def other(name: str) -> gtpin.Model:
    """Another machine with rods, written by the kinematics' tests."""
    machine = machines.MAKERS[name]()
    return gtpin.Model(gtpin.Geometry.nominal(gtpin.Robot(RobotDescription.parse(machine.urdf, machine.name))))


def stepped(parameter: str, link: int, step: float) -> Closures:
    """The nominal machine with one parameter of one link changed; a direction is not made a unit vector again."""
    table = {"L": "L0", "P": "P", "C": "C0", "v": "axis"}[parameter[0]]
    values = getattr(NOMINAL, table).copy()
    values[link if parameter == "L" else (link, "xyz".index(parameter[1]))] += step
    return replace(NOMINAL, **{table: values})


def drawn_measurements(model: gtpin.Model, q: Floats, sigmas: Floats, seed: int = 0) -> Poses:
    """Poses (N), base frame, of a machine whose closures miss the model's by Gaussian residuals of sigmas (k,), m^2."""
    poses = model.predict(q)
    residual = sigmas * np.random.default_rng(seed).standard_normal((len(q), len(sigmas)))
    off = np.einsum("nij,nj->ni", closure_response(model.kinematics, q, poses), residual)
    return Poses(poses.T + off[:, :3], exp(off[:, 3:]) @ poses.R)
