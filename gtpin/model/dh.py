"""The parameters of Denavit and Hartenberg of a serial arm, the poses of a table, and what a calibration changes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.errors import ConvergenceError
from gtpin.model.model import Model, root_of
from gtpin.model.place import free_motions
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import Actuator
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats

PARALLEL = 0.01
"""Sine of the angle between two axes below which their common normal is no parameter of a table (Hayati): 20 tolerances of
0.5 mrad. Assumed."""
ZERO = 1e-6
"""Length, m or of a unit vector, that counts as zero."""
TURNS = ("theta", "alpha", "beta", "ra", "rb")
"""Names of angles."""
DETERMINED = 0.5
"""Largest sigma, relative to that of its prior, of a parameter that the data determine: a variance reduction of 75 %.
Assumed."""


@dataclass(frozen=True)
class DhParameter:
    """One parameter of an arm's table.

    ``site``: the joint, or ``tool``. ``name``: ``theta`` (the angle at command 0), ``d``, ``a``, ``alpha``, and ``beta``, a
    rotation about the frame's y axis, in the place of ``d`` where the next axis is nearly parallel (Hayati); of the tool ``x``
    to ``rz`` in the TCP frame, one after the other. ``nominal``, ``correction``, ``sigma``: m or rad, as ``unit`` says;
    ``sigma`` is NaN for a nominal geometry. ``determined``: whether the data determine it; all corrections belong together.
    ``motion``: (p,) deviations of the geometry's parameters that it causes, per unit.
    """

    site: str
    name: str
    unit: str
    nominal: float
    correction: float
    sigma: float
    determined: bool
    motion: Floats = field(repr=False, compare=False)


def controller_table(model: Model, *, exact: bool = False) -> tuple[DhParameter, ...]:
    """The table of a serial arm, by the standard convention, with the corrections that agree best with a calibration.

    Empty where the robot is not a serial arm, or the geometry lacks the six parameters of a joint or of the TCP. Without the
    tool where the target was free: it then stays where the robot's file has it.

    ``exact``: whether to raise `ConvergenceError` where no table with the poses of the geometry is found; else the corrections
    are then right to first order.
    """
    left = ("base", "tool") if model.targets_free else ("base",)
    return tuple(p for p in table_with_base(model, exact=exact) if p.site not in left)


def table_with_base(model: Model, *, exact: bool = False) -> tuple[DhParameter, ...]:
    """The rows of :func:`controller_table` after those of the first axis: shifts ``a``, ``b`` across it, m, and tilts ``ra``,
    ``rb``, rad, of the site ``base``, about the directions of :func:`~gtpin.robot.parameters.rotation_axes`.

    The placements of a calibration are redundant parameters; those of a table are minimal. The corrections d are first the
    weighted least squares estimate from the calibration's deviations m with covariance C, where V d are the deviations that d
    causes: ``(V' C^-1 V)^-1 V' C^-1 m``. The pose of the first axis in the base frame, which no table has, is estimated with
    them. The estimate is exact to first order: :meth:`~gtpin.model.dh.DhChain.equal_to` then finds the table whose poses
    are those of the calibrated geometry.

    Where the target was free, the tool stays as it is, and the last joint has ``d`` too.
    """
    geometry, covariance, chain = model.geometry, model.geometry_covariance, chain_of(model.robot)
    size = len(geometry.parameters)
    if not chain or size != 6 * (len(chain) + 1):
        return ()
    rows, V, table = _directions(geometry, free_target=model.targets_free)
    if not geometry.deviation.any():
        return tuple(DhParameter(*row, 0.0, np.nan, False, way) for row, way in zip(rows, V.T, strict=True))
    prior = np.diag(geometry.tolerance**2)
    half = np.linalg.solve(prior if covariance is None else covariance, V)
    spread = np.linalg.inv(V.T @ half)
    sigma = np.full(len(rows), np.nan) if covariance is None else np.sqrt(np.diag(spread))
    before = np.sqrt(np.diag(np.linalg.inv(V.T @ np.linalg.solve(prior, V))))
    start, stands = spread @ (half.T @ geometry.deviation), free_motions(model)
    known = np.array([not (model.targets_free and row[0] == "tool") for row in rows])
    found = np.where(known, start, 0.0)
    try:
        found = table.equal_to(Model(geometry.at_tool()), found, spread * np.outer(known, known), stands)
    except ConvergenceError:
        if exact:
            raise
    columns = zip(rows, found, sigma, sigma <= DETERMINED * before, V.T, strict=True)
    return tuple(DhParameter(*row, float(c), float(s), bool(known), way) for row, c, s, known, way in columns)


def chain_of(robot: Chain) -> tuple[Actuator, ...]:
    """The actuators that move the TCP of a serial arm, from the base; empty for other robots, and where one has no command."""
    of = {actuator.joint_id: actuator for actuator in robot.actuators}
    if robot.constraints or not set(robot.moving_joints) <= set(of):
        return ()
    return tuple(of[joint] for joint in robot.moving_joints)


def _directions(geometry: Geometry, *, free_target: bool) -> tuple[list[tuple[str, str, str, float]], Floats, DhChain]:
    """Site, name, unit and nominal value of each row, the base's first; (p, r) motion of the geometry's parameters by each; and
    the table as a chain of motions."""
    robot = geometry.robot
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.with_commands(robot.neutral, np.zeros(robot.n_actuators)))
    rows: list[tuple[str, str, str, float]] = []
    motions: list[tuple[int, Floats]] = []
    parts: list[tuple[Any, int | None, int | None]] = []
    placing: dict[int, list[tuple[int, Floats]]] = {}  # by joint: the parameters that displace it, and their twists
    for i, p in enumerate(geometry.parameters):
        for frame, twist in p.moves:
            placing.setdefault(frame + 1, []).append((i, twist))

    def add(site: str, name: str, value: float, joint: int, twist: Any, local: Any, command: int | None = None) -> None:
        parts.append((local, len(rows), command))
        rows.append((site, name, "rad" if name in TURNS else "m", value))
        motions.append((joint, np.asarray(data.oMi[joint].actInv(twist).vector)))

    actuators = chain_of(robot)
    first = actuators[0]
    for name, axis in zip("ab", rotation_axes(first.axis), strict=False):
        shift = pin.Motion(axis, np.zeros(3))
        add("base", name, 0.0, first.joint_id, shift, shift)
    for name, axis in zip("ab", rotation_axes(first.axis), strict=False):
        tilt = _about(axis, first.origin)
        add("base", f"r{name}", 0.0, first.joint_id, tilt, tilt)
    x_before: Floats | None = None
    origin = first.origin - first.axis * (first.origin @ first.axis)  # the foot of the base frame's origin
    for own, after in zip(actuators, [*actuators[1:], None], strict=True):
        z, command = own.axis, robot.sites.index(own.site)
        turn, slide = _about(z, own.origin), pin.Motion(z, np.zeros(3))
        of_theta, of_d = (command, None) if own.revolute else (None, command)
        if after is None:
            if x_before is None:
                parts.append((_frame(rotation_axes(z)[0], z, origin), None, None))
            if own.revolute:
                add(own.site, "theta", 0.0, own.joint_id, turn, LOCAL["theta"], of_theta)
            if free_target or not own.revolute:
                add(own.site, "d", 0.0, own.joint_id, slide, LOCAL["d"], of_d)
            break
        normal, between, d = np.cross(z, after.axis), after.origin - origin, 0.0
        parallel = bool(np.linalg.norm(normal) <= PARALLEL)
        if parallel:  # where the next axis meets the plane across this one
            normal = between - after.axis * (between @ z) / (after.axis @ z)
        else:
            d = float(np.cross(between, after.axis) @ normal / (normal @ normal))
        if np.linalg.norm(normal) > ZERO:
            x = normal / np.linalg.norm(normal)
        else:  # the axes are one line: any direction across it
            x = np.linalg.svd(z[None])[2][1] if x_before is None else x_before
        if x_before is not None and x @ x_before < -ZERO:
            x = -x  # theta at command 0 is between -90 and 90 degrees
        if x_before is None:
            parts.append((_frame(x, z, origin), None, None))
        theta = 0.0 if x_before is None else float(np.arctan2(np.cross(x_before, x) @ z, x_before @ x))
        foot = origin + d * z
        y = np.cross(z, x)
        alpha, beta = float(np.arctan2(-(after.axis @ y), after.axis @ z)), float(np.arcsin(after.axis @ x))
        a = float((normal if parallel else after.origin - foot) @ x)
        if own.revolute or not parallel:
            add(own.site, "theta", theta, own.joint_id, turn, LOCAL["theta"], of_theta)
        elif theta:
            parts.append((pin.exp6(LOCAL["theta"] * theta), None, None))  # no row of what slides along the next axis
        if not parallel or not own.revolute:
            add(own.site, "d", d, own.joint_id, slide, LOCAL["d"], of_d)
        origin = foot + a * x
        add(own.site, "a", a, after.joint_id, pin.Motion(x, np.zeros(3)), LOCAL["a"])
        add(own.site, "alpha", alpha, after.joint_id, _about(x, origin), LOCAL["alpha"])
        x_before = x
        if parallel:
            y = np.cos(alpha) * y + np.sin(alpha) * z
            add(own.site, "beta", beta, after.joint_id, _about(y, origin), LOCAL["beta"])
            x_before = np.cross(y, after.axis)
    V = np.zeros((len(geometry.parameters), len(motions)))
    for k, (joint, twist) in enumerate(motions):
        columns, twists = zip(*placing[joint], strict=True)
        V[list(columns), k] = np.linalg.solve(np.column_stack(twists), twist)
    tool = [i for i, p in enumerate(geometry.parameters) if p.kind == "platform"]
    zero = np.zeros((1, robot.n_actuators))
    tcp = Model(Geometry.nominal(robot)).kinematics.forward(zero)
    last, _ = DhChain(parts, values := np.array([value for *_, value in rows])).at(values, zero[0])
    parts.append((last.inverse() * pin.SE3(tcp.R[0], tcp.T[0]), None, None))
    for k, i in enumerate(tool):
        parts.append((pin.Motion(np.eye(6)[geometry.parameters[i].component]), len(rows) + k, None))
    rows += [("tool", p.name.split(".")[-1], p.unit, 0.0) for p in (geometry.parameters[i] for i in tool)]
    return rows, np.hstack([V, np.eye(len(V))[:, tool]]), DhChain(parts, np.array([value for *_, value in rows]))


def _frame(x: Floats, z: Floats, origin: Floats) -> Any:
    """The placement of a frame with axes x and z."""
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), origin)


def _about(axis: Floats, point: Floats) -> Any:
    """The twist of a rotation about a line."""
    return pin.Motion(np.cross(point, axis), axis)


X, Y, Z, RX, RY, RZ = map(pin.Motion, np.eye(6))
LOCAL = {"theta": RZ, "d": Z, "a": X, "alpha": RX, "beta": RY}
"""Twist of each parameter of a joint in the frame before it, in the order in which they follow each other."""
POSTURES = 12
"""Number of postures at which the poses are compared: six numbers each, of at most six parameters a joint and six of the
tool."""
STEPS, CLOSE, EQUAL, RANK = 20, 1e-12, 1e-8, 1e-9
"""Largest number of Newton steps; the step at which they end, and the largest last step of an equal table, m and rad; and the
relative singular value that counts as 0."""


@dataclass(frozen=True, eq=False)
class DhChain:
    """The motions of a table's rows, one after the other from the base to the TCP; the base and the tool are among them.

    ``motions``: each a fixed placement, or a twist (6,) with the index of its row (None: of no row) and of its command (None:
    of no command). ``nominal``: (r,) values of the rows.
    """

    motions: Sequence[tuple[Any, int | None, int | None]]
    nominal: Floats

    def at(self, values: Floats, q: Floats) -> tuple[Any, Floats]:
        """The TCP's pose at commands q (n,) with values (r,) of the rows; and (6, r) its derivative by these, in the base
        frame's axes."""
        at, twists = pin.SE3.Identity(), np.zeros((6, len(values)))
        for motion, row, command in self.motions:
            if row is None and command is None:
                at = at * motion
                continue
            size = (0.0 if row is None else values[row]) + (0.0 if command is None else q[command])
            at = at * pin.exp6(motion * size)
            if row is not None:
                twists[:, row] = at.act(motion).vector
        twists[:3] -= np.cross(at.translation, twists[3:], axisb=0, axisc=0)
        return at, twists

    def equal_to(self, model: Model, start: Floats, covariance: Floats, stands: Floats) -> Floats:
        """Corrections (r,) of the rows whose poses are those of a model, in all postures, but for motions of the whole machine.

        ``start``, ``covariance``: their estimate (r,) and its covariance (r, r). Of several tables with these poses it is the
        one that is nearest by this covariance. ``stands``: (6, k) motions of the whole machine that are no error.

        Raises `ConvergenceError` where the steps do not end.
        """
        x, half, r = start.copy(), root_of(covariance), len(start)
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (POSTURES, model.robot.n_actuators))
        wanted = model.kinematics.forward(q)
        for _ in range(STEPS):
            errors, ways = [], []
            for row, T, R in zip(q, wanted.T, wanted.R, strict=True):
                at, twists = self.at(self.nominal + x, row)
                errors.append(np.concatenate([T - at.translation, pin.log3(R @ at.rotation.T)]))
                # At the table's own pose: else those that its base imitates look independent of it, and steps have no end.
                turned = np.cross(stands[3:], at.translation, axisa=0, axisc=0)
                whole = np.concatenate([stands[:3] + turned, stands[3:]])
                ways.append(np.hstack([twists @ half, whole]))
            found = np.linalg.lstsq(np.concatenate(ways), np.concatenate(errors), rcond=RANK)[0]
            step, moved = half @ found[:r], pin.exp6(-stands @ found[r:])
            x, wanted = x + step, wanted.moved(moved.translation, moved.rotation)
            if np.abs(step).max() < CLOSE:
                break
        if np.abs(step).max() > EQUAL:
            what = f"a Denavit-Hartenberg table of {model.robot.name} has not converged in {STEPS} steps"
            raise ConvergenceError(what, hint="export a URDF")
        return x
