"""Carrier joints: motion of a rod's joint on its carrier with its actuator and with the geometry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from gtpin.kinematics.rotations import cross, exp, left_jacobian
from gtpin.robot.tracks import MeasuredTrack
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
