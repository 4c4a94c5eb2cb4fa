"""Functions that effects are made of: cosines of decreasing size, sessions, motions of the frame, sizes and loads of drives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gtpin.effects.displacement import rods_of
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import number, turning_joint
from gtpin.errors import ModelError, warn
from gtpin.kinematics.rotations import frame_motions
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.placement_frames import frame_of_joint
from gtpin.typing import Floats

GRID = np.linspace(-1.0, 1.0, 201)
"""Points at which a curve is evaluated to compute its size."""


def wave(x: Floats, order: int | npt.NDArray[np.intp]) -> Floats:
    """cos(pi order (x + 1) / 2) for x (any shape) in [-1, 1]. For order 1 and higher its mean over the interval is zero."""
    return np.asarray(np.cos(np.pi / 2.0 * order * (x + 1.0)))


def cosines(x: Floats, first: int, last: int, decay: float = 1.0) -> tuple[Floats, Floats]:
    """(N, m) cosines of orders first to last over x (N,) in [-1, 1], and (m,) their typical sizes.

    The size of order k is proportional to k^-decay. With these sizes, the variance of the sum of cosines is one on average
    over x.
    """
    orders = np.arange(first, last + 1)
    size = orders**-decay / np.sqrt((orders ** (-2.0 * decay)).sum() / 2.0)
    return wave(x[:, None], orders), np.asarray(size, dtype=float)


def extent(coefficients: Floats) -> tuple[float, float]:
    """Root mean square and peak to valley of a sum of cosines of orders 1 to m, with coefficients (m,), in their unit.

    The best straight line is subtracted first, as in the definition of straightness in ISO 230-1. Peak to valley is the
    largest less the smallest value.
    """
    values = cosines(GRID, 1, len(coefficients))[0] @ coefficients
    residual = values - values.mean() - GRID * (GRID @ values) / (GRID @ GRID)  # the middle of the grid is zero
    return float(np.sqrt((residual**2).mean())), float(np.ptp(residual))


def modulated(column: Floats, coordinates: list[Floats], share: float) -> tuple[Floats, Floats]:
    """A displacement (N,) and its modulation: the displacement times cosines of coordinates (N,).

    The coordinates have no unit; most of their values are between -1 and 1. The cosines have the orders 1 and 2.

    Returns (N, m) the displacement first, then its modulation, and (m,) their sizes relative to the displacement: ``share /
    order`` for each coordinate and order.
    """
    columns, sizes = [column], [1.0]
    for x in coordinates:
        for order in (1, 2):
            columns.append(column * wave(np.clip(x, -3.0, 3.0), order))
            sizes.append(share / order)
    return np.stack(columns, axis=1), np.array(sizes)


SHIFT, TURN = 4e-5, 1.5e-5
"""Typical sizes of a frame's motion, m and rad."""
FREEDOMS = tuple((f"{kind}_{axis}", unit) for kind, unit in (("shift", "m"), ("turn", "rad")) for axis in "xyz")
"""Names and units of a frame's six degrees of freedom."""


def frame_twist(at: OperatingPoints) -> tuple[Floats, Floats]:
    """(N, 6 + 3 l, 6) motion of the measured pose and l links per unit shift, m, and turn, rad, of the frame, and (6,) sizes.

    Shifts and turns are along and about the axes of the base frame, turns about the TCP at home.
    """
    moved = of_frame(at, frame_motions(at.poses.T - at.kinematics.home.T[0]))
    return moved, np.array([SHIFT] * 3 + [TURN] * 3)


def of_frame(at: OperatingPoints, twist: Floats) -> Floats:
    """(N, 6 + 3 l, m) motions (N, 6, m) of the measured pose with its frame, with those of l measured links: their turn."""
    return np.concatenate([twist, *(twist[:, 3:] for _ in at.robot.measured_links)], axis=1)


def target_twist(at: OperatingPoints) -> Floats:
    """(N, 6, 6) motion of the measured pose per unit shift, m, and turn, rad, of the target along and about the TCP's axes."""
    twist = np.zeros((len(at), 6, 6))
    twist[:, :3, :3] = twist[:, 3:, 3:] = at.poses.R
    return twist


def session_columns(at: OperatingPoints) -> Floats:
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
        warn(f"sessions that were not in the fit, for which the mean shift is used: {', '.join(unseen)}")
    columns = (names[:, None] == np.array(known)).astype(float)
    columns[np.isin(names, unseen)] = 1.0 / len(known)
    return np.asarray(columns)


def approach(at: OperatingPoints, actuator: int | None) -> Floats:
    """(N,) direction of approach of an actuator, -1 to 1; zero where the data of the fit did not contain it.

    It is +1 where the actuator moved towards larger commands before it stopped, and -1 where towards smaller ones.

    Raises `ModelError` if the data of the fit contained it, and these data do not.
    """
    if actuator is None:
        return np.zeros(len(at))
    name = f"approach{number(at.robot, at.robot.sites[actuator])}"
    return at.covariate(name) if at.has(name) else np.zeros(len(at))


