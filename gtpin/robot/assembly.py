"""The assembly of a robot at home: passive coordinates that nearly close its loops, found without a first guess."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.errors import listed
from gtpin.robot.constrained_model import POSTURES, ConstrainedModel, limits
from gtpin.robot.description import LEVER
from gtpin.robot.resting import joint_jacobian
from gtpin.typing import Floats

NEAR = 0.02
"""Distance of the loops' anchors, m, and of the platform from the URDF's home, m and rad, from which Newton's method converges.
Assumed."""
ATTEMPTS = 20
"""Largest number of starts: from zero, then from random coordinates. Assumed."""
EXACT = 1e-15
"""Relative change of gaps and of passive coordinates at which a search ends: that of rounding errors."""
CLOSED = 1e-9
"""Gap, m, below which a search has closed the loops."""
SAME = 1e-3
"""Difference of passive coordinates, m and rad, below which two searches have found one posture."""
SMALL = 0.2
"""Motion of passive joints, m and rad, up to which a posture that closes the loops from the named home counts as this home.
Assumed: smaller than the difference of assembly modes."""
NUDGE = 0.1
"""Change of the home commands, m and rad, by which motions of loops are examined that close only by an exact geometry."""
ROUNDED = 5e-3
"""Angle, rad, between axes up to which they count as parallel where the loops close only so: a right angle and half a turn of
three digits, 1.57 and 3.14, are off by 0.8 and 1.6 mrad, and a loop has several."""
ZERO = 1e-7
"""Ratio to the largest singular value of the closures' derivative below which a singular value is zero. URDFs have five digits
or more, but the closures are exact at home, and a joint that is not needed has a singular value of rounding errors."""
CLEAR = 1e-2
"""Such a ratio at a posture whose loops are closed to some millimetres, above which all passive motions are determined."""
TELLING = 1e-2
"""Change of the home commands, m and rad, that distinguishes a singularity at home from a motion that is never determined."""
NEGLIGIBLE = 0.05
"""Smallest weight of a joint that is named."""

SHOWN = 4
"""Largest number of assemblies that a warning names."""
NAMED = 8
"""Largest number of joints that are named."""


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

    Without such a pose it is the posture with the passive joints where the file has them at home (an MJCF's keyframe), or at
    zero, if its loops nearly close. If they do not, it is the nearest closed posture, of those within the joints' ranges if
    there is one.

    Loops that close only because axes are exactly parallel or meet in one point are left open across their motion:
    see :func:`_without_redundant`.

    Raises `RobotError` if a passive motion that the loops do not determine moves the TCP, or if the frames of loops of type
    ``fixed`` can't meet.
    """
    start, notes = robot.start, list[str]()
    if robot.description.home is not None:
        configuration = _at_declared_home(robot, start)
    elif not robot.n_passive or _largest_gap(robot, start) <= NEAR:
        configuration = start
    else:
        configuration, gap = closest(robot, start) if robot.description.posture else (start, np.inf)
        moved = pin.difference(robot.model, start, configuration)[robot.passive]
        if gap > CLOSED * robot.size or np.abs(moved).max() > SMALL:
            configuration = _nearest(robot, start, notes)
    chosen, gap, free = bool(notes), _largest_gap(robot, configuration), np.zeros((robot.n_passive, 0))
    slopes = _slopes(robot, configuration)
    if _null_space(slopes, CLEAR).shape[1]:
        exact, gap = closest(robot, configuration)
        if gap <= CLOSED * robot.size:
            configuration, free = exact, _undetermined(robot, exact, notes)
    if len(slopes) > robot.n_passive - free.shape[1]:
        configuration, gap = _without_redundant(robot, configuration, notes)
    if any(loop.point_of for loop in robot.description.loops):
        configuration, gap = closest(robot, configuration)
        _check_frames(robot, configuration, gap, notes)
    return Assembly(configuration, gap, free, chosen, tuple(notes))


