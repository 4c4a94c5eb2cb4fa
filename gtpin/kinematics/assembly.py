"""Assembly of a robot at home: passive coordinates that nearly close the loops, without a first guess."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.optimize import least_squares

from gtpin.kinematics import newton
from gtpin.robot.chain import Chain

Floats = npt.NDArray[np.float64]

NEAR = 0.02
"""Distance of the loops' anchors, m, and of the platform from the URDF's home, m and rad, from which Newton's method converges.
Assumed."""
ATTEMPTS = 20
"""Largest number of starts: from zero, then from random coordinates. Assumed."""


def assemble(robot: Chain) -> Floats:
    """(nq,) configuration at the home commands whose loops are closed to within some millimetres.

    The pose in the URDF's ``<home>`` selects the assembly mode. A floating platform is placed at this pose, and the other
    passive joints are moved until the loops close. If the platform does not float, all passive joints are moved until the loops
    close with the platform as near to this pose as possible. Without a ``<home>`` the first closure that is found is used.
    """
    start = robot.with_commands(robot.neutral, robot.home_q)
    free = np.arange(robot.model.nv)[robot.passive]
    turned = np.ones(free.size, dtype=bool)
    platform = robot.model.joints[robot.home_joint]
    wanted: Any = None
    if robot.description.home and platform.nv == 6:
        start = _with_platform_at_home(robot, start)
        turned &= ~np.isin(free, np.arange(platform.idx_v, platform.idx_v + 6))
    elif robot.description.home and free.size:
        wanted = _home_of_platform(robot)
    count = np.count_nonzero(turned)

    def off(x: Floats) -> Floats:
        gap = _gap_vector(robot, _turned(robot, start, turned, x))
        return gap if wanted is None else np.concatenate([gap, _from(wanted, robot)])

    def largest(x: Floats) -> float:
        return float(np.abs(off(x)).max(initial=0.0))

    rng = np.random.default_rng(0)
    best, smallest = np.zeros(count), np.inf
    for attempt in range(ATTEMPTS):
        x = np.zeros(count) if attempt == 0 else rng.uniform(-np.pi, np.pi, count)
        if largest(x) > NEAR:
            x = np.asarray(least_squares(off, x, max_nfev=100).x)
        if largest(x) < smallest:
            best, smallest = x, largest(x)
        if smallest <= NEAR:
            break
    return _turned(robot, start, turned, best)


def _home_of_platform(robot: Chain) -> Any:
    """Placement in the base frame, at home, of the joint that carries the TCP."""
    home = robot.description.home
    assert home is not None
    return pin.SE3(pin.exp3(np.array(home.tcp_rotvec)), np.array(home.tcp_xyz)) * robot.home_placement.inverse()


def _from(wanted: Any, robot: Chain) -> Floats:
    """(6,) shift, m, and rotation vector, rad, from the wanted pose of the platform to the one in Pinocchio's data."""
    here = robot.data.oMi[robot.home_joint]
    return np.concatenate([here.translation - wanted.translation, pin.log3(here.rotation @ wanted.rotation.T)])


def _with_platform_at_home(robot: Chain, configuration: Floats) -> Floats:
    wanted = _home_of_platform(robot)
    pin.forwardKinematics(robot.model, robot.data, configuration)
    joint = robot.home_joint
    parent = robot.data.oMi[robot.model.parents[joint]] * robot.model.jointPlacements[joint]
    index = robot.model.idx_qs[joint]
    changed = configuration.copy()
    changed[index : index + 7] = pin.SE3ToXYZQUAT(parent.inverse() * wanted)
    return changed


def _turned(robot: Chain, configuration: Floats, which: npt.NDArray[np.bool_], x: Floats) -> Floats:
    """Configuration with some of the passive coordinates, a mask (p,), moved by x."""
    passive = np.zeros(robot.n_passive)
    passive[which] = x
    turned: Floats = pin.integrate(robot.model, configuration, robot.velocity(None, passive))
    return turned


def _gap_vector(robot: Chain, configuration: Floats) -> Floats:
    pin.computeJointJacobians(robot.model, robot.data, configuration)
    return newton.constraint_error(robot)
