"""The Gantry-Tau's closures and springs once more, of the tests' own: only the nominal numbers come from gtpin."""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.accuracy.expected import closure_response
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.robot.description import RobotDescription

sys.path.append(str(Path(__file__).parents[1] / "kinematics"))
import machines

Floats = np.ndarray

ROBOT = gtpin.load_robot("gantry_tau")
MODEL = gtpin.Model(gtpin.Geometry.nominal(ROBOT))
LINKS = ("1", "2a", "2b", "3a", "3b", "3c")
CART = np.array([0, 1, 1, 2, 2, 2])


def commands(count: int, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).uniform(-0.6, 0.6, (count, 3))


def other(name: str) -> gtpin.Model:
    """Another machine with rods, written by the kinematics' tests."""
    machine = machines.MAKERS[name]()
    return gtpin.Model(gtpin.Geometry.nominal(gtpin.Robot(RobotDescription.parse(machine.urdf, machine.name))))


def numbers() -> dict[str, Floats]:
    """P, C (6, 3), L (6,) and v (6, 3)."""
    return {
        "P": np.array([rod.P for rod in ROBOT.rods]),
        "C": np.array([rod.C for rod in ROBOT.rods]),
        "L": np.array([rod.L for rod in ROBOT.rods]),
        "v": np.array([ROBOT.actuators[i].axis for i in CART]),
    }


def closures(n: dict[str, Floats], q: Floats, T: Floats, R: Floats) -> Floats:
    """(6,) |T + R P - C0 - q v|^2 - L^2, m^2, of one pose."""
    d = T + n["P"] @ R.T - n["C"] - q[CART, None] * n["v"]
    return (d**2).sum(axis=1) - n["L"] ** 2


def pose(n: dict[str, Floats], q: Floats, T: Floats, R: Floats) -> tuple[Floats, Floats]:
    """The pose near T, R at which the closures vanish."""

    def turned(x: Floats) -> tuple[Floats, Floats]:
        return T + x[:3], Rotation.from_rotvec(x[3:]).as_matrix() @ R

    x = np.zeros(6)
    for _ in range(4):  # Newton's method by central differences
        J = [(closures(n, q, *turned(x + e)) - closures(n, q, *turned(x - e))) / 2e-4 for e in 1e-4 * np.eye(6)]
        x = x - np.linalg.solve(np.transpose(J), closures(n, q, *turned(x)))
    assert np.abs(closures(n, q, *turned(x))).max() < 1e-12
    return turned(x)


def stepped(parameter: str, link: int, step: float) -> dict[str, Floats]:
    n = numbers()
    if parameter == "L":
        n["L"][link] += step
    else:
        n[parameter[0]][link, "xyz".index(parameter[1])] += step
    return n


def drawn_measurements(model: gtpin.Model, q: Floats, sigmas: Floats, seed: int = 0) -> Poses:
    """Poses (N), base frame, of a machine whose closures miss the model's by Gaussian residuals of sigmas (k,), m^2."""
    poses = model.predict(q)
    residual = sigmas * np.random.default_rng(seed).standard_normal((len(q), len(sigmas)))
    off = np.einsum("nij,nj->ni", closure_response(model.kinematics, q, poses), residual)
    return Poses(poses.T + off[:, :3], exp(off[:, 3:]) @ poses.R)