def _without_redundant(robot: ConstrainedModel, configuration: Floats, notes: list[str]) -> tuple[Floats, float]:
    """Leave loops open across the motions of their anchors, where they have more equations than motions.

    Of a planar or spherical linkage one equation of each loop holds by its exact geometry alone. Numbers of a file are
    rounded: the loop is then closed in the sense of least squares, and in all other directions exactly. ``notes`` gets a
    message of a gap that is left.

    Returns the configuration and the largest gap in the remaining equations, m.
    """
    exact, gap = closest(robot, configuration)
    if gap > tolerance(robot):
        return configuration, gap
    rng = np.random.default_rng(0)
    nudged = [robot.home_q + NUDGE * rng.uniform(-1.0, 1.0, robot.n_actuators) for _ in range(POSTURES)]
    near = [exact, *(closest(robot, robot.with_commands(exact, q))[0] for q in nudged)]
    before, planes = robot.closing(np.eye(len(robot.gaps()))), robot.planes_of(robot.relative_motions(near), ROUNDED)
    robot.leave_open(tuple(own if len(own) else new for own, new in zip(robot.planes, planes, strict=True)))
    found, gap = closest(robot, exact)
    _gaps(robot, found)
    left = float(np.abs(before @ robot.gaps()).max(initial=0.0))
    if left > CLOSED * robot.size:
        notes.append(_left_open(robot, found, left))
    return found, gap


def _check_frames(robot: ConstrainedModel, configuration: Floats, gap: float, notes: list[str]) -> None:
    """Refuse frames of loops of type ``fixed`` whose points stay open by a gap, m; ``notes`` gets the angles that are left."""
    if gap > tolerance(robot):
        found = f"{gap:.3g} m is the smallest gap found of their points"
        rounding = f"up to {tolerance(robot):.2g} m is rounding"
        what = f"the frames of the loops of {robot.name} don't meet: {found}"
        raise robot.description.error(what, f"mend the joints or the frames; {rounding}")
    _gaps(robot, configuration)
    loops = robot.description.loops
    left = {loop.name: own for loop, own in zip(loops, robot.gaps().reshape(-1, 3), strict=True)}
    apart = max(float(np.linalg.norm(left[loop.name] - left[loop.point_of])) for loop in loops if loop.point_of) / LEVER
    if apart > CLOSED * robot.size and not robot.description.planes:  # those of a calibrated geometry are named
        stay = f"the frames of a fixed loop of {robot.name} stay {1e3 * apart:.2g} mrad apart"
        notes.append(f"{stay}, about axes about which its joints do not turn")


def tolerance(robot: ConstrainedModel) -> float:
    """Gap, m, up to which loops count as closed but for rounded numbers: `ROUNDED` times the size of the loops."""
    ends = np.array([(robot.data.oMi[joint] * placement).translation for joint, placement in robot.anchors])
    own = np.array([robot.data.oMi[joint].translation for joint in robot.loop_joints])
    return ROUNDED * float(np.linalg.norm(np.ptp(np.vstack([ends, own]), axis=0)))


def _left_open(robot: ConstrainedModel, configuration: Floats, gap: float) -> str:
    """What a user should know of loops that are open by a gap, m: which axes are not parallel, and by how much."""
    pin.computeJointJacobians(robot.model, robot.data, configuration)
    joints = [j for j in robot.loop_joints if robot.model.nvs[j] == 1]
    twists = {j: joint_jacobian(robot.model, robot.data, j)[3:, robot.model.idx_vs[j]] for j in joints}
    pairs = combinations([j for j in joints if twists[j].any()], 2)
    angles = {(a, b): float(np.linalg.norm(np.cross(twists[a], twists[b]))) for a, b in pairs}
    what = "the joints' axes do not quite meet in one point"
    if angles and max(angles.values()) < 4.0 * ROUNDED:
        most = max(angles, key=lambda pair: angles[pair])
        names = " and ".join(str(robot.model.names[j]) for j in most)
        what = f"the axes of {names} are {1e3 * angles[most]:.2g} mrad from parallel, taken as a planar loop"
    return (
        f"the loops of {robot.name} close only to {gap:.2g} m at home: {what}; up to {tolerance(robot):.2g} m is taken as "
        "rounded numbers, and left open across the motion of the loop"
    )


