"""The problem that the benchmarks share, and SciPy's solution of it to compare with."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # SciPy on one core, as gtpin does it

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.kinematics.kinematics import Kinematics

Floats = npt.NDArray[np.float64]


@pytest.fixture(scope="session")
def robot() -> gtpin.Robot:
    return gtpin.load_robot("gantry_tau")


@pytest.fixture(scope="session")
def rods(robot: gtpin.Robot) -> Kinematics:
    return Kinematics(gtpin.Geometry.nominal(robot))


@pytest.fixture(scope="session")
def neighbours() -> Floats:
    """Commands, each within 50 mm a cart of the one before."""
    rng = np.random.default_rng(0)
    q = np.zeros((200, 3))
    for i in range(1, len(q)):
        q[i] = np.clip(q[i - 1] + rng.uniform(-0.05, 0.05, 3), -0.65, 0.7)
    return q


@pytest.fixture(scope="session")
def by_fsolve(robot: gtpin.Robot) -> Callable[[Floats], Floats]:
    """SciPy's fsolve on the six closures, each posture from the one before: position and rotation vector."""
    P, C0, L = (np.array([getattr(rod, part) for rod in robot.rods]) for part in ("P", "C", "L"))
    carts = np.array([0, 1, 1, 2, 2, 2])
    v = np.array([robot.actuators[cart].axis for cart in carts])
    home = gtpin.home(robot)
    start = np.concatenate([home.T, Rotation.from_matrix(home.R).as_rotvec()])

    def closures(x: Floats, C: Floats) -> Floats:
        w = x[3:]
        angle = np.sqrt(w @ w)
        K = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        R = np.eye(3) + np.sin(angle) / angle * K + (1.0 - np.cos(angle)) / angle**2 * (K @ K)
        d = x[:3] + P @ R.T - C
        return np.asarray((d * d).sum(axis=1) - L**2)

    def solve(q: Floats) -> Floats:
        x, found = start, np.empty((len(q), 6))
        for i, row in enumerate(q):
            x = fsolve(closures, x, args=(C0 + row[carts, None] * v,), xtol=1e-13)
            found[i] = x
        return found

    return solve
