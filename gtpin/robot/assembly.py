"""The assembly of a robot at home: passive coordinates that nearly close its loops, found without a first guess."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.robot.constrained_model import ConstrainedModel, joint_axis
from gtpin.robot.constraints import constraint_error, constraint_jacobian, is_determined, undetermined
from gtpin.typing import Floats

NEAR = 0.02
"""Distance of the loops' anchors, m, and of the platform from the URDF's home, m and rad, from which Newton's method converges.
Assumed."""
ATTEMPTS = 20
"""Largest number of starts: from zero, then from random coordinates. Assumed."""
CLOSED = 1e-9
"""Gap, m, below which a search has closed the loops."""
SAME = 1e-3
"""Difference of passive coordinates, m and rad, below which two searches have found one posture."""
SHOWN = 4
"""Largest number of assemblies that a warning names."""


@dataclass(frozen=True)
class Assembly:
    """The posture at home of a robot as its URDF describes it. It selects the assembly mode.

    - ``configuration``: (nq,) configuration at the home commands whose loops are closed to within some millimetres; the
      nearest that was found where they can't be closed.
    - ``gap``: largest component of the gaps that are left between the loops' anchors, m.
    - ``free``: (n_passive, k) orthonormal basis of the passive motions that the loops do not determine; k is zero for most
      robots.
    - ``chosen``: whether it was chosen among closed postures, because nothing in the URDF names one.
    - ``notes``: what a user should know: which posture was chosen where nothing names one, and motions that are not
      determined.
    """

    configuration: Floats
    gap: float
    free: Floats
    chosen: bool = False
    notes: tuple[str, ...] = ()


def assemble(robot: ConstrainedModel) -> Assembly:
    """The assembly of a robot.

    The pose in the URDF's ``<home>`` selects it. A floating platform is placed at this pose, and the other passive joints are
    moved until the loops close. If the platform does not float, all passive joints are moved until the loops close with the
    platform as near to this pose as possible.

    Without a ``<home>`` it is the posture with the passive joints at zero, if its loops nearly close. If they do not, it is the
    closed posture whose passive joints are nearest to zero.

    Raises `RobotError` if a passive motion that the loops do not determine moves the TCP.
    """
    start, notes = robot.with_commands(robot.neutral, robot.home_q), list[str]()
    if robot.description.home is not None:
        configuration = _at_declared_home(robot, start)
    elif not robot.n_passive or _largest_gap(robot, start) <= NEAR:
        configuration = start
    else:
        configuration = _nearest_to_zero(robot, start, notes)
    chosen = bool(notes)
    gap, free = _largest_gap(robot, configuration), np.zeros((robot.n_passive, 0))
    if not is_determined(robot, configuration):
        exact, gap = closest(robot, configuration)
        if gap <= CLOSED * robot.size:
            configuration, free = exact, undetermined(robot, exact, lambda x: closest(robot, x), notes)
    return Assembly(configuration, gap, free, chosen, tuple(notes))


def closest(robot: ConstrainedModel, configuration: Floats, tolerance: float = 1e-15) -> tuple[Floats, float]:
    """Configuration with the smallest gaps that least squares find from another one at its commands, and the largest gap, m.

    ``tolerance``: relative change of the gaps and of the passive coordinates at which the search ends.
    """
    from scipy.optimize import least_squares

    if not robot.n_passive:
        return configuration, _largest_gap(robot, configuration)
    every = np.ones(robot.n_passive, dtype=bool)

    def off(x: Floats) -> Floats:
        return _gaps(robot, _turned(robot, configuration, every, x))

    def slopes(x: Floats) -> Floats:
        off(x)
        return constraint_jacobian(robot)[:, robot.passive]

    # Coordinates of a floating platform do not add up, so that the derivative by all of them is not that of Pinocchio.
    exact = all(robot.model.nvs[j] == 1 for j in range(1, robot.model.njoints))
    found = least_squares(
        off,
        np.zeros(robot.n_passive),
        slopes if exact else "2-point",
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=100,
    )
    return _turned(robot, configuration, every, found.x), float(np.abs(found.fun).max(initial=0.0))


def _nearest_to_zero(robot: ConstrainedModel, start: Floats, notes: list[str]) -> Floats:
    """The closed configuration whose passive coordinates are nearest to those of ``start``, of several that are found.

    ``notes`` is told which one it is.
    """
    rng = np.random.default_rng(0)
    every, found = np.ones(robot.n_passive, dtype=bool), list[tuple[Floats, Floats]]()
    best, smallest = start, np.inf
    for attempt in range(ATTEMPTS):
        x = np.zeros(robot.n_passive) if attempt == 0 else rng.uniform(-np.pi, np.pi, robot.n_passive)
        configuration, gap = closest(robot, _turned(robot, start, every, x))
        if gap < smallest:
            best, smallest = configuration, gap
        if gap > CLOSED * robot.size:
            continue
        moved = _within_a_turn(robot, pin.difference(robot.model, start, configuration)[robot.passive])
        if all(np.abs(moved - other).max() > SAME for other, _ in found):
            found.append((moved, _turned(robot, start, every, moved)))
    if not found:
        return best
    found.sort(key=lambda one: float(np.linalg.norm(one[0])))
    notes.append(_which(robot, [configuration for _, configuration in found]))
    return found[0][1]


def _within_a_turn(robot: ConstrainedModel, moved: Floats) -> Floats:
    """Passive coordinates (p,) with angles between -pi and pi."""
    turning = np.zeros(robot.model.nv, dtype=bool)
    for joint in range(1, robot.model.njoints):
        if robot.model.nvs[joint] == 1:
            turning[robot.model.idx_vs[joint]] = joint_axis(robot.model, joint)[3:].any()
    return np.where(turning[robot.passive], (moved + np.pi) % (2.0 * np.pi) - np.pi, moved)


def _which(robot: ConstrainedModel, found: list[Floats]) -> str:
    homes = [_home_element(robot, configuration) for configuration in found[:SHOWN]]
    more = f", and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    others = f"; others are {', '.join(homes[1:])}{more}" if len(homes) > 1 else ""
    return (
        f"{robot.name} has no <home>, and its loops don't close with its passive joints at zero: the closed posture nearest to "
        f"zero is taken, {homes[0]}{others}; put one of these elements into <gtpin> to choose its assembly"
    )


def _home_element(robot: ConstrainedModel, configuration: Floats) -> str:
    numbers = home_attributes(robot, configuration, robot.home_joint, robot.home_placement, digits=6)
    written = " ".join(f'{key}="{value}"' for key, value in numbers.items())
    return f"<home {written}/>"


def home_attributes(
    robot: ConstrainedModel, configuration: Floats, joint: int, placement: Any, digits: int
) -> dict[str, str]:
    """The attributes of a ``<home>`` whose link has this placement on a joint, at a configuration (nq,) at home."""
    pin.forwardKinematics(robot.model, robot.data, configuration)
    pose = robot.data.oMi[joint] * placement
    numbers = {"q": robot.home_q, "tcp_xyz": pose.translation, "tcp_rotvec": pin.log3(pose.rotation)}
    return {key: " ".join(f"{round(value, digits) + 0.0:g}" for value in x) for key, x in numbers.items()}


def _at_declared_home(robot: ConstrainedModel, start: Floats) -> Floats:
    """Configuration whose loops are nearly closed with the platform at, or near, the pose of ``<home>``."""
    from scipy.optimize import least_squares

    free = np.arange(robot.model.nv)[robot.passive]
    turned = np.ones(free.size, dtype=bool)
    platform = robot.model.joints[robot.home_joint]
    wanted: Any = None
    if platform.nv == 6:
        start = _with_platform_at_home(robot, start)
        turned &= ~np.isin(free, np.arange(platform.idx_v, platform.idx_v + 6))
    elif free.size:
        wanted = _home_of_platform(robot)
    count = np.count_nonzero(turned)

    def off(x: Floats) -> Floats:
        gap = _gaps(robot, _turned(robot, start, turned, x))
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


def _home_of_platform(robot: ConstrainedModel) -> Any:
    """Placement in the base frame, at home, of the joint that carries the TCP."""
    home = robot.description.home
    assert home is not None
    return pin.SE3(pin.exp3(np.array(home.tcp_rotvec)), np.array(home.tcp_xyz)) * robot.home_placement.inverse()


def _from(wanted: Any, robot: ConstrainedModel) -> Floats:
    """(6,) shift, m, and rotation vector, rad, from the wanted pose of the platform to the one in Pinocchio's data."""
    here = robot.data.oMi[robot.home_joint]
    return np.concatenate([here.translation - wanted.translation, pin.log3(here.rotation @ wanted.rotation.T)])


def _with_platform_at_home(robot: ConstrainedModel, configuration: Floats) -> Floats:
    wanted = _home_of_platform(robot)
    pin.forwardKinematics(robot.model, robot.data, configuration)
    joint = robot.home_joint
    parent = robot.data.oMi[robot.model.parents[joint]] * robot.model.jointPlacements[joint]
    index = robot.model.idx_qs[joint]
    changed = configuration.copy()
    changed[index : index + 7] = pin.SE3ToXYZQUAT(parent.inverse() * wanted)
    return changed


def _turned(robot: ConstrainedModel, configuration: Floats, which: npt.NDArray[np.bool_], x: Floats) -> Floats:
    """Configuration with some of the passive coordinates, a mask (p,), moved by x."""
    passive = np.zeros(robot.n_passive)
    passive[which] = x
    turned: Floats = pin.integrate(robot.model, configuration, robot.tree_velocity(None, passive))
    return turned


def _gaps(robot: ConstrainedModel, configuration: Floats) -> Floats:
    pin.computeJointJacobians(robot.model, robot.data, configuration)
    return constraint_error(robot)


def _largest_gap(robot: ConstrainedModel, configuration: Floats) -> float:
    return float(np.abs(_gaps(robot, configuration)).max(initial=0.0))
