"""Zeros of the drives where they are no parameters of a calibration: a shifted zero moves all that its drive carries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.kinematics.placed import carrier_rates, joints_on_carrier
from gtpin.model.departures import with_zeros
from gtpin.model.dh import controller_table
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats


@dataclass(frozen=True)
class Zero:
    """The shift of a drive's zero that moves the joints on its carrier as a calibration did.

    ``site``: the actuator. ``value``, ``sigma``: shift and its standard deviation, in ``unit``: at command 0 the actuator
    is at ``value``. Where the joints were not shifted equally, it is the common part of their shifts. ``unit``: ``m`` or
    ``rad``.
    """

    site: str
    value: float
    sigma: float
    unit: str


def equivalent_zeros(geometry: Geometry, covariance: Floats) -> tuple[Zero, ...]:
    """The equivalent zero of every actuator.

    Of a serial arm: those that the data determine, ``theta`` (``d`` of what slides) of :mod:`~gtpin.model.dh`. Of a robot with
    rods, those of the actuators that carry joints of rods, by least squares over their motions. Of other robots with loops: see
    :func:`~gtpin.model.departures.with_zeros`.

    A zero that is off by z moves joint i at command 0 by t_i z, with t_i the derivative of its position by the command: along
    the track, or about the arm's axis. From deviations c_i from nominal, z = sum t_i.c_i / sum t_i.t_i: for a track, the mean
    deviation of the cart's joints along it. A zero that is a parameter is added.

    ``covariance``: (p, p) covariance of the geometry's parameters.
    """
    robot = geometry.robot
    if not robot.rod_sites:
        slide = {a.site for a in robot.actuators if not a.revolute}
        table = controller_table(Model(geometry, covariance=covariance))
        zeros = (p for p in table if p.name == ("d" if p.site in slide else "theta") and p.determined)
        if table:
            return tuple(Zero(p.site, p.correction, p.sigma, p.unit) for p in zeros)
        every = {one.name: one for one in with_zeros(geometry, covariance)}
        known = ((site, every[f"zero[{site}]"]) for site in robot.sites if f"zero[{site}]" in every)
        return tuple(Zero(site, one.value, one.sigma, one.unit) for site, one in known)
    rates = carrier_rates(geometry)
    found = []
    for a, actuator in enumerate(robot.actuators):
        weight = np.zeros(len(geometry.parameters))
        power = float((rates[list(robot.rods_on(a))] ** 2).sum())
        for j, own in joints_on_carrier(geometry, a) if power > 0.0 else ():
            weight[j] = rates[own, geometry.parameters[j].component].sum() / power
        weight[[p.name == f"zero[{robot.sites[a]}]" for p in geometry.parameters]] = 1.0
        if weight.any():
            sigma = float(np.sqrt(weight @ covariance @ weight))
            unit = "rad" if actuator.revolute else "m"
            found.append(Zero(robot.sites[a], float(weight @ geometry.deviation), sigma, unit))
    return tuple(found)
