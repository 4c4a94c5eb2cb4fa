"""The rods of one geometry in arrays: joints, lengths, and the motion of the joints on their carriers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from gtpin.errors import ModelError
from gtpin.kinematics.closures import RodEnds
from gtpin.kinematics.rotations import cross, exp, left_jacobian
from gtpin.robot.geometry import Geometry, MeasuredTrack
from gtpin.robot.parameters import Kind, rotation_axes
from gtpin.robot.robot import Robot
from gtpin.robot.rods import Rod
from gtpin.typing import Floats


class CarrierJoint(Protocol):
    """A joint on a carrier. Everything is in the base frame; ``travel`` (N,) is in m or rad."""

    @property
    def v(self) -> Floats:
        """(3,) unit direction of the track or axis; zero where nothing moves the joint."""

    def position(self, travel: Floats) -> Floats:
        """(N, 3) the paper's C(q), m."""

    def by_travel(self, travel: Floats) -> Floats:
        """(N, 3) derivative of the position by the travel."""

    def by_joint(self, travel: Floats, component: int) -> Floats:
        """(N, 3) derivative of the position by a component, base frame, of the joint's position at the command 0."""

    def by_turn(self, travel: Floats, component: int) -> Floats:
        """(N, 3) derivative of the position by a small rotation (a, b, or about the track itself) of the carrier's path."""


@dataclass(frozen=True)
class Turned:
    """A rotation by three small angles.

    ``axes``: (3, 3) unit vectors, one per row: the axes of the angles a, b and c. ``angles``: (3,) angles a, b and c, rad.
    The rotation is the exponential of the rotation vector ``angles @ axes``.
    """

    axes: Floats
    angles: Floats

    @cached_property
    def R(self) -> Floats:
        """(3, 3) the rotation."""
        return exp(self.angles @ self.axes)

    def rate(self, component: int) -> Floats:
        """(3,) derivative of the rotation by one of the angles, as a rotation vector in the fixed frame."""
        return np.asarray(left_jacobian(self.angles @ self.axes) @ self.axes[component])


@dataclass(frozen=True)
class TrackJoint:
    """A joint on a cart that slides along a straight track: C(q) = C0 + q v (eq. 2); with a zero axis, one on the base."""

    C0: Floats
    axis: Floats
    turned: Turned

    @cached_property
    def v(self) -> Floats:
        """(3,) unit direction of the track."""
        return np.asarray(self.turned.R @ self.axis)

    def position(self, travel: Floats) -> Floats:
        return np.asarray(self.C0 + travel[:, None] * self.v)

    def by_travel(self, travel: Floats) -> Floats:
        return np.broadcast_to(self.v, (len(travel), 3))

    def by_joint(self, travel: Floats, component: int) -> Floats:
        return np.broadcast_to(np.eye(3)[component], (len(travel), 3))

    def by_turn(self, travel: Floats, component: int) -> Floats:
        return np.asarray(travel[:, None] * cross(self.turned.rate(component), self.v))


@dataclass(frozen=True)
class ArmJoint:
    """A joint on an arm that rotates about an axis through ``origin``."""

    C0: Floats
    axis: Floats
    origin: Floats
    turned: Turned

    @cached_property
    def v(self) -> Floats:
        """(3,) unit direction of the axis."""
        return np.asarray(self.turned.R @ self.axis)

    def _turn(self, travel: Floats) -> Floats:
        return exp(travel[:, None] * self.v)

    def position(self, travel: Floats) -> Floats:
        return np.asarray(self.origin + self._turn(travel) @ (self.C0 - self.origin))

    def by_travel(self, travel: Floats) -> Floats:
        return np.cross(self.v, self.position(travel) - self.origin)

    def by_joint(self, travel: Floats, component: int) -> Floats:
        return self._turn(travel)[:, :, component]

    def by_turn(self, travel: Floats, component: int) -> Floats:
        # A rotation of the axis rotates the arm about ``origin``. The arm at the command 0 stays, so its rotation is undone.
        rate = self.turned.rate(component)
        undone = self._turn(travel) @ np.cross(rate, self.C0 - self.origin)
        return np.asarray(np.cross(rate, self.position(travel) - self.origin) - undone)


@dataclass(frozen=True)
class JointReading:
    """A joint on a cart whose path, and where known its rotation, was measured along its guideway (eq. 4)."""

    C0: Floats
    track: MeasuredTrack
    turned: Turned

    @cached_property
    def v(self) -> Floats:
        """(3,) unit direction of the track's chord."""
        chord = self.turned.R @ (self.track.path[-1] - self.track.path[0])
        return np.asarray(chord / np.linalg.norm(chord))

    @cached_property
    def _lever(self) -> Floats:
        """(3,) from the cart's centre of rotation to the joint."""
        return np.asarray(self.C0 - self.track.origin)

    def _turn(self, travel: Floats) -> Floats:
        return exp(self.track.turn(travel) @ self.turned.R.T)

    def position(self, travel: Floats) -> Floats:
        moved = self.C0 + self.track.displacement(travel) @ self.turned.R.T
        return np.asarray(moved + self._turn(travel) @ self._lever - self._lever)

    def by_travel(self, travel: Floats) -> Floats:
        along = self.track.slope(travel) @ self.turned.R.T
        # Carts rotate by fractions of a milliradian: the derivative of the rotation vector is taken for that of the rotation.
        return np.asarray(along + np.cross(self.track.turn_slope(travel) @ self.turned.R.T, self._lever))

    def by_joint(self, travel: Floats, component: int) -> Floats:
        return self._turn(travel)[:, :, component]

    def by_turn(self, travel: Floats, component: int) -> Floats:
        rate = self.turned.rate(component)
        path = np.cross(rate, self.track.displacement(travel) @ self.turned.R.T)
        turn = self._turn(travel)
        return np.asarray(path + np.cross(rate, turn @ self._lever) - turn @ np.cross(rate, self._lever))


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
    def robot(self) -> Robot:
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
        robot, C0 = self.geometry.robot, self.C0[i]
        if rod.carrier is None:
            return TrackJoint(C0, np.zeros(3), Turned(np.eye(3), np.zeros(3)))
        actuator = robot.actuators[rod.carrier]
        turned = Turned(rotation_axes(actuator.axis), self._turns[i])
        track = self.geometry.track(i)
        if track is not None:
            return JointReading(C0, track, turned)
        if actuator.revolute:
            return ArmJoint(C0, actuator.axis, actuator.origin, turned)
        return TrackJoint(C0, actuator.axis, turned)

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