def closest(robot: ConstrainedModel, configuration: Floats) -> tuple[Floats, float]:
    """Configuration with the smallest gaps that least squares find from another one at its commands, and the largest gap, m."""
    from scipy.optimize import least_squares

    if not robot.n_passive:
        return configuration, _largest_gap(robot, configuration)

    def off(x: Floats) -> Floats:
        return _gaps(robot, _moved(robot, configuration, x))

    def slopes(x: Floats) -> Floats:
        _gaps(robot, _moved(robot, configuration, x))
        return np.asarray(robot.seeking @ robot.gaps_jacobian(robot.data)[:, robot.passive])

    # Coordinates of a floating platform do not add up, so that the derivative by all of them is not that of Pinocchio.
    way: Any = slopes if all(robot.model.nvs[j] == 1 for j in range(1, robot.model.njoints)) else "2-point"
    found = least_squares(off, np.zeros(robot.n_passive), way, ftol=EXACT, xtol=EXACT, gtol=EXACT, max_nfev=100)
    return _moved(robot, configuration, found.x), float(np.abs(found.fun).max(initial=0.0))


def _nearest(robot: ConstrainedModel, start: Floats, notes: list[str]) -> Floats:
    """The closed configuration whose passive coordinates are nearest to those of ``start``, of several that are found.

    Those with joints outside their ranges are taken only where there is no other. Of mirrored ones the same is taken whatever
    the file's last digits are. ``notes`` gets which one it is.
    """
    rng = np.random.default_rng(0)
    found = list[tuple[Floats, float, Floats]]()
    lower, upper = _ranges(robot, start)
    middle = np.clip(0.0, lower, upper)
    best, smallest = start, np.inf
    for attempt in range(ATTEMPTS):
        x = middle
        if attempt:
            x = rng.uniform(np.maximum(lower, middle - np.pi), np.minimum(upper, middle + np.pi))
        configuration, gap = closest(robot, _moved(robot, start, x))
        if gap < smallest:
            best, smallest = configuration, gap
        moved = _within_a_turn(robot, pin.difference(robot.model, start, configuration)[robot.passive], lower, upper)
        if gap <= tolerance(robot) and all(np.abs(moved - other).max() > SAME for other, *_ in found):
            found.append((moved, gap, _moved(robot, start, moved)))
    found = [one for one in found if one[1] <= CLOSED * robot.size] or found  # else closed but for rounded numbers
    if not found:
        return best

    def order(one: tuple[Floats, float, Floats]) -> tuple[Any, ...]:
        x = one[0]
        outside = bool(((x < lower - SAME) | (x > upper + SAME)).any())
        return outside, round(float(np.linalg.norm(x)) / SAME), tuple(-np.round(x / SAME))

    found.sort(key=order)
    notes.append(_which(robot, [configuration for *_, configuration in found]))
    return found[0][-1]


def _ranges(robot: ConstrainedModel, start: Floats) -> tuple[Floats, Floats]:
    """(p,) and (p,) smallest and largest motions of the passive coordinates from ``start`` within their ranges."""
    model = robot.model
    lower, upper = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    for joint in range(1, model.njoints):
        if model.nvs[joint] == 1:
            v, at = int(model.idx_vs[joint]), start[model.idx_qs[joint]]
            lower[v], upper[v] = (end - at for end in limits(model, joint))
    return lower[robot.passive], upper[robot.passive]


def _within_a_turn(robot: ConstrainedModel, moved: Floats, lower: Floats, upper: Floats) -> Floats:
    """Passive coordinates (p,) with angles between -pi and pi, or by whole turns within their ranges, (p,) each."""
    turns = 2.0 * np.pi
    near = (moved + np.pi) % turns - np.pi
    inside = near + turns * (
        np.maximum(0.0, np.ceil((lower - near) / turns)) + np.minimum(0.0, np.floor((upper - near) / turns))
    )
    near = np.where((lower <= inside) & (inside <= upper), inside, near)
    return np.where(robot.whole_turns[robot.passive], near, moved)


