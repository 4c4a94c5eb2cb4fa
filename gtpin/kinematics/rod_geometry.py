"""The rods of one geometry in arrays: joints, lengths, motion of the joints on their carriers, and small errors of one rod."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gtpin.errors import ConvergenceError, ModelError
from gtpin.kinematics.closures import RodEnds, between, follow
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp, left_jacobian, skew
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry, MeasuredTrack
from gtpin.robot.parameters import Kind, rotation_axes
from gtpin.robot.rods import Rod
from gtpin.typing import Floats

PARAMETERS = ("L", "Px", "Py", "Pz", "Cx", "Cy", "Cz", "vx", "vy", "vz")
"""Small errors of a rod (Dressler et al. 2010, Table III): of its length L; of its joint P on the platform, TCP frame; of its
joint C on the carrier at command 0 and of the direction v of its track, base frame."""


@dataclass(frozen=True)
class CarrierJoint:
    """A joint on a carrier: C(q) = C0 + R p(q) + (exp(R w(q)) - 1) lever, base frame.

    The path p and the rotation vector w of the carrier: of a cart on a straight track q ``axis`` and 0 (eq. 2); of an arm 0 and
    q ``axis``; of a cart whose guideway was measured those of the ``track`` (eq. 4). ``lever`` goes from the point about which
    the carrier turns to the joint. R is the rotation of path and axis as a whole, by three small angles. Everywhere ``travel``
    (N,) is in m or rad.

    ``C0``: (3,) position at the command 0, m. ``axis``: (3,) nominal unit direction; zero where nothing moves the joint.
    ``axes``, ``angles``: (3, 3) unit vectors, one per row, and (3,) angles a, b and c about them, rad; c: about the track.
    ``origin``: (3,) a point of an arm's axis, m; None: the carrier slides. ``track``: the measured track; None: there is none.
    """

    C0: Floats
    axis: Floats
    axes: Floats
    angles: Floats
    origin: Floats | None = None
    track: MeasuredTrack | None = None

    @cached_property
    def R(self) -> Floats:
        """(3, 3) the rotation of the carrier's path."""
        return exp(self.angles @ self.axes)

    @cached_property
    def v(self) -> Floats:
        """(3,) unit direction of the track (of a measured one, of its chord) or axis; zero where nothing moves the joint."""
        if self.track is None:
            return np.asarray(self.R @ self.axis)
        chord = self.R @ (self.track.path[-1] - self.track.path[0])
        return np.asarray(chord / np.linalg.norm(chord))

    def position(self, travel: Floats) -> Floats:
        """(N, 3) the paper's C(q), m."""
        moved, turn = self.C0 + self._path(travel), self._turn(travel)
        return np.asarray(moved if turn is None else moved + turn @ self._lever - self._lever)

    def by_travel(self, travel: Floats) -> Floats:
        """(N, 3) derivative of the position by the travel."""
        turn = self._turn(travel)
        if turn is None:
            return np.broadcast_to(self.v, (len(travel), 3))
        if self.track is None:
            return np.cross(self.v, turn @ self._lever)
        along, turning = self.track.slope(travel) @ self.R.T, self.track.turn_slope(travel) @ self.R.T
        # Carts rotate by fractions of a milliradian: the derivative of the rotation vector is taken for that of the rotation.
        return np.asarray(along + np.cross(turning, self._lever))

    def by_joint(self, travel: Floats, component: int) -> Floats:
        """(N, 3) derivative of the position by a component, base frame, of the joint's position at the command 0."""
        turn = self._turn(travel)
        return np.broadcast_to(np.eye(3)[component], (len(travel), 3)) if turn is None else turn[:, :, component]

    def by_turn(self, travel: Floats, component: int) -> Floats:
        """(N, 3) derivative of the position by one of the angles; the joint at the command 0 stays."""
        rate = left_jacobian(self.angles @ self.axes) @ self.axes[component]
        turn, across = self._turn(travel), skew(rate).T
        if turn is None:
            return np.asarray(travel[:, None] * (self.v @ across))
        path = self._path(travel) @ across
        return np.asarray(path + turn @ self._lever @ across - turn @ (self._lever @ across))

    @cached_property
    def _lever(self) -> Floats:
        origin = self.origin if self.track is None else self.track.origin
        assert origin is not None
        return np.asarray(self.C0 - origin)

    def _path(self, travel: Floats) -> Floats:
        if self.track is not None:
            return np.asarray(self.track.displacement(travel) @ self.R.T)
        return np.asarray((travel if self.origin is None else 0.0 * travel)[:, None] * self.v)

    def _turn(self, travel: Floats) -> Floats | None:
        """(N, 3, 3) rotation of the carrier since the command 0; None: it slides along a straight track."""
        if self.track is not None:
            return exp(self.track.turn(travel) @ self.R.T)
        return None if self.origin is None else exp(travel[:, None] * self.v)


