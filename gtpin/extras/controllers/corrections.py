"""Correction tables for a controller, one per actuator, for what depends on its own position; as CSV and for LinuxCNC."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from gtpin.compensation.machine import CompensatedMachine, check_session, correctable, geometric_scales
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import ModelError, warn
from gtpin.model.dh import chain_of
from gtpin.model.model import Model
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd

DENSE = 16001
"""Number of commands over an actuator's range at which its deviation is evaluated."""
BEYOND = 2e-3
"""Part of the range by which these commands go beyond each of its ends."""
STEP_WIDTH = 1e-9
"""Distance, m or rad, between the last command before a step of the deviation and the first one after it."""
CLOSE = 1e-7
"""Largest interpolation error of a table, m or rad, before more points are added."""
FEWEST, MOST = 17, 4097
"""Smallest and largest number of points of a table."""
TRIPLETS = 256
"""Largest number of lines (triplets) in LinuxCNC's compensation file of a joint."""
COARSE = 1e-6
"""Interpolation error of a table, m or rad, above which a warning is given."""


@dataclass(frozen=True, eq=False)
class Correction:
    """A correction table: commands that bring an actuator to nominal positions.

    - ``site``, ``revolute``: the actuator, and whether its joint is revolute (unit rad) instead of prismatic (unit m).
    - ``nominal``: (K,) nominal positions, ascending, m or rad.
    - ``forward``, ``reverse``: (K,) commands, m or rad, if the actuator comes from below, and from above.
    - ``off``: largest difference, m or rad, between the table, interpolated linearly, and the exact correction.
    """

    site: str
    revolute: bool
    nominal: Floats
    forward: Floats
    reverse: Floats
    off: float


def corrections(model: Model, *, session: str | None = None, most: int = MOST) -> tuple[Correction, ...]:
    """A table over its range for each actuator that has a scale error or an effect that such a table can correct.

    Effects that depend on the load are evaluated without a load on the tool, with the other actuators at home.

    ``session``: session whose zero shifts are corrected; by default none. ``most``: largest number of points of a table. It
    gets fewer if these interpolate to within 0.1 um or 0.1 urad.

    Raises `ModelError` if there is nothing to correct, the session is not one of the model's, or an actuator's range has no
    ends.
    """
    effects = correctable(model, session)
    check_session(effects, session)
    robot, scales = model.robot, geometric_scales(model)
    tables = []
    for i, site in enumerate(robot.sites):
        mine = [active for active in effects if active.site == site]
        if mine or scales[site] != 1.0:
            if not np.isfinite([robot.lower[i], robot.upper[i]]).all():
                raise ModelError(f"{site} has no range", hint="give its joint a <limit> in the URDF")
            tables.append(_table(model, i, mine, scales[site], session, most))
    if not tables:
        geometry = "dh.csv (--format dh) or a URDF" if chain_of(robot) else "a URDF"
        raise ModelError(
            "there is nothing that a controller's tables can correct",
            hint="these are scales and effects along an actuator that depend on its own position, direction and session; "
            f"the geometry belongs in the controller's kinematics: write {geometry}, or a program's commands (--commands)",
        )
    return tuple(tables)


def _table(
    model: Model, index: int, effects: list[ActiveEffect], scale: float, session: str | None, most: int
) -> Correction:
    """The table of one actuator: the number of points is doubled until the accuracy `CLOSE` is reached."""
    robot = model.robot
    lower, upper = float(robot.lower[index]), float(robot.upper[index])
    margin = BEYOND * (upper - lower)
    steps = [place for active in effects for place in active.effect.jumps(active.shape_parameter)]
    q = np.union1d(
        np.linspace(lower - margin, upper + margin, DENSE), [s + width for s in steps for width in (0.0, STEP_WIDTH)]
    )
    forward, reverse = (
        np.maximum.accumulate(scale * (q + off)) for off in _deviations(model, index, effects, session, q)
    )
    edges = [
        np.interp(s + width, q, travel) for s in steps for width in (0.0, STEP_WIDTH) for travel in (forward, reverse)
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
    """Two arrays (K,): deviations of an actuator, m or rad, at commands q (K,) approached from below, and from above."""
    below, above = np.zeros(len(q)), np.zeros(len(q))
    if not effects:
        return below, above
    kinematics = model.kinematics
    commands = np.tile(model.robot.home_q, (len(q), 1))
    commands[:, index] = q
    poses = kinematics.forward(commands)
    for active in effects:
        machine = CompensatedMachine(replace(model, effects=(active,)), session)
        for approach, total in ((1.0, below), (-1.0, above)):
            covariates = machine.columns(len(q), approach)
            moved = active.basis(OperatingPoints(kinematics, commands, poses, covariates, active.references)).command
            assert moved is not None
            total += moved[1] @ active.coefficients
    # With the other actuators at home, the robot can't reach all commands of this one. The loads are not known there: the
    # deviations of the nearest command that it reaches are used.
    there = np.isfinite(below) & np.isfinite(above)
    if not there.any():
        raise ModelError(
            f"with the other actuators at home, no command of {model.robot.sites[index]} can be reached",
            hint="check the model's parameters",
        )
    return np.interp(q, q[there], below[there]), np.interp(q, q[there], above[there])


def correction_table(tables: Sequence[Correction]) -> pd.DataFrame:
    """Columns ``actuator nominal forward reverse``: commands that bring the actuator to ``nominal``, m or rad."""
    import pandas as pd

    rows = [
        pd.DataFrame({"actuator": t.site, "nominal": t.nominal, "forward": t.forward, "reverse": t.reverse})
        for t in tables
    ]
    return pd.concat(rows, ignore_index=True)


def linuxcnc_file(table: Correction) -> str:
    """A joint's compensation file for LinuxCNC, ``COMP_FILE_TYPE = 1``: nominal, forward trim, reverse trim.

    In mm, or degrees for a revolute joint. LinuxCNC adds the trim, interpolated, to the position that it sends to the motor
    (``usrmotLoadComp`` in its ``usrmotintf.cc``). It reads at most 256 lines, with ascending nominals and without comments.
    """
    if table.off > COARSE:
        warn(f"{TRIPLETS} lines can't follow {table.site}: they are off by up to {table.off * 1e6:.1f} um (or urad)")
    unit = 180.0 / np.pi if table.revolute else 1e3
    trims = (table.nominal, table.forward - table.nominal, table.reverse - table.nominal)
    return "".join(f"{n:.7f} {f:.7f} {r:.7f}\n" for n, f, r in zip(*(unit * column for column in trims), strict=True))
