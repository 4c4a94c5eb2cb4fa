"""The departures of a calibrated geometry from nominal, each with the displacement of the TCP that it causes; and the zeros of
the drives where they are no parameters: a shifted zero moves all that its drive carries."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from gtpin.kinematics.placed import carrier_rates, joints_on_carrier
from gtpin.model.dh import controller_table, table_with_base
from gtpin.model.model import Model
from gtpin.model.place import free_motions, relative_to_others, without_place
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import TOLERANCE
from gtpin.typing import Floats

ZERO = TOLERANCE["zero"]
"""Prior standard deviation of a joint's zero, m or rad."""
GAIN = 3.0
"""Gain in log evidence, nats, from which a joint's zero is off by more than the tolerances explain: the prior odds are one in
twenty joints. Assumed."""
PARALLEL = 1e-6
"""Largest difference of the unit vectors of parallel tracks."""
POSES = 300
"""Largest number of poses at which the TCP is displaced: a root mean square then has a relative standard error of 4 %."""


@dataclass(frozen=True)
class Departure:
    """One number of the geometry that a calibration changed.

    - ``name``: ``length[2a]``, ``zero[cart2]``, of a serial arm ``a[elbow_joint]``, ``base.ra``, ``tool.x``.
    - ``site``, ``what``: the part that has it and the quantity, as in the name.
    - ``value``, ``sigma``: its value less the nominal one and the standard deviation, in ``unit``: m, rad or m/m; sigma 0 of a
      parameter that was held.
    - ``determined``: whether the data determine it.
    - ``displacement``: (N, 3) displacement of the TCP by it, m, base frame, without what a motion of the whole machine
      explains that no instrument shows (:mod:`~gtpin.model.place`).
    - ``reversed``: whether it is a length ``a`` of a table in which it is negative: the link is shorter where it increases.
    - ``relative``: whether it is known relative to other parameters alone: a common motion of the machine is not determined.
    """

    name: str
    site: str
    what: str
    value: float
    sigma: float
    unit: str
    determined: bool
    displacement: Floats = field(repr=False, compare=False)
    reversed: bool = False
    relative: bool = False

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
    redundant: zeros of their joints are further parameters where the tolerances do not explain them (:func:`with_zeros`).

    ``q``: (N, n) commands, m or rad. The derivative of the TCP is taken halfway between the nominal and the calibrated
    geometry, so that displacements are exact to the second order.
    """
    geometry, covariance = model.geometry, model.geometry_covariance
    if covariance is None or geometry.is_nominal:
        return ()
    q = q[np.unique(np.linspace(0, len(q) - 1, min(len(q), POSES)).astype(int))]
    halfway = [(p, p.nominal + deviation / 2.0) for p, deviation in geometry.all_deviations]
    parameters, values = zip(*halfway, strict=True)
    middle = Model(replace(geometry, parameters=parameters, values=np.array(values), held=())).kinematics
    poses = middle.forward(q)
    q, poses = q[poses.reached], poses[poses.reached]
    if not len(q):
        return ()
    J = middle.geometry_jacobian(q, poses)[:, :3]
    J = without_place(J, poses.T, free_motions(model))
    J, of_held = J[..., : len(geometry.parameters)], J[..., len(geometry.parameters) :]
    table, found = table_with_base(model), []
    # Where the place of the target is unknown, the data say nothing of the tool.
    target = model.free_target
    slides = {actuator.site for actuator in model.robot.actuators if not actuator.revolute}
    for row in table:
        what = "zero" if row.name == ("d" if row.site in slides else "theta") else row.name
        name = f"{row.site}.{what}" if row.site in ("base", "tool") else f"{what}[{row.site}]"
        numbers = (row.correction, row.sigma, row.unit, row.determined)
        if row.site != "tool" or not target:
            moved = J @ row.motion * row.correction
            found.append(Departure(name, row.site, what, *numbers, moved, row.name == "a" and row.nominal < 0.0))
    if not table:
        relative = dict(zip(geometry.names, relative_to_others(model, covariance).tolist(), strict=True))
        for one in with_zeros(geometry, covariance):
            what, _, rest = one.name.partition("[")
            if what.partition(".")[0] != "platform" or not target:
                numbers, moved = (one.value, one.sigma, one.unit, True), J @ one.way * one.value
                known = relative.get(one.name, False)
                found.append(Departure(one.name, rest.partition("]")[0], what, *numbers, moved, relative=known))
        for k, (p, value) in enumerate(geometry.held):
            if off := value - p.nominal:
                what = p.name.partition("[")[0]
                found.append(Departure(p.name, p.part, what, off, 0.0, p.unit, True, of_held[..., k] * off))
    return tuple(sorted(found, key=lambda one: -one.position_rms))


class Difference(NamedTuple):
    """The difference of one parameter of two parts: their names, value less nominal, standard deviation, and unit."""

    first: str
    second: str
    value: float
    sigma: float
    unit: str


def track_differences(model: Model) -> tuple[Difference, ...]:
    """Differences of the directions of parallel tracks, which a fit may determine where none is determined by itself: those of
    parameters that are known relative to others alone; the one with the most sigmas first."""
    geometry, covariance, robot = model.geometry, model.geometry_covariance, model.robot
    if covariance is None or geometry.is_nominal:
        return ()
    axes = {
        a.site: robot.model.jointPlacements[a.joint_id].rotation @ joint_axis(robot.model, a.joint_id)[:3]
        for a in robot.actuators
        if robot.model.parents[a.joint_id] == 0
    }
    relative, found = relative_to_others(model, covariance), list[Difference]()
    own = [
        i for i, p in enumerate(geometry.parameters) if relative[i] and p.kind == "track_direction" and p.part in axes
    ]
    for i, k in combinations(own, 2):
        one, other = geometry.parameters[i], geometry.parameters[k]
        if one.component == other.component and np.abs(axes[one.part] - axes[other.part]).max() < PARALLEL:
            value = float(geometry.deviation[i] - geometry.deviation[k])
            variance = float(covariance[i, i] + covariance[k, k] - 2.0 * covariance[i, k])
            found.append(Difference(one.name, other.name, value, float(np.sqrt(max(variance, 0.0))), one.unit))
    return tuple(sorted(found, key=lambda one: -abs(one.value) / max(one.sigma, 1e-300)))


class ParameterOrZero(NamedTuple):
    """A parameter, or the zero of a joint: name, unit, direction (p,) in the space of the parameters, deviation from nominal
    and its standard deviation; ``beyond``: whether it is a zero that is off by more than the tolerances explain."""

    name: str
    unit: str
    way: Floats
    value: float
    sigma: float
    beyond: bool


def with_zeros(geometry: Geometry, covariance: Floats) -> list[ParameterOrZero]:
    """Posterior of the parameters' deviations and of those joints' zeros that are off by more than the tolerances explain.

    A shifted zero moves all that the joint carries. A calibration, whose priors are manufacturing tolerances, divides it among
    the parameters that can imitate it. With the deviations d = e + V z, where V z are those that zeros z of prior variance
    `ZERO`^2 cause, B = [1 V], x = (e, z) of prior covariance Q, and the information H = C^-1 - P^-1 of the data (C, P:
    posterior and prior covariance of d), the posterior of x has

        covariance S = (Q^-1 + B' H B)^-1,  mean S B' b,  b = C^-1 d.

    The log evidence of a further zero with the direction v is larger by m^2 / (2 (g + ZERO^-2)) - log(1 + ZERO^2 g) / 2, with
    m = v' (b - H B S B' b) and g = v' (H - H B S B' H) v. The zero with the largest gain is added, until none exceeds `GAIN`.

    The prior covariances are those of the tolerances as declared (`declared_tolerance`): where a calibration widened some,
    a zero may explain what they were widened for. Without such a zero the posterior is that of the fit.

    Of robots with loops but no rods, all zeros are added: where a drive carries a link, the place of the next joint across it
    is the same motion as the drive's zero, so that a zero of some milliradians is within the tolerances of that joint.

    ``covariance``: C, (p, p). A parameter that is the rotation of a driven joint about its own axis is returned as its zero.
    """
    size, left = geometry.declared_tolerance, _zeros(geometry)
    inverse = np.linalg.inv(covariance / np.outer(size, size))  # all in units of the declared tolerances
    power, axes = np.linalg.eigh(inverse - np.diag((size / geometry.tolerance) ** 2))
    root = np.sqrt(np.maximum(power, 0.0))[:, None] * axes.T
    H, b = root.T @ root, inverse @ (geometry.deviation / size)
    B, chosen = np.eye(len(size)), list[tuple[str, str, Floats]]()
    while True:
        rest = np.linalg.solve(np.eye(len(size)) + H @ B @ B.T, b)
        # H - H B S B' H as R' R with R = L^-1 H^1/2, L L' = 1 + H^1/2 B B' H^1/2: the difference loses all digits.
        seen = root @ B
        R = solve_triangular(np.linalg.cholesky(np.eye(len(root)) + seen @ seen.T), root, lower=True)
        gains = []
        for _, _, way in left:
            v = ZERO * way / size
            m, g = v @ rest, np.sum((R @ v) ** 2)
            gains.append(m**2 / (2.0 * (g + 1.0)) - np.log1p(g) / 2.0)
        if max(gains, default=0.0) <= GAIN:
            break
        chosen.append(left.pop(int(np.argmax(gains))))
        B = np.column_stack([B, ZERO * chosen[-1][2] / size])
    S = np.linalg.inv(np.eye(B.shape[1]) + B.T @ H @ B)
    beyond = {name for name, _, _ in chosen}
    own = size if beyond else geometry.tolerance
    if geometry.robot.constraints and not geometry.robot.rod_sites:
        chosen, left = [*chosen, *left], []
        B = np.column_stack([np.diag(own / size), *(ZERO * way / size for _, _, way in chosen)])
        S = np.linalg.inv(np.eye(B.shape[1]) + B.T @ H @ B)
    prior = np.append(own, np.full(len(chosen), ZERO))
    mean, joint, every = prior * (S @ B.T @ b), np.outer(prior, prior) * S, np.eye(len(prior))
    if not chosen:  # nothing but the fit itself
        mean, joint = geometry.deviation, covariance
    rows = {p.name: (p.unit, every[k, : len(size)], every[k]) for k, p in enumerate(geometry.parameters)}
    rows |= {name: (unit, way, every[len(size) + k]) for k, (name, unit, way) in enumerate(chosen)}
    for name, unit, way in (*chosen, *left):
        if np.count_nonzero(way) == 1:  # a joint's turn about its own axis is its zero: both together are one number
            k = int(np.flatnonzero(way)[0])
            parts = way[k] * rows.pop(geometry.parameters[k].name)[2]
            rows[name] = (unit, way, parts + rows[name][2] if name in rows else parts)
    return [
        ParameterOrZero(name, unit, way, float(parts @ mean), float(np.sqrt(parts @ joint @ parts)), name in beyond)
        for name, (unit, way, parts) in rows.items()
    ]


def _zeros(geometry: Geometry) -> list[tuple[str, str, Floats]]:
    """Name and unit of each joint's zero that is no parameter, and (p,) deviations of the parameters by 1 m or rad of it."""
    robot, found = geometry.robot, []
    rates = carrier_rates(geometry)
    for a, actuator in enumerate(robot.actuators):
        way, axis = np.zeros(len(geometry.parameters)), joint_axis(robot.model, actuator.joint_id)
        for j, own in joints_on_carrier(geometry, a):
            way[j] = rates[own, geometry.parameters[j].component].mean()
        for j, p in enumerate(geometry.parameters):
            if p.kind == "placement" and p.part == robot.model.names[actuator.joint_id]:
                way[j] = axis[p.component]
        if way.any() and f"zero[{actuator.site}]" not in geometry.names:
            found.append((f"zero[{actuator.site}]", "rad" if actuator.revolute else "m", way))
    return found


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
    :func:`with_zeros`.

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
