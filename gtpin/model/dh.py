"""The parameters of Denavit and Hartenberg of a serial arm, and what a calibration changes of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import Actuator
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats

PARALLEL = 1e-6
"""Sine of the angle between two axes below which they are parallel."""
TURNS = ("theta", "alpha", "beta", "ra", "rb")
"""Names of angles."""
DETERMINED = 0.5
"""Largest sigma, relative to that of its prior, of a parameter that the data determine: a variance reduction of 75 %.
Assumed."""


@dataclass(frozen=True)
class DhParameter:
    """One parameter of an arm's table.

    ``site``: the joint, or ``tool``. ``name``: ``theta`` (the angle at command 0), ``d``, ``a``, ``alpha``, and ``beta``, a
    rotation about the frame's y axis, in the place of ``d`` where the next axis is parallel (Hayati); of the tool ``x`` to
    ``rz`` in the TCP frame. ``nominal``, ``correction``, ``sigma``: m or rad, as ``unit`` says; ``sigma`` is NaN for a nominal
    geometry. ``determined``: whether the data determine it; all corrections belong together. ``motion``: (p,) deviations of
    the geometry's parameters that it causes, per unit.
    """

    site: str
    name: str
    unit: str
    nominal: float
    correction: float
    sigma: float
    determined: bool
    motion: Floats = field(repr=False, compare=False)


def controller_table(model: Model) -> tuple[DhParameter, ...]:
    """The table of a serial arm, by the standard convention, with the corrections that agree best with a calibration.

    Empty where the robot is not a serial arm, or the geometry lacks the six parameters of a joint or of the TCP. Without the
    tool where the place of the measured target was unknown: the data then say nothing of the tool.
    """
    left = ("base", "tool") if model.free_target else ("base",)
    return tuple(p for p in table_with_base(model) if p.site not in left)


def table_with_base(model: Model) -> tuple[DhParameter, ...]:
    """The rows of :func:`controller_table` after those of the first axis: shifts ``a``, ``b`` across it, m, and tilts ``ra``,
    ``rb``, rad, of the site ``base``, about the directions of :func:`~gtpin.robot.parameters.rotation_axes`.

    The placements of a calibration are redundant parameters; those of a table are minimal. Its corrections d are the weighted
    least squares estimate from the calibration's deviations m with covariance C, where V d are the deviations that d causes:
    ``(V' C^-1 V)^-1 V' C^-1 m``. The pose of the first axis in the base frame, which no table has, is estimated with them.
    """
    geometry, covariance, chain = model.geometry, model.covariance, chain_of(model.robot)
    size = len(geometry.parameters)
    if not chain or size != 6 * (len(chain) + 1):
        return ()
    if model.joint_covariance is not None:
        covariance = model.joint_covariance[:size, :size]
    rows, V = _directions(geometry)
    if covariance is None or not geometry.deviation.any():
        return tuple(DhParameter(*row, 0.0, np.nan, False, way) for row, way in zip(rows, V.T, strict=True))
    # A free target's deviations count from where it was seen at first.
    start = np.zeros(V.shape[1])
    start[-6:] = [p.nominal for p in geometry.parameters if p.kind == "platform"]
    half = np.linalg.solve(covariance, V)
    spread = np.linalg.inv(V.T @ half)
    found, sigma = start + spread @ (half.T @ geometry.deviation), np.sqrt(np.diag(spread))
    before = np.sqrt(np.diag(np.linalg.inv((V / geometry.tolerance[:, None] ** 2).T @ V)))
    columns = zip(rows, found, sigma, sigma <= DETERMINED * before, V.T, strict=True)
    return tuple(DhParameter(*row, float(c), float(s), bool(known), way) for row, c, s, known, way in columns)


def chain_of(robot: Chain) -> tuple[Actuator, ...]:
    """The actuators that move the TCP of a serial arm, from the base; empty for other robots, and where one has no command."""
    of = {actuator.joint_id: actuator for actuator in robot.actuators}
    if robot.constraints or not set(robot.moving_joints) <= set(of):
        return ()
    return tuple(of[joint] for joint in robot.moving_joints)


def _directions(geometry: Geometry) -> tuple[list[tuple[str, str, str, float]], Floats]:
    """Site, name, unit and nominal value of each row, the base's first; (p, r) motion of the geometry's parameters by each."""
    robot = geometry.robot
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.with_commands(robot.neutral, np.zeros(robot.n_actuators)))
    rows: list[tuple[str, str, str, float]] = []
    motions: list[tuple[int, Floats]] = []
    placing: dict[int, list[tuple[int, Floats]]] = {}  # by joint: the parameters that displace it, and their twists
    for i, p in enumerate(geometry.parameters):
        for frame, twist in p.moves:
            placing.setdefault(frame + 1, []).append((i, twist))

    def add(site: str, name: str, value: float, joint: int, twist: Any) -> None:
        rows.append((site, name, "rad" if name in TURNS else "m", value))
        motions.append((joint, np.asarray(data.oMi[joint].actInv(twist).vector)))

    actuators = chain_of(robot)
    first = actuators[0]
    across = dict(zip("ab", rotation_axes(first.axis), strict=False))
    for name, axis in across.items():
        add("base", name, 0.0, first.joint_id, pin.Motion(axis, np.zeros(3)))
    for name, axis in across.items():
        add("base", f"r{name}", 0.0, first.joint_id, _about(axis, first.origin))
    x_before: Floats | None = None
    origin = first.origin - first.axis * (first.origin @ first.axis)  # the foot of the base frame's origin
    for own, after in zip(actuators, [*actuators[1:], None], strict=True):
        z = own.axis
        if after is None:
            if own.revolute:
                add(own.site, "theta", 0.0, own.joint_id, _about(z, own.origin))
            else:
                add(own.site, "d", 0.0, own.joint_id, pin.Motion(z, np.zeros(3)))
            break
        normal, between, d = np.cross(z, after.axis), after.origin - origin, 0.0
        parallel = bool(np.linalg.norm(normal) <= PARALLEL)
        if parallel:
            normal = between - z * (between @ z)
        else:
            d = float(np.cross(between, after.axis) @ normal / (normal @ normal))
        if np.linalg.norm(normal) > PARALLEL:
            x = normal / np.linalg.norm(normal)
        else:  # the axes are one line: any direction across it
            x = np.linalg.svd(z[None])[2][1] if x_before is None else x_before
        if x_before is not None and x @ x_before < -PARALLEL:
            x = -x  # theta at command 0 is between -90 and 90 degrees
        theta = 0.0 if x_before is None else float(np.arctan2(np.cross(x_before, x) @ z, x_before @ x))
        foot = origin + d * z
        a = float((after.origin - foot) @ x)
        alpha = float(np.arctan2(np.cross(z, after.axis) @ x, z @ after.axis))
        origin, x_before = foot + a * x, x
        if own.revolute or not parallel:
            add(own.site, "theta", theta, own.joint_id, _about(z, own.origin))
        if not parallel or not own.revolute:
            add(own.site, "d", d, own.joint_id, pin.Motion(z, np.zeros(3)))
        add(own.site, "a", a, after.joint_id, pin.Motion(x, np.zeros(3)))
        add(own.site, "alpha", alpha, after.joint_id, _about(x, origin))
        if parallel:
            add(own.site, "beta", 0.0, after.joint_id, _about(np.cross(z, x), origin))
    V = np.zeros((len(geometry.parameters), len(motions)))
    for k, (joint, twist) in enumerate(motions):
        columns, twists = zip(*placing[joint], strict=True)
        V[list(columns), k] = np.linalg.solve(np.column_stack(twists), twist)
    tool = [i for i, p in enumerate(geometry.parameters) if p.kind == "platform"]
    rows += [("tool", p.name.split(".")[-1], p.unit, 0.0) for p in (geometry.parameters[i] for i in tool)]
    return rows, np.hstack([V, np.eye(len(V))[:, tool]])


def _about(axis: Floats, point: Floats) -> Any:
    """The twist of a rotation about a line."""
    return pin.Motion(np.cross(point, axis), axis)
