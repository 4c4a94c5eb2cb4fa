"""The departures of a calibrated geometry from nominal, each with the displacement of the TCP that it causes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gtpin.kinematics.placed import carrier_rates
from gtpin.model.dh import table_with_base
from gtpin.model.model import Model
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

ZERO = 0.1
"""Prior standard deviation of a joint's zero, m or rad. A zero is set when the machine is assembled or mastered, so that no
manufacturing tolerance bounds it. Assumed: 6 degrees."""
POSES = 300
"""Largest number of poses at which the TCP is displaced: a root mean square then has a relative standard error of 4 %."""


@dataclass(frozen=True)
class Departure:
    """One number of the geometry that a calibration changed.

    - ``name``: ``length[2a]``, ``zero[cart2]``, of a serial arm ``a[elbow_joint]``, ``base.ra``, ``tool.x``.
    - ``site``, ``what``: the part that has it and the quantity, as in the name.
    - ``value``, ``sigma``: its value less the nominal one and the standard deviation, in ``unit``: m, rad or m/m.
    - ``determined``: whether the data determine it.
    - ``displacement``: (N, 3) displacement of the TCP by it, m, base frame. Where the pose of the instrument in the base
      frame is unknown, the rigid motion that fits best is subtracted.
    """

    name: str
    site: str
    what: str
    value: float
    sigma: float
    unit: str
    determined: bool
    displacement: Floats = field(repr=False, compare=False)

    @property
    def position_rms(self) -> float:
        """Root mean square length of the displacement, m."""
        return size_of(self.displacement)


def size_of(displacement: Floats) -> float:
    """Root mean square length of displacements (N, 3)."""
    return float(np.sqrt((displacement**2).sum(axis=1).mean()))


def departures(model: Model, q: Floats) -> tuple[Departure, ...]:
    """All departures of a calibrated model's geometry from nominal, the largest displacement first; empty of a nominal one.

    Of a serial arm they are the corrections of its table (:mod:`~gtpin.model.dh`), which is minimal. Other geometries are
    redundant: they get the zeros of their joints as further parameters (:func:`with_zeros`).

    ``q``: (N, n) commands, m or rad. The derivative of the TCP is taken halfway between the nominal and the calibrated
    geometry, so that displacements are exact to the second order.
    """
    geometry, covariance = model.geometry, model.covariance
    if model.joint_covariance is not None:
        covariance = model.joint_covariance[: len(geometry.parameters), : len(geometry.parameters)]
    if covariance is None or not geometry.deviation.any():
        return ()
    q = q[np.unique(np.linspace(0, len(q) - 1, min(len(q), POSES)).astype(int))]
    middle = Model(geometry.with_values(geometry.values - geometry.deviation / 2.0)).kinematics
    poses = middle.forward(q)
    q, poses = q[poses.reached], poses[poses.reached]
    if not len(q):
        return ()
    J = middle.geometry_jacobian(q, poses)[:, :3]
    if not model.frame.is_base:
        J = _without_rigid_motion(J, poses.T)
    table, found = table_with_base(model), []
    # Where the place of the target is unknown, the data say nothing of the tool.
    target = any(p.kind == "platform" and p.nominal for p in geometry.parameters)
    slides = {actuator.site for actuator in model.robot.actuators if not actuator.revolute}
    for row in table:
        what = "zero" if row.name == ("d" if row.site in slides else "theta") else row.name
        name = f"{row.site}.{what}" if row.site in ("base", "tool") else f"{what}[{row.site}]"
        numbers = (row.correction, row.sigma, row.unit, row.determined)
        if row.site != "tool" or not target:
            found.append(Departure(name, row.site, what, *numbers, J @ row.motion * row.correction))
    if not table:
        for name, unit, way, value, sigma in with_zeros(geometry, covariance):
            what, _, rest = name.partition("[")
            if what.partition(".")[0] != "platform" or not target:
                found.append(Departure(name, rest.partition("]")[0], what, value, sigma, unit, True, J @ way * value))
    return tuple(sorted(found, key=lambda one: -one.position_rms))


def _without_rigid_motion(J: Floats, T: Floats) -> Floats:
    """(N, 3, p) derivatives without the rigid motions of all points T (N, 3) that fit them best."""
    x, y, z = (T - T.mean(axis=0)).T
    o, one = np.zeros_like(x), np.ones_like(x)
    ways = np.stack([[one, o, o, o, z, -y], [o, one, o, -z, o, x], [o, o, one, y, -x, o]], axis=0)  # (3, 6, N)
    rigid = np.moveaxis(ways, 2, 0).reshape(-1, 6)
    flat = J.reshape(-1, J.shape[2])
    return np.asarray(flat - rigid @ np.linalg.lstsq(rigid, flat, rcond=None)[0]).reshape(J.shape)


def with_zeros(geometry: Geometry, covariance: Floats) -> list[tuple[str, str, Floats, float, float]]:
    """Posterior of the parameters' deviations and of the joints' zeros, if these have a prior of their own (`ZERO`).

    A shifted zero moves all that the joint carries. A calibration, whose priors are manufacturing tolerances, divides it among
    the parameters that can imitate it. With the deviations d = e + V z, where V z are those that the zeros z cause, and the
    information H = C^-1 - P^-1 of the data (C, P: posterior and prior covariance of d), the posterior of x = (e, z) is

        covariance (Q^-1 + B' H B)^-1, mean covariance . B' C^-1 d,   B = [1 V], Q: prior covariance of x.

    ``covariance``: C, (p, p). Returns name, unit, direction (p,) in the space of the parameters, value and sigma of each.
    """
    size, zeros = geometry.tolerance, _zeros(geometry)
    ways = np.column_stack([np.eye(len(size)), *(way for _, _, way in zeros)])
    prior = np.append(size, np.full(len(zeros), ZERO))
    B = ways / size[:, None] * prior  # in units of the priors
    inverse = np.linalg.inv(covariance / np.outer(size, size))
    power, axes = np.linalg.eigh(inverse - np.eye(len(size)))
    information = axes * np.maximum(power, 0.0) @ axes.T
    spread = np.linalg.inv(np.eye(len(prior)) + B.T @ information @ B)
    value = prior * (spread @ B.T @ inverse @ (geometry.deviation / size))
    sigma = prior * np.sqrt(np.diag(spread))
    names = [(p.name, p.unit) for p in geometry.parameters] + [(name, unit) for name, unit, _ in zeros]
    return [
        (name, unit, way, float(v), float(s))
        for (name, unit), way, v, s in zip(names, ways.T, value, sigma, strict=True)
    ]


def _zeros(geometry: Geometry) -> list[tuple[str, str, Floats]]:
    """Name and unit of each joint's zero, and the deviations (p,) of the parameters by 1 m or rad of it."""
    robot, found = geometry.robot, []
    rates = carrier_rates(geometry)
    for a, actuator in enumerate(robot.actuators):
        carried, way = list(robot.rods_on(a)), np.zeros(len(geometry.parameters))
        axis = joint_axis(robot.model, actuator.joint_id)
        for j, p in enumerate(geometry.parameters):
            if p.kind == "carrier_joint" and p.per == "rod" and p.owner in carried:
                way[j] = rates[p.owner, p.component]
            elif p.kind == "carrier_joint" and p.per == "actuator" and p.owner == a:
                way[j] = rates[carried, p.component].mean()
            elif p.kind == "placement" and p.owner == actuator.joint_id:
                way[j] = axis[p.component]
        if way.any():
            found.append((f"zero[{actuator.site}]", "rad" if actuator.revolute else "m", way))
    return found
