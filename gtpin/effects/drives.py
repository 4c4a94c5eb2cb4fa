"""Drives of robots with and without rods: typical sizes of their deviations, units, and loads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.effects.basis import rods_of
from gtpin.effects.sites import joints, turns
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.typing import Floats

RIM = 0.1
"""Radius, m, at which the deviations of a turning joint's gear and encoder are as large as those along a track. Assumed: at
this radius 20 um is 0.2 mrad, the transmission error of a strain wave gear of 0.7 arcmin."""


def drive_sizes(at: Situation, site: str, relative: Sequence[float] | Floats, size: float) -> Floats:
    """Typical sizes of a drive's deviation, in the unit of its command: ``relative`` times ``size``, the size along a track, m.

    For a turning joint of a robot without rods they are divided by ``RIM``. Turning actuators of robots with rods use the
    same number in rad.
    """
    whole = np.asarray(relative, dtype=float) * size
    return whole / RIM if turns(at.robot, site) and site in joints(at.robot) else whole


SLOWEST_LINE = 3.0
"""Periods per turn of a turning joint above which the parts of a smooth deviation become smaller; stronger parts are lines of
``rack_periodic``. Assumed: an encoder's eccentricity and the harmonics of a housing have one to three per turn, gears
more."""
FALL = 2.0
"""The power p: above ``SLOWEST_LINE``, parts with f periods per turn are smaller by (``SLOWEST_LINE`` / f)^p. Assumed: a
function that looks smooth has some of its power there."""
LEAST_ORDERS = 3
"""Smallest number of half waves of a smooth deviation. Assumed."""


def smooth_orders(at: Situation, j: int, most: int) -> int:
    """Number of cosines over the travel of drive j that count as smooth: ``most``, but for a turning joint of a robot without
    rods only those with at most ``SLOWEST_LINE`` periods per turn, and ``LEAST_ORDERS`` at least.
    """
    if at.robot.sites[j] not in joints(at.robot) or not at.robot.actuators[j].revolute:
        return most
    return min(most, max(LEAST_ORDERS, int(SLOWEST_LINE / _turns(at, j))))


def smooth_cosines(at: Situation, j: int, most: int, decay: float) -> tuple[Floats, Floats]:
    """(N, most) cosines over the travel of drive j, and (most,) their sizes: see :func:`~gtpin.effects.smooth.cosines`.

    For a turning joint of a robot without rods, cosines with many periods per turn are smaller: see ``FALL``.
    """
    columns, size = cosines(at.travel[:, j], 1, most, decay)
    if at.robot.sites[j] not in joints(at.robot) or not at.robot.actuators[j].revolute:
        return columns, size
    rate = np.arange(1, most + 1) * _turns(at, j)
    kept = np.arange(most) < LEAST_ORDERS
    return columns, size * np.where(kept, 1.0, np.minimum(1.0, SLOWEST_LINE / rate) ** FALL)


def _turns(at: Situation, j: int) -> float:
    """Periods per turn of the joint of a half wave over the range of its commands: k half waves have k times as many."""
    lower, upper = (float(ends[j]) for ends in at.references.commands)
    return float(np.pi / (upper - lower))


def drive_load(at: Situation, site: str) -> Floats:
    """(N,) (load - mean) / spread of the load on a drive, without unit; mean and spread are over the poses of the fit.

    The load is the mean over the forces of the drive's rods, each scaled in this way. For robots without rods it is the force
    along the joint's axis or the moment about it.
    """
    if site not in joints(at.robot):
        return np.asarray(at.load[:, rods_of(at, site)].mean(axis=1))
    load, usual = own_load(at, site)
    mean, spread = usual
    return np.asarray((load - mean) / spread)


def own_load(at: Situation, site: str) -> tuple[Floats, tuple[float, float]]:
    """(N,) force along a joint's axis, N, or moment about it, N m, and its mean and spread over the poses of the fit."""
    j = at.robot.sites.index(site)
    (index,), still = at.kinematics.carried(j), np.zeros(3)
    along = at.kinematics.axis(j)
    axis = np.concatenate([still, along] if at.robot.actuators[j].revolute else [along, still])
    mean, spread = (values[index] for values in at.references.joints)
    return at.joint_loads[:, index] @ axis, (float(mean @ axis), float(np.linalg.norm(spread * axis)))