RIM = 0.1
"""Radius, m, at which the deviations of a turning joint's gear and encoder are as large as those along a track. Assumed: at
this radius 20 um is 0.2 mrad, the transmission error of a strain wave gear of 0.7 arcmin."""


def drive_sizes(at: OperatingPoints, site: str, relative: Sequence[float] | Floats, size: float) -> Floats:
    """Typical sizes of a drive's deviation, in the unit of its command: ``relative`` times ``size``, the size along a track, m.

    For a turning joint of a robot without rods they are divided by ``RIM``. Turning actuators of robots with rods use the
    same number in rad.
    """
    whole = np.asarray(relative, dtype=float) * size
    return whole / RIM if turning_joint(at.robot, site) else whole


HEAVY = 60.0
"""Usual force of the rods, N, below which a robot with rods is more flexible in inverse proportion to it. Assumed: machines are
as stiff as their loads need, so that the lighter ones deflect as far under theirs. The rods of the Gantry-Tau and of Stewart
platforms, to which the typical sizes belong, bear more; those of a 3D printer bear 2 N, and its belts give 2e-5 m/N."""


def flexibility(at: OperatingPoints) -> float:
    """Factor by which rods and carts are more flexible than on heavy machines, 1 or more: see ``HEAVY``.

    The usual force is the root mean square over the rods and the poses of the fit.
    """
    mean, spread = at.references.force
    return max(1.0, HEAVY / float(np.sqrt((mean**2 + spread**2).mean())))


SLOWEST_LINE = 3.0
"""Periods per turn of a turning joint above which the parts of a smooth deviation become smaller; stronger parts are lines of
``rack_periodic``. Assumed: an encoder's eccentricity and the harmonics of a housing have one to three per turn, gears
more."""
FALL = 2.0
"""The power p: above ``SLOWEST_LINE``, parts with f periods per turn are smaller by (``SLOWEST_LINE`` / f)^p. Assumed: a
function that looks smooth has some of its power there."""
LEAST_ORDERS = 3
"""Smallest number of half waves of a smooth deviation. Assumed."""


def smooth_orders(at: OperatingPoints, j: int, most: int) -> int:
    """Number of cosines over the travel of drive j that count as smooth: ``most``, but for a turning joint of a robot without
    rods only those with at most ``SLOWEST_LINE`` periods per turn, and ``LEAST_ORDERS`` at least.
    """
    if not turning_joint(at.robot, at.robot.sites[j]):
        return most
    return min(most, max(LEAST_ORDERS, int(SLOWEST_LINE / _turns(at, j))))


def smooth_cosines(at: OperatingPoints, j: int, most: int, decay: float) -> tuple[Floats, Floats]:
    """(N, most) cosines over the travel of drive j, and (most,) their sizes: see :func:`~gtpin.effects.smooth.cosines`.

    For a turning joint of a robot without rods, cosines with many periods per turn are smaller: see ``FALL``.
    """
    columns, size = cosines(at.travel[:, j], 1, most, decay)
    if not turning_joint(at.robot, at.robot.sites[j]):
        return columns, size
    rate = np.arange(1, most + 1) * _turns(at, j)
    kept = np.arange(most) < LEAST_ORDERS
    return columns, size * np.where(kept, 1.0, np.minimum(1.0, SLOWEST_LINE / rate) ** FALL)


def _turns(at: OperatingPoints, j: int) -> float:
    """Periods per turn of the joint of a half wave over the range of its commands: k half waves have k times as many."""
    lower, upper = (float(ends[j]) for ends in at.references.commands)
    return float(np.pi / (upper - lower))


def drive_load(at: OperatingPoints, site: str) -> Floats:
    """(N,) (load - mean) / spread of the load on a drive, without unit; mean and spread are over the poses of the fit.

    The load is the mean over :func:`loads_of`, each scaled in this way.
    """
    load, mean, spread = loads_of(at, site)
    return np.asarray(((load - mean) / spread).mean(axis=1))


def loads_of(at: OperatingPoints, site: str) -> tuple[Floats, Floats, Floats]:
    """(N, k) loads at a site, N or N m, and their (k,) means and spreads over the poses of the fit.

    They are the axial forces of the k rods of the site; without rods, the force along a joint's axis or the moment about it.
    """
    if rods := rods_of(at, site):
        mean, spread = at.references.force
        return at.force[:, rods], mean[rods], spread[rods]
    j = at.robot.sites.index(site)
    load, middle, about = np.zeros((len(at), 1)), 0.0, 0.0
    for joint_id, ratio in at.robot.carriers(j):  # by virtual work, a joint that follows loads its master by its ratio
        index, axis = frame_of_joint(joint_id), ratio * joint_axis(at.robot.model, joint_id)
        means, spreads = (values[index] for values in at.references.joints)
        load += at.joint_loads[:, [index]] @ axis
        middle, about = middle + float(means @ axis), about + float(np.linalg.norm(spreads * axis))
    return load, np.array([middle]), np.array([about])
