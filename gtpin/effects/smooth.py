"""Functions that effects are made of: cosines of decreasing size, sessions, motions of the frame, directions of approach."""

from __future__ import annotations

import numpy as np

from gtpin.effects.sites import number
from gtpin.effects.situation import Situation
from gtpin.errors import ModelError, warn
from gtpin.kinematics.rotations import frame_motions
from gtpin.typing import Floats

GRID = np.linspace(-1.0, 1.0, 201)
"""Points at which a curve is evaluated to compute its size."""


def wave(x: Floats, order: int) -> Floats:
    """cos(pi order (x + 1) / 2) for x (any shape) in [-1, 1]. For order 1 and higher its mean over the interval is zero."""
    return np.asarray(np.cos(np.pi / 2.0 * order * (x + 1.0)))


def cosines(x: Floats, first: int, last: int, decay: float = 1.0) -> tuple[Floats, Floats]:
    """(N, m) cosines of orders first to last over x (N,) in [-1, 1], and (m,) their typical sizes.

    The size of order k is proportional to k^-decay. With these sizes, the variance of the sum of cosines is one on average
    over x.
    """
    orders = np.arange(first, last + 1)
    size = orders**-decay / np.sqrt((orders ** (-2.0 * decay)).sum() / 2.0)
    return np.cos(np.pi / 2.0 * orders * (x[:, None] + 1.0)), np.asarray(size, dtype=float)


def extent(coefficients: Floats) -> tuple[float, float]:
    """Root mean square and peak to valley of a sum of cosines of orders 1 to m, with coefficients (m,), in their unit.

    The best straight line is subtracted first, as in the definition of straightness in ISO 230-1. Peak to valley is the
    largest less the smallest value.
    """
    values = cosines(GRID, 1, len(coefficients))[0] @ coefficients
    left = values - values.mean() - GRID * (GRID @ values) / (GRID @ GRID)  # the middle of the grid is zero
    return float(np.sqrt((left**2).mean())), float(np.ptp(left))


def span(coefficients: Floats) -> float:
    """Largest less smallest value of a sum of cosines of orders 1 to m, with coefficients (m,), in their unit."""
    return float(np.ptp(cosines(GRID, 1, len(coefficients))[0] @ coefficients))


def modulated(column: Floats, coordinates: list[Floats], share: float, orders: int = 2) -> tuple[Floats, Floats]:
    """A displacement (N,) and its modulation: the displacement times cosines of coordinates (N,).

    The coordinates have no unit; most of their values are between -1 and 1. The cosines have orders 1 to ``orders``.

    Returns (N, m) the displacement first, then its modulation, and (m,) their sizes relative to the displacement: ``share /
    order`` for each coordinate and order.
    """
    columns, sizes = [column], [1.0]
    for x in coordinates:
        for order in range(1, orders + 1):
            columns.append(column * np.cos(np.pi / 2.0 * order * (np.clip(x, -3.0, 3.0) + 1.0)))
            sizes.append(share / order)
    return np.stack(columns, axis=1), np.array(sizes)


SHIFT, TURN = 4e-5, 1.5e-5
"""Typical sizes of a frame's motion, m and rad."""
FREEDOMS = tuple((f"{kind}_{axis}", unit) for kind, unit in (("shift", "m"), ("turn", "rad")) for axis in "xyz")
"""Names and units of a frame's six degrees of freedom."""


def frame_twist(at: Situation) -> tuple[Floats, Floats]:
    """(N, 6, 6) motion of the measured pose per unit shift, m, and turn, rad, of the frame, and (6,) their typical sizes.

    Shifts and turns are along and about the axes of the base frame, turns about the TCP at home.
    """
    return frame_motions(at.poses.T - at.kinematics.home.T[0]), np.array([SHIFT] * 3 + [TURN] * 3)


def session_columns(at: Situation) -> Floats:
    """(N, sessions) 1 where a pose belongs to the session, otherwise 0.

    A session that was not in the fit gets equal values in all columns. Its shift is then the mean shift. A warning says so.
    One column of ones where the fit had no sessions: what has changed since an earlier model is the same everywhere.

    Raises `ModelError` if there is no column ``session``.
    """
    if not at.has("session"):
        return np.ones((len(at), 1))
    if "session" not in at.covariates:
        raise ModelError("the covariate session is missing", column="session", hint="give a column session")
    names = np.array([str(name) for name in at.covariates["session"]])
    known = at.references.sessions
    unseen = sorted(set(names) - set(known))
    if unseen:
        warn(f"sessions never seen, which get the mean shift: {', '.join(unseen)}")
    columns = (names[:, None] == np.array(known)).astype(float)
    columns[np.isin(names, unseen)] = 1.0 / len(known)
    return np.asarray(columns)


def approach(at: Situation, actuator: int | None) -> Floats:
    """(N,) direction of approach of an actuator, -1 to 1; zero where the data of the fit did not contain it.

    It is +1 where the actuator moved towards larger commands before it stopped, and -1 where towards smaller ones.

    Raises `ModelError` if the data of the fit contained it, and these data do not.
    """
    if actuator is None:
        return np.zeros(len(at))
    name = f"approach{number(at.robot, at.robot.sites[actuator])}"
    return at.covariate(name) if at.has(name) else np.zeros(len(at))
