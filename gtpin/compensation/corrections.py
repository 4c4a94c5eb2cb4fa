"""What a controller can correct by a table for each actuator: deviations along it that go with its own position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.data.ids import normal_ids
from gtpin.effects.active import ActiveEffect
from gtpin.effects.sites import number
from gtpin.effects.situation import Column, Situation
from gtpin.errors import ModelError
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]

DENSE = 16001
"""Commands over an actuator's range at which its deviation is evaluated."""
BEYOND = 2e-3
"""How much farther than the range they go, in ranges."""
BESIDE = 1e-9
"""m or rad from the last command before a step to the first beyond it."""
CLOSE = 1e-7
"""m or rad by which interpolation in a table may be off before more points are taken."""
FEWEST, MOST = 17, 4097


@dataclass(frozen=True, eq=False)
class Correction:
    """What to command for an actuator to be where it was wanted.

    Parameters
    ----------
    site, revolute
        The actuator, and whether it turns (rad) instead of sliding (m).
    nominal
        (K,) ascending, where it was wanted.
    forward, reverse
        (K,) what to command when it comes from below, and from above.
    off
        Largest difference between the table, interpolated linearly, and the exact correction.
    """

    site: str
    revolute: bool
    nominal: Floats
    forward: Floats
    reverse: Floats
    off: float


def correctable(model: Model, session: str | None = None) -> tuple[ActiveEffect, ...]:
    """Effects of a model along an actuator that go with nothing but its position, its direction, and a session that is told."""
    known = () if session is None else ("session",)
    robot = model.robot
    found = []
    for active in model.effects:
        if active.site in robot.sites:
            i = number(robot, active.site)
            own = {f"q{i}", f"approach{i}", *known}
            if set(active.effect.coordinates(robot, active.site)) <= own:
                found.append(active)
    return tuple(found)


def corrections(model: Model, *, session: str | None = None, most: int = MOST) -> tuple[Correction, ...]:
    """Tables for the actuators that a model's scales and effects say are off, over their ranges.

    Effects that depend on the load are taken as they are with nothing on the tool, the other actuators at home.

    Parameters
    ----------
    session
        Whose zero shifts are to be corrected; left out, they are not.
    most
        Largest number of points; as many are taken as interpolation to 0.1 micrometre needs.

    Raises
    ------
    ModelError
        If there is nothing to correct, the session is not one of the model's, or an actuator's range has no ends.
    """
    effects = correctable(model, session)
    _check_session(effects, session)
    robot = model.robot
    scales = dict.fromkeys(robot.sites, 1.0)
    for parameter, deviation in zip(model.geometry.parameters, model.geometry.deviation, strict=True):
        if parameter.kind == "scale" and parameter.per == "actuator":
            scales[robot.sites[parameter.owner]] += float(deviation)
    tables = []
    for i, site in enumerate(robot.sites):
        mine = [active for active in effects if active.site == site]
        if mine or scales[site] != 1.0:
            if not np.isfinite([robot.lower[i], robot.upper[i]]).all():
                raise ModelError(f"{site} has no range", hint="give its joint a <limit> in the URDF")
            tables.append(_table(model, i, mine, scales[site], session, most))
    if not tables:
        raise ModelError(
            "there is nothing that a controller's tables can correct",
            hint="that are scales and effects along an actuator that go with its own position, direction and session",
        )
    return tuple(tables)


def _table(
    model: Model, index: int, effects: list[ActiveEffect], scale: float, session: str | None, most: int
) -> Correction:
    """The table of one actuator, with as few points as will do."""
    robot = model.robot
    lower, upper = float(robot.lower[index]), float(robot.upper[index])
    margin = BEYOND * (upper - lower)
    steps = [place for active in effects for place in active.effect.jumps(active.nonlinear)]
    q = np.union1d(
        np.linspace(lower - margin, upper + margin, DENSE), [s + beside for s in steps for beside in (0.0, BESIDE)]
    )
    forward, reverse = (
        np.maximum.accumulate(scale * (q + off)) for off in _deviations(model, index, effects, session, q)
    )
    edges = [
        np.interp(s + beside, q, travel) for s in steps for beside in (0.0, BESIDE) for travel in (forward, reverse)
    ]
    dense = np.union1d(q[(q >= lower) & (q <= upper)], edges)
    points = FEWEST
    while True:
        room = max(2, min(points, most) - len(edges))
        nominal = np.union1d(np.linspace(lower, upper, room), edges)
        up, down = (np.interp(nominal, travel, q) for travel in (forward, reverse))
        off = max(
            float(np.abs(np.interp(dense, nominal, table) - np.interp(dense, travel, q)).max())
            for table, travel in ((up, forward), (down, reverse))
        )
        if off <= CLOSE or points >= most:
            return Correction(robot.sites[index], bool(robot.revolute[index]), nominal, up, down, off)
        points = 2 * points - 1


def _deviations(
    model: Model, index: int, effects: list[ActiveEffect], session: str | None, q: Floats
) -> tuple[Floats, Floats]:
    """(K,) deviations of an actuator at commands q (K,), coming from below and from above, in units of the command."""
    below, above = np.zeros(len(q)), np.zeros(len(q))
    if not effects:
        return below, above
    kinematics = model.kinematics
    assert isinstance(kinematics, RodKinematics)
    commands = np.tile(model.robot.home_q, (len(q), 1))
    commands[:, index] = q
    poses = kinematics.forward(commands)
    for active in effects:
        for approach, total in ((1.0, below), (-1.0, above)):
            told: dict[str, Column] = {
                name: np.zeros(len(q)) for name in active.references.covariates if name != "session"
            }
            told[f"approach{index + 1}"] = np.full(len(q), approach)
            if session is not None:
                told["session"] = normal_ids(np.full(len(q), session, dtype=object))
            moved = active.basis(Situation(kinematics, commands, poses, told, active.references)).command
            assert moved is not None
            total += moved[1] @ active.coefficients
    # Where the others at home leave no posture, what goes with the load is as at the nearest one.
    there = np.isfinite(below) & np.isfinite(above)
    if not there.any():
        raise ModelError(
            f"with the other actuators at home, no command of {model.robot.sites[index]} can be reached",
            hint="check the model's parameters",
        )
    return np.interp(q, q[there], below[there]), np.interp(q, q[there], above[there])


def _check_session(effects: tuple[ActiveEffect, ...], session: str | None) -> None:
    if session is None:
        return
    known = sorted({name for active in effects for name in active.references.sessions})
    if session not in known:
        raise ModelError(f"the model knows no session {session!r}", hint=f"sessions are {', '.join(known) or 'none'}")