@dataclass(frozen=True)
class RodGeometry:
    """The arrays of one geometry (Dressler et al. 2010, eqs. 2 and 5) of k rods.

    ``geometry``: the geometry of a robot with six rods.

    Raises `ModelError` if the robot does not have six rods.
    """

    geometry: Geometry

    def __post_init__(self) -> None:
        rods = self.geometry.robot.rods
        if len(rods) != 6:
            raise ModelError(f"{self.geometry.robot.name} has {len(rods)} rods", hint="six hold a platform")

    @property
    def robot(self) -> Chain:
        """The robot, at its nominal geometry."""
        return self.geometry.robot

    @property
    def names(self) -> tuple[str, ...]:
        """(k,) names of the rods."""
        return tuple(rod.name for rod in self._rods)

    @cached_property
    def P(self) -> Floats:
        """(k, 3) joints on the platform, TCP frame, m."""
        return np.array([rod.P for rod in self._rods]) + self.geometry.deviations("platform_joint", "rod", (self._k, 3))

    @cached_property
    def C0(self) -> Floats:
        """(k, 3) joints on the carriers with all commands zero, base frame, m."""
        return np.array([rod.C for rod in self._rods]) + self._deviations("carrier_joint", 3)

    @cached_property
    def L0(self) -> Floats:
        """(k,) lengths with all commands zero, m."""
        return np.array([rod.L for rod in self._rods]) + self._deviations("length", 1)[:, 0]

    @cached_property
    def v(self) -> Floats:
        """(k, 3) directions of the carriers' tracks or axes, unit vectors, base frame; zero where nothing moves them."""
        return np.array([seat.v for seat in self.seats])

    @cached_property
    def seats(self) -> tuple[CarrierJoint, ...]:
        """The motion of each rod's joint on its carrier."""
        return tuple(self._seat(i, rod) for i, rod in enumerate(self._rods))

    @cached_property
    def scale(self) -> Floats:
        """(k,) travel per commanded unit."""
        return np.asarray(1.0 + self._deviations("scale", 1)[:, 0])

    def ends(self, q: Floats) -> RodEnds:
        """The rods' ends at commands q (N, n): the paper's C(q), and lengths where actuators change them."""
        travel = self._travel(q)
        C = np.empty((len(q), self._k, 3))
        for i, seat in enumerate(self.seats):
            C[:, i] = seat.position(travel[:, i])
        if not self._extends.any():
            return RodEnds(self.P, C, self.L0[None, :])
        return RodEnds(self.P, C, self.L0 + travel * self._extends)

    @property
    def _rods(self) -> tuple[Rod, ...]:
        return self.geometry.robot.rods

    @property
    def _k(self) -> int:
        return len(self._rods)

    @cached_property
    def _driver(self) -> npt.NDArray[np.int_]:
        """(k,) the actuator that moves a rod's carrier joint or changes its length; -1 where none does."""
        return np.array([-1 if rod.driver is None else rod.driver for rod in self._rods])

    @cached_property
    def _extends(self) -> npt.NDArray[np.bool_]:
        return np.array([rod.extension is not None for rod in self._rods])

    def _deviations(self, kind: Kind, components: int) -> Floats:
        """(k, components) deviations of each rod: its own, and those that all rods of its actuator share."""
        own = self.geometry.deviations(kind, "rod", (self._k, components))
        by_actuator = self.geometry.deviations(kind, "actuator", (self.geometry.robot.n_actuators, components))
        return np.asarray(own + np.where(self._driver[:, None] >= 0, by_actuator[self._driver], 0.0))

    def _seat(self, i: int, rod: Rod) -> CarrierJoint:
        if rod.carrier is None:
            return CarrierJoint(self.C0[i], np.zeros(3), np.eye(3), np.zeros(3))
        actuator, track = self.robot.actuators[rod.carrier], self.geometry.track(i)
        origin = actuator.origin if actuator.revolute and track is None else None
        return CarrierJoint(self.C0[i], actuator.axis, rotation_axes(actuator.axis), self._turns[i], origin, track)

    @cached_property
    def _turns(self) -> Floats:
        """(k, 3) rotations of each rod's path, rad: a, b, and about the track itself."""
        return self._deviations("direction", 3)

    @cached_property
    def size(self) -> float:
        """Magnitude of the coordinates, m, for the size of rounding errors."""
        return max(self.geometry.robot.size, float(np.abs(self.C0).max()), float(self.L0.max()))

    def _travel(self, q: Floats) -> Floats:
        """(N, k) travel of each rod's own actuator, m or rad; zero where it has none."""
        return np.asarray(np.where(self._driver >= 0, q[:, self._driver], 0.0) * self.scale)

    def _by_travel(self, ends: RodEnds, d: Floats, travel: Floats) -> Floats:
        """(N, k) derivative of each closure by the travel of its own actuator."""
        rate = np.empty(d.shape[:2])
        for i, seat in enumerate(self.seats):
            rate[:, i] = -np.einsum("ni,ni->n", d[:, i], seat.by_travel(travel[:, i]))
        return np.asarray(np.where(self._extends, -ends.L, rate))

    def _owned(self, per: str, kind: str, owner: int) -> list[int]:
        """The rods that a parameter moves."""
        if per == "rod":
            return [owner]
        if kind == "direction":
            return [i for i, rod in enumerate(self._rods) if rod.carrier == owner]
        return [i for i in range(self._k) if self._driver[i] == owner]