def _which(robot: ConstrainedModel, found: list[Floats]) -> str:
    def home(configuration: Floats) -> str:
        if not urdf:
            return _coordinates(robot, configuration)
        numbers = home_attributes(robot, configuration, robot.home_joint, robot.home_placement, digits=6)
        written = " ".join(f'{key}="{value}"' for key, value in numbers.items())
        return f"<home {written}/>"

    urdf = robot.description.kind == "urdf"
    homes = list(dict.fromkeys(map(home, found)))
    more = f", and {len(homes) - SHOWN} more" if len(homes) > SHOWN else ""
    others = f"; others are {', '.join(homes[1:SHOWN])}{more}" if len(homes) > 1 else ""
    where, start = f"{robot.name} has no <home>, and its loops don't close with its passive joints at zero", "zero"
    choose = "put one of these elements into <gtpin> to choose its assembly"
    if not urdf:
        where = f"the loops of {robot.name} are open at its initial posture"
        choose = "give a <key> of <keyframe> near one of them to choose its assembly"
    if robot.description.posture:
        where, start = f"the loops of {robot.name} are open at its home", "it"
        choose = choose.replace("into <gtpin>", "into <gtpin>, in the place of its <home>,")
    return f"{where}: the closed posture nearest to {start} is taken, {homes[0]}{others}; {choose}"


def _coordinates(robot: ConstrainedModel, configuration: Floats) -> str:
    """The coordinates of the passive joints, m or rad, with their names."""
    moved = pin.difference(robot.model, robot.neutral, configuration)
    joints = (robot.model.getJointId(name) for name in robot.readable)
    return " ".join(f"{robot.model.names[j]}={moved[robot.model.idx_vs[j]]:.4g}" for j in joints)


def home_attributes(
    robot: ConstrainedModel, configuration: Floats, joint: int, placement: Any, digits: int
) -> dict[str, str]:
    """The attributes of a ``<home>`` whose link has this placement on a joint, at a configuration (nq,) at home."""
    pin.forwardKinematics(robot.model, robot.data, configuration)
    pose = robot.data.oMi[joint] * placement
    numbers = {"q": robot.home_q, "tcp_xyz": pose.translation, "tcp_rotvec": pin.log3(pose.rotation)}
    return {key: " ".join(f"{round(value, digits) + 0.0:.{digits}g}" for value in x) for key, x in numbers.items()}


def _at_declared_home(robot: ConstrainedModel, start: Floats) -> Floats:
    """Configuration whose loops are nearly closed with the platform at, or near, the pose of ``<home>``."""
    from scipy.optimize import least_squares

    home, model = robot.description.home, robot.model
    assert home is not None
    wanted = pin.SE3(pin.exp3(np.array(home.tcp_rotvec)), np.array(home.tcp_xyz)) * robot.home_placement.inverse()
    free, platform = robot.passive, model.joints[robot.home_joint]
    floats = platform.nv == 6
    turned = ~(np.isin(free, np.arange(platform.idx_v, platform.idx_v + 6)) & floats)
    if floats:
        pin.forwardKinematics(model, robot.data, start)
        parent = robot.data.oMi[model.parents[robot.home_joint]] * model.jointPlacements[robot.home_joint]
        start = start.copy()
        start[platform.idx_q : platform.idx_q + 7] = pin.SE3ToXYZQUAT(parent.inverse() * wanted)

    def at(x: Floats) -> Floats:
        every = np.zeros(len(free))
        every[turned] = x
        return _moved(robot, start, every)

    def off(x: Floats) -> Floats:
        gap, here = _gaps(robot, at(x)), robot.data.oMi[robot.home_joint]
        if floats or not free.size:
            return gap
        return np.concatenate([gap, here.translation - wanted.translation, pin.log3(here.rotation @ wanted.rotation.T)])

    rng, count = np.random.default_rng(0), int(np.count_nonzero(turned))
    best, smallest = np.zeros(count), np.inf
    for attempt in range(ATTEMPTS):
        x = np.zeros(count) if attempt == 0 else rng.uniform(-np.pi, np.pi, count)
        if np.abs(off(x)).max(initial=0.0) > NEAR:
            x = np.asarray(least_squares(off, x, max_nfev=100).x)
        if (gap := float(np.abs(off(x)).max(initial=0.0))) < smallest:
            best, smallest = x, gap
        if smallest <= NEAR:
            break
    return at(best)


