"""Inverse kinematics: the commands that bring the TCP to wanted poses."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.kinematics import Kinematics, nominal
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture
from gtpin.kinematics.rotations import log
from gtpin.real import real
from gtpin.typing import Floats

MAX_STEPS = 40
LARGEST = 1.0
"""Largest step of a turning actuator, rad: near a singularity a Newton step can be many turns."""
STARTS = 20
"""Number of commands from which the search begins for an open chain, before a pose counts as out of reach."""
SMALLEST = 1e-3
"""Fraction of a Newton step below which another start is tried."""
INSIDE = 1e-9
"""Distance, m or rad, from the range of a command, within which it counts as inside."""
TOLERANCE = 1e-12
"""Error of the TCP, m and rad, below which the method has converged."""


def reach(posture: ClosedPosture, T: npt.ArrayLike, R: npt.ArrayLike | None = None) -> ClosedPosture:
    """Move a robot until its TCP is at T, with the rotation R if it is given, by Newton's method on the commands.

    Parameters
    ----------
    posture
        The posture to start from; its assembly mode is kept.
    T
        (3,) wanted position, base frame, m.
    R
        (3, 3) wanted rotation from the TCP frame to the base frame; None: the orientation is free. With three actuators, as
        the Gantry-Tau has, a wanted rotation can't be reached.

    Returns
    -------
    posture
        A posture with the TCP at T, and with the rotation R where it is given.

    Raises
    ------
    UnreachableError
        If the TCP can't be brought there.
    ModelError
        If T or R is not of that shape.

    Examples
    --------
    >>> import gtpin
    >>> start = gtpin.home(gtpin.load_robot("gantry_tau"))
    >>> posture = gtpin.reach(start, start.T + [0.0, 0.1, 0.0])
    >>> print(f"{posture.T[1] - start.T[1]:.6f} m")
    0.100000 m
    """
    T = real(T, "a wanted position")[None]
    R = None if R is None else real(R, "a wanted rotation")[None]
    q = commands_for(nominal(posture.robot), T, R, posture.q[None])[0][0]
    if np.isnan(q).any():
        raise out_of_reach(posture.robot.name, T[0], R is not None)
    return posture.moved_to(q)


def commands_for(
    kinematics: Kinematics, T: Floats, R: Floats | None = None, start: Floats | None = None
) -> tuple[Floats, Poses]:
    """Commands that bring the TCP to many positions.

    Parameters
    ----------
    kinematics
        The kinematics to invert: ``model.kinematics``. Effects of the model are not in it.
    T
        (N, 3) wanted positions of the TCP, base frame, m.
    R
        (N, 3, 3) wanted rotations from the TCP frame to the base frame; None: the orientation is free.
    start
        (N, n) commands to start from, m or rad; home by default.

    Returns
    -------
    q, poses
        (N, n) commands, m or rad, and the (N) poses at them, base frame; both NaN where Newton's method does not converge.

    Raises
    ------
    ModelError
        If T, R or ``start`` does not have this shape.

    Examples
    --------
    >>> import gtpin
    >>> model = gtpin.read_model("gantry_tau")
    >>> there = model.kinematics.forward(model.robot.home_q[None])
    >>> q, poses = gtpin.commands_for(model.kinematics, there.T + [0.0, 0.1, 0.0])
    >>> q.shape, bool(poses.reached.all())
    ((1, 3), True)
    """
    check_wanted(T, R)
    home_q = kinematics.geometry.robot.home_q
    return _newton(kinematics, T, R, np.tile(home_q, (len(T), 1)) if start is None else start.copy())


def _newton(
    kinematics: Kinematics, T: Floats, R: Floats | None, q: Floats, ends: tuple[Floats, Floats] | None = None
) -> tuple[Floats, Poses]:
    """As :func:`commands_for`, from the commands q (N, n), which are changed; each step ends within ``ends``, (n,) each."""
    poses = kinematics.forward(q)
    finite = np.isfinite(T).all(axis=1) & (True if R is None else np.isfinite(R).all(axis=(1, 2)))
    rows = np.flatnonzero(poses.reached & finite)
    stride = np.ones(len(T))
    scale = max(1.0, kinematics.geometry.robot.size)
    for _ in range(MAX_STEPS):
        error = errors_of(poses[rows], T[rows], None if R is None else R[rows])
        far = np.abs(error).max(axis=1) > TOLERANCE * scale
        if ends is not None:
            far &= stride[rows] > SMALLEST
        rows, error = rows[far], error[far]
        if not rows.size:
            break
        jacobian = kinematics.command_jacobian(q[rows], poses[rows])[:, : error.shape[1]]
        step = np.einsum("nij,nj->ni", np.linalg.pinv(jacobian), error)
        if ends is not None:  # joints at an end of their range, which would leave it, stand still
            still = ((q[rows] <= ends[0]) & (step < 0.0)) | ((q[rows] >= ends[1]) & (step > 0.0))
            step = np.einsum("nij,nj->ni", np.linalg.pinv(jacobian * ~still[:, None]), error)
        turned = np.abs(step * kinematics.geometry.robot.revolute).max(axis=1, keepdims=True)
        step /= np.maximum(1.0, turned / LARGEST)
        trial = q[rows] + stride[rows, None] * step
        if ends is not None:
            trial = np.clip(trial, *ends)
        moved = kinematics.forward(trial)
        better = np.zeros(len(rows), dtype=bool)
        reached = moved.reached
        left = errors_of(moved[reached], T[rows[reached]], None if R is None else R[rows[reached]])
        better[reached] = np.linalg.norm(left, axis=1) < np.linalg.norm(error[reached], axis=1)
        q[rows[better]] = trial[better]
        poses.put(rows[better], moved[better])
        stride[rows[better]] = np.minimum(1.0, 2.0 * stride[rows[better]])
        stride[rows[~better]] /= 2.0
    final = np.full(len(T), np.inf)
    there = np.flatnonzero(poses.reached & finite)
    final[there] = np.abs(errors_of(poses[there], T[there], None if R is None else R[there])).max(axis=1)
    lost = final > 100.0 * TOLERANCE * scale
    q[lost], poses.T[lost], poses.R[lost] = np.nan, np.nan, np.nan
    return q, poses


def solved(kinematics: Kinematics, T: Floats, R: Floats | None, start: Floats) -> Floats:
    """(N, n) commands within their ranges for wanted poses, as :func:`commands_for`; NaN where none were found.

    The search of an open chain begins at ``start``, then at random commands, and its steps end within the ranges. Other starts
    of a robot with loops could be of another assembly mode.
    """
    robot = kinematics.robot
    if robot.constraints:
        found, _ = commands_for(kinematics, T, R, start)
        found[((found < robot.lower - INSIDE) | (found > robot.upper + INSIDE)).any(axis=1)] = np.nan
        return found
    ends = robot.lower, robot.upper
    begin = np.clip(start, *ends)
    low, high = np.maximum(ends[0], start - np.pi), np.minimum(ends[1], start + np.pi)
    rng, found, rows = np.random.default_rng(0), np.full(start.shape, np.nan), np.arange(len(T))
    for _ in range(STARTS):
        q, _ = _newton(kinematics, T[rows], None if R is None else R[rows], begin, ends)
        found[rows] = q - 2.0 * np.pi * robot.endless * np.round((q - start[rows]) / (2.0 * np.pi))
        rows = rows[np.isnan(q).any(axis=1)]
        if not rows.size:
            break
        begin = rng.uniform(low[rows], high[rows])
    return found


def out_of_reach(robot: str, T: Floats, turned: bool, row: int | None = None) -> UnreachableError:
    """The error of a wanted position (3,) of a robot, with a wanted rotation where ``turned``."""
    place = "" if row is None else f"row {row}: "
    if not np.isfinite(T).all():
        return UnreachableError(f"{place}{robot} is wanted where a number is not finite", hint="give finite numbers")
    where = ", ".join(f"{value:.6g}" for value in T)
    hint = "stay inside the workspace and the ranges of the commands"
    if turned:
        hint += ", and leave the orientation free unless there are six actuators"
    what = f"{place}{robot} can't bring its TCP to ({where}){' with that rotation' if turned else ''}"
    return UnreachableError(what, hint=f"{hint}, or start nearer (start)" if row is not None else hint)


def check_wanted(T: Floats, R: Floats | None) -> None:
    """Raise `ModelError` unless T is (N, 3) and R, where given, (N, 3, 3)."""
    if T.ndim != 2 or T.shape[1] != 3:
        raise ModelError(f"wanted positions of shape {T.shape}", hint="give three coordinates each")
    if R is not None and R.shape != (len(T), 3, 3):
        raise ModelError(f"wanted rotations of shape {R.shape}", hint="give one 3 x 3 matrix for each position")


def errors_of(poses: Poses, T: Floats, R: Floats | None) -> Floats:
    """(N, 3) wanted positions less those of poses, m; with wanted rotations (N, 6), then rotation vectors, rad; base frame."""
    position: Floats = T - poses.T
    if R is None:
        return position
    turn: Floats = np.hstack([position, log(R @ np.swapaxes(poses.R, 1, 2))])
    return turn
