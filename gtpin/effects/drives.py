"""Drives of any robot: typical sizes of their deviations, units, and the load on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.effects.basis import rods_of
from gtpin.effects.effect import Floats
from gtpin.effects.sites import turns
from gtpin.effects.situation import Situation
from gtpin.kinematics.bodies import index_of
from gtpin.robot.chain import joint_axis

RIM = 0.1
"""Radius, m, at which gears and encoders of a turning joint err by as much as those of a track. Assumed: 20 um there are
0.2 mrad, the transmission error of a strain wave gear of 0.7 arcmin."""


def drive_sizes(at: Situation, site: str, relative: Sequence[float] | Floats, size: float) -> Floats:
    """Sizes of a drive's deviation in the unit of its command, from those along a track, m.

    Actuators that turn the arms of a robot with rods are taken as they are.
    """
    whole = np.asarray(relative, dtype=float) * size
    return whole / RIM if turns(at.robot, site) and not at.robot.rods else whole


def drive_load(at: Situation, site: str) -> Floats:
    """(N,) load on a drive, less its mean and over its spread in the fit: the mean of its rods' forces, or what its joint
    carries along or about its own axis.
    """
    if at.robot.rods:
        return np.asarray(at.load[:, rods_of(at, site)].mean(axis=1))
    load, usual = own_load(at, site)
    mean, spread = usual
    return np.asarray((load - mean) / spread)


def own_load(at: Situation, site: str) -> tuple[Floats, tuple[float, float]]:
    """(N,) what a joint carries along (N) or about (N m) its own axis, and the mean and spread of it in the fit."""
    actuator = at.robot.actuators[at.robot.sites.index(site)]
    axis, index = joint_axis(at.robot.model, actuator.joint_id), index_of(actuator.joint_id)
    mean, spread = (values[index] for values in at.references.joints)
    return at.joint_loads[:, index] @ axis, (float(mean @ axis), float(np.linalg.norm(spread * axis)))