def _moved(robot: ConstrainedModel, configuration: Floats, x: Floats) -> Floats:
    """Configuration with the passive coordinates moved by x (p,)."""
    moved: Floats = pin.integrate(robot.model, configuration, robot.fold[:, robot.passive] @ x)
    return moved


def _gaps(robot: ConstrainedModel, configuration: Floats) -> Floats:
    pin.computeJointJacobians(robot.model, robot.data, configuration)
    return np.asarray(robot.seeking @ robot.gaps())


def _largest_gap(robot: ConstrainedModel, configuration: Floats) -> float:
    return float(np.abs(_gaps(robot, configuration)).max(initial=0.0))


def _undetermined(robot: ConstrainedModel, home: Floats, notes: list[str]) -> Floats:
    """(n_passive, k) orthonormal basis of the passive motions, m and rad, that leave all loops closed with the commands fixed.

    Where they do not move the TCP, ``notes`` gets their joints.

    ``home``: (nq,) configuration at home, with closed loops.

    Raises `RobotError` if such a motion moves the TCP.
    """
    free = _null_space(_slopes(robot, home))
    if not free.shape[1]:
        return free
    nudge = TELLING * np.random.default_rng(0).uniform(0.5, 1.0, robot.n_actuators)
    there, gap = closest(robot, robot.with_commands(home, robot.home_q + nudge))
    near = _null_space(_slopes(robot, there))
    if gap > 1e-9 * robot.size or near.shape[1] < free.shape[1]:
        return np.zeros((robot.n_passive, 0))  # a singularity at home: paths from there say so
    pin.computeJointJacobians(robot.model, robot.data, home)
    frame = pin.getFrameJacobian(robot.model, robot.data, robot.tcp_joint, robot.tcp_placement, pin.LOCAL_WORLD_ALIGNED)
    tcp = robot.folded(np.reshape(np.array(frame), (6, robot.model.nv)))[:, robot.passive] @ free
    count = free.shape[1]
    what = f"{count} passive motion{'s' if count > 1 else ''} of {robot.name}"
    named = _named(robot, free)
    if np.abs(tcp).max() > ZERO * robot.size:
        equations = len(_slopes(robot, home))
        raise robot.description.error(
            f"{what} can't be determined, and the TCP moves with it: of {named} with the loops closed ({robot.n_passive} "
            f"passive coordinates, {equations} closure equations)",
            "drive one of these joints, make it fixed, or add the loop that is missing",
        )
    notes.append(
        f"{what} can't be determined, of {named}; the TCP does not move with it, and it is kept as small as can be"
    )
    return free


def _slopes(robot: ConstrainedModel, configuration: Floats) -> Floats:
    pin.computeJointJacobians(robot.model, robot.data, configuration)
    return robot.closing(robot.gaps_jacobian(robot.data))[:, robot.passive]


def _null_space(matrix: Floats, zero: float = ZERO) -> Floats:
    _, sizes, rows = np.linalg.svd(matrix)
    rank = int(np.count_nonzero(sizes > zero * sizes.max(initial=0.0)))
    return np.asarray(rows[rank:].T)


def _named(robot: ConstrainedModel, free: Floats) -> str:
    """Names and weights of the joints that take part in some motions: a joint that alone makes one up has a weight of 1."""
    owners = np.repeat(list(robot.model.names), list(robot.model.nvs))[robot.passive]
    weights = np.linalg.norm(free, axis=1)
    joints = {str(name): float(weights[owners == name].max()) for name in dict.fromkeys(owners)}
    named = sorted((name for name in joints if joints[name] >= NEGLIGIBLE), key=lambda name: -joints[name])
    return listed([f"{name} ({joints[name]:.2f})" for name in named], NAMED)