@dataclass(frozen=True)
class RodStep:
    """Dependence of one rod's ends and length on one parameter.

    - ``rod``: index of the rod.
    - ``P``: (3,) motion of its joint on the platform, TCP frame, per unit of the parameter.
    - ``C``: (N, 3) motion of its joint on the carrier at each pose, base frame, per unit of the parameter.
    - ``L``: change of its length, per unit of the parameter.
    """

    rod: int
    P: Floats
    C: Floats
    L: float

    def vector(self, poses: Poses) -> Floats:
        """(N, 3) change of the rod's vector d = T + R P - C at fixed poses, base frame, per unit of the parameter."""
        return np.asarray(poses.R @ self.P - self.C)

    def slope(self, d: Floats, ends: RodEnds, poses: Poses) -> Floats:
        """(N,) derivative of the rod's closure (|d|^2 - L^2) / 2 by the parameter; d (N, 3) is its vector."""
        L = np.broadcast_to(ends.L, (len(poses), ends.L.shape[1]))[:, self.rod]
        return np.asarray(np.einsum("ni,ni->n", d, self.vector(poses)) - L * self.L)

    def poses_after(self, step: float, ends: RodEnds, poses: Poses, size: float) -> Poses:
        """Poses (N) that satisfy the closures after a step of the parameter, in the same assembly mode as ``poses`` before it.

        ``ends``: the rods at these poses; ``size``: as for :func:`~gtpin.kinematics.closures.newton`.

        Raises `ConvergenceError` if the closures have no solution.
        """
        P, C = ends.P.copy(), ends.C.copy()
        L = np.repeat(ends.L, len(poses), axis=0) if len(ends.L) == 1 else ends.L.copy()
        P[..., self.rod, :] += step * self.P
        C[:, self.rod] += step * self.C
        L[:, self.rod] += step * self.L
        after = RodEnds(P, C, L)
        moved = follow(lambda s, rows: between(ends, after, s, rows), poses, size)
        if not moved.reached.all():
            raise ConvergenceError(
                f"a step of {step:g} opens the rods at row {np.flatnonzero(~moved.reached)[0]}",
                hint="leave out commands near a singularity",
            )
        return moved


def rod_step(rods: RodGeometry, q: Floats, parameter: str, rod: int) -> RodStep | None:
    """The effect of a parameter of a rod at commands q (N, n); None for a direction where the rod's carrier has no track.

    C = C0 + q (v + dv): as in the paper, a step dv of the direction is added without normalisation, also to a measured track.
    For a carrier that turns, the parameter C is the joint's position at command 0.
    """
    zero, still = np.zeros(3), np.zeros((len(q), 3))
    if parameter == "L":
        return RodStep(rod, zero, still, 1.0)
    axis = np.eye(3)["xyz".index(parameter[1])]
    if parameter[0] == "P":
        return RodStep(rod, axis, still, 0.0)
    robot = rods.geometry.robot
    carrier = robot.rods[rod].carrier
    if parameter[0] == "C":
        travel = np.zeros(len(q)) if carrier is None else q[:, carrier] * rods.scale[rod]
        moved = rods.seats[rod].by_joint(travel, "xyz".index(parameter[1]))
        return RodStep(rod, zero, np.array(np.broadcast_to(moved, still.shape)), 0.0)
    if carrier is None or bool(robot.revolute[carrier]):
        return None
    return RodStep(rod, zero, q[:, carrier, None] * axis, 0.0)
