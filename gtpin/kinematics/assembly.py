"""Putting a robot together at home: passive coordinates that nearly close the loops, from nothing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.optimize import least_squares

from gtpin.kinematics import newton
from gtpin.robot.chain import Chain

Floats = npt.NDArray[np.float64]

NEAR = 0.02
"""Gap, m, below which Newton's method is left to finish."""
ATTEMPTS = 20


def assemble(robot: Chain) -> Floats:
    """(nq,) configuration at the home commands whose loops are closed to within some millimetres.

    Where the URDF names a home pose and the platform floats, the platform is put there and the remaining passive joints
    are turned until the rods meet their anchors; otherwise all passive joints are.
    """
    start = robot.with_commands(robot.neutral, robot.home_q)
    free = np.arange(robot.model.nv)[robot.passive]
    platform = robot.model.joints[robot.tcp_joint]
    if robot.description.home and platform.nv == 6:
        start = _with_platform_at_home(robot, start)
        free = np.setdiff1d(free, np.arange(platform.idx_v, platform.idx_v + 6))

    def gap(x: Floats) -> Floats:
        return _gap_vector(robot, _turned(robot, start, free, x))

    rng = np.random.default_rng(0)
    best, smallest = start, np.inf
    for attempt in range(ATTEMPTS):
        guess = np.zeros(free.size) if attempt == 0 else rng.uniform(-np.pi, np.pi, free.size)
        configuration = _turned(robot, start, free, guess)
        if _gap(robot, configuration).max(initial=0.0) > NEAR:
            found = least_squares(gap, guess, max_nfev=100)
            configuration = _turned(robot, start, free, found.x)
        largest = _gap(robot, configuration).max(initial=0.0)
        if largest < smallest:
            best, smallest = configuration, largest
        if smallest <= NEAR:
            break
    return best


def _with_platform_at_home(robot: Chain, configuration: Floats) -> Floats:
    home = robot.description.home
    assert home is not None
    wanted = pin.SE3(pin.exp3(np.array(home.tcp_rotvec)), np.array(home.tcp_xyz)) * robot.home_placement.inverse()
    pin.forwardKinematics(robot.model, robot.data, configuration)
    joint = robot.tcp_joint
    parent = robot.data.oMi[robot.model.parents[joint]] * robot.model.jointPlacements[joint]
    index = robot.model.idx_qs[joint]
    changed = configuration.copy()
    changed[index : index + 7] = pin.SE3ToXYZQUAT(parent.inverse() * wanted)
    return changed


def _turned(robot: Chain, configuration: Floats, free: npt.NDArray[np.int_], x: Floats) -> Floats:
    velocity = np.zeros(robot.model.nv)
    velocity[free] = x
    turned: Floats = pin.integrate(robot.model, configuration, velocity)
    return turned


def _gap_vector(robot: Chain, configuration: Floats) -> Floats:
    pin.computeJointJacobians(robot.model, robot.data, configuration)
    return newton.constraint_error(robot)


def _gap(robot: Chain, configuration: Floats) -> Floats:
    return np.abs(_gap_vector(robot, configuration))
