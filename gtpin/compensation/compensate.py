"""Commands that bring the TCP to wanted poses, with all effects of the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.effects.active import warn_of_other_times
from gtpin.effects.operating_points import Column
from gtpin.errors import ConvergenceError, ModelError, UnreachableError, warn
from gtpin.kinematics.inverse import check_wanted, commands_for, errors_of
from gtpin.model.model import Frame, Model
from gtpin.real import real
from gtpin.typing import Floats, Mask

TOLERANCE = 1e-9
"""Largest accepted error of the TCP, m and rad."""
STEPS = 25
"""Largest number of Newton steps."""
SINGULAR = 1e-2
"""Singular values of a Jacobian, relative to the largest, that are treated as zero. Near a singular posture, an error of
micrometres would otherwise change the commands a lot: for an arm of 1 m, 0.01 limits the change to 0.1 rad per mm of error."""
NOT_THE_MACHINE = {
    "frame": "it moves the instrument, not the machine; base frame: the mean over the measurements, not that at their start",
    "platform": "it moves the target; the data do not show whether the tool moves with it; target: its mean place",
}
"""Sites of effects of the measurement, which are not corrected, and why."""


def machine_of(model: Model) -> Model:
    """A model without its instrument: poses of the robot's own TCP (:meth:`~gtpin.model.model.Model.of_tool`) in the base
    frame, without effects of the measurement frame and of the target.

    A warning lists the omitted effects.
    """
    left = [effect.name for effect in model.effects if effect.site in NOT_THE_MACHINE]
    for site, why in NOT_THE_MACHINE.items():
        if names := [effect.name for effect in model.effects if effect.site == site]:
            warn(f"not corrected: {', '.join(names)}: {why}")
    return replace(model.of_tool().without(left), frame=Frame())


def compensate(
    model: Model,
    wanted: npt.ArrayLike,
    covariates: Mapping[str, Column] | None = None,
    *,
    rotations: npt.ArrayLike | None = None,
    start: npt.ArrayLike | None = None,
) -> Floats:
    """Commands that bring the TCP to wanted poses, by Newton's method on the complete prediction.

    ``model``: geometry and effects; see :func:`machine_of` for the effects that are ignored. ``wanted``: (N, 3) positions
    of the TCP, base frame, m. ``covariates``: by name, (N,) each: conditions at the wanted poses (payload, temperatures,
    approaches, ...). ``rotations``: (N, 3, 3) rotations of the TCP, base frame; only for robots with six actuators or more.
    By default, the orientation is free. ``start``: (N, n) commands to start from, m or rad, by default home. With one or two
    actuators the position is met as far as they move the TCP. A robot without rods often has several postures for a pose; the
    iteration usually finds the one nearest to the start.

    Returns (N, n), m or rad. Raises `ModelError` if ``wanted`` or ``rotations`` have another shape, the robot has too few
    actuators for an orientation, or a covariate is missing. `UnreachableError` if the TCP can't be brought to a position.
    `ConvergenceError` if Newton's method does not converge, for example if the position lies in the gap of a step.

    Examples
    --------
    >>> import numpy as np
    >>> import gtpin
    >>> from gtpin.compensation import compensate
    >>> nominal = gtpin.read_model("gantry_tau")
    >>> q = np.array([[0.1, 0.2, 0.0]])
    >>> bool(np.allclose(compensate(nominal, nominal.predict(q).T, start=q), q))
    True
    """
    T = real(wanted, "wanted positions")
    R = None if rotations is None else real(rotations, "wanted rotations")
    q, left = attempted(model, T, R, covariates, start)
    lost = np.flatnonzero(np.isinf(left))
    if lost.size:
        raise UnreachableError(
            f"{model.robot.name} can't bring its TCP to position {lost[0] + 1}",
            hint="stay inside the workspace and away from singular postures, or give other commands to start from; of commands "
            "q, the positions are those of the nominal robot: gtpin.read_model(NAME).predict(q).T",
        )
    if (left > TOLERANCE).any():
        worst = int(left.argmax())
        raise ConvergenceError(
            f"{int((left > TOLERANCE).sum())} of {len(T)} positions are not met, number {worst + 1} by {left[worst]:.2g} m",
            hint="a position may lie in the gap of a rack_step: shift it a little",
        )
    return q


def position_first(jacobian: Floats, error: Floats) -> Floats:
    """(N, n) Gauss-Newton steps that take away the position's part of errors (N, 6), m and rad, and of the orientation what the
    commands that leave the position alone can; ``jacobian``: (N, 6, n) derivative of the poses by the commands.

    It is inverse kinematics with task priority (Siciliano and Slotine 1991), without the singular values of `SINGULAR`.
    """
    by_position, by_turn = jacobian[:, :3], jacobian[:, 3:]
    inverse = np.linalg.pinv(by_position, rcond=SINGULAR)
    step = np.einsum("nij,nj->ni", inverse, error[:, :3])
    free = by_turn - by_turn @ inverse @ by_position
    least = SINGULAR * np.linalg.norm(jacobian, 2, axis=(1, 2)) / np.linalg.norm(free, 2, axis=(1, 2))
    turned = error[:, 3:] - np.einsum("nij,nj->ni", by_turn, step)
    return np.asarray(step + np.einsum("nij,nj->ni", np.linalg.pinv(free, rcond=np.minimum(least, 1.0)), turned))


def near_singular(model: Model, q: Floats) -> Mask:
    """(N,) whether commands (N, n) of a robot with six actuators or more are near a singular posture: see `SINGULAR`."""
    poses = model.kinematics.forward(q)
    found = ~poses.reached
    sizes = np.linalg.svd(model.kinematics.command_jacobian(q[~found], poses[~found])[:, :6], compute_uv=False)
    found[~found] = sizes[:, 5] < SINGULAR * sizes[:, 0]
    return found


def nearest(
    model: Model, T: Floats, R: Floats, covariates: Mapping[str, Column], start: Floats
) -> tuple[Floats, Floats]:
    """Commands (N, n) that bring the TCP to positions T (N, 3), with rotations as near to R (N, 3, 3) as this allows; and the
    errors (N, 6) that they leave, m and rad, base frame: NaN where they can't be reached.

    ``start``: (N, n) commands from which :func:`position_first` steps. They are those of six actuators or more.
    """
    machine, q = machine_of(model), start.copy()
    error = np.full((len(q), 6), np.nan)
    for _ in range(STEPS):
        poses, there = machine.kinematics.forward(q), machine.predict(q, covariates)
        reached = poses.reached & there.reached
        error[reached], error[~reached] = errors_of(there[reached], T[reached], R[reached]), np.nan
        step = position_first(machine.kinematics.command_jacobian(q[reached], poses[reached])[:, :6], error[reached])
        if np.abs(step).max(initial=0.0) <= 0.1 * TOLERANCE:
            break
        q[reached] += step
    return q, error


def attempted(
    model: Model,
    T: Floats,
    R: Floats | None,
    covariates: Mapping[str, Column] | None = None,
    start: npt.ArrayLike | None = None,
) -> tuple[Floats, Floats]:
    """As :func:`compensate`, (N, n) commands with (N,) the largest error of each pose, m and rad: above `TOLERANCE` where it
    is not met, infinite where the TCP can't be brought to it. Raises `ModelError` alone."""
    if R is not None and model.robot.n_actuators < 6:
        raise ModelError(
            f"{model.robot.name} has {model.robot.n_actuators} actuators",
            hint="leave the orientation free: give no rotations",
        )
    check_wanted(T, R)
    machine = machine_of(model)
    warn_of_other_times(machine.effects, model.robot, covariates or {})
    kinematics = machine.kinematics
    q = np.tile(model.robot.home_q, (len(T), 1)) if start is None else real(start, "starts").copy()
    # With one or two actuators a position is met in the directions in which they move the TCP: the others are left open.
    few = model.robot.n_actuators < 3
    q = q if few else commands_for(kinematics, T, R, q)[0]
    lost: Mask = np.asarray(~(np.isfinite(T).all(axis=1) & np.isfinite(q).all(axis=1)))
    T = np.where(lost[:, None], 0.0, T)
    R = None if R is None else np.where(lost[:, None, None], np.eye(3), R)
    left = np.full(len(T), np.inf)
    for _ in range(STEPS):
        q[lost] = model.robot.home_q  # where all is finite
        poses = kinematics.forward(q)
        if not poses.reached.all():
            lost |= ~poses.reached
            continue
        there = machine.predict(q, covariates)
        lost |= ~there.reached
        error = errors_of(there, T, R)
        # The Jacobian is that of the geometry. The derivatives of the effects, at most some thousandths of it, are left out:
        # each step still reduces the error by a factor of some hundreds.
        jacobian = kinematics.command_jacobian(q, poses)[:, : error.shape[1]]
        inverse = np.linalg.pinv(jacobian)
        if few:
            error = np.einsum("nij,njk,nk->ni", jacobian, inverse, error)
        left = np.where(lost, np.inf, np.abs(error).max(axis=1, initial=0.0))
        open_ = (left > TOLERANCE) & ~lost
        if not open_.any():
            break
        q[open_] += np.einsum("nij,nj->ni", inverse[open_], error[open_])
    return q, left
