"""A robot with deviations of its geometry and no effects: its true poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from gtpin.bench.simulator.arms.machine import ArmMachine
from gtpin.bench.simulator.arms.robot import Arm
from gtpin.bench.simulator.loops import Loops
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rods import Rods
from gtpin.bench.simulator.universal import Universal
from gtpin.errors import ModelError
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats


class TrueRobot(Protocol):
    """A robot without effects, as a simulation uses it; everything is in the base frame."""

    @property
    def geometry(self) -> Geometry:
        """Its true geometry."""

    def predict(self, q: Floats) -> Poses:
        """Poses at commands q (N, n), with the coordinates of passive joints of loops; NaN out of reach."""

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """(N, 6, n) derivative of the poses by the commands: position and rotation vector."""


def true_robot(geometry: Geometry) -> TrueRobot:
    """The robot of a geometry: with rods, an open chain, or with other loops.

    Raises
    ------
    ModelError
        If the robot has rods, but not six.
    """
    robot = geometry.robot
    if robot.rods:
        if len(robot.rods) != 6:
            raise ModelError(f"{robot.name} has {len(robot.rods)} rods", hint="six hold a platform")
        return OnRods(geometry)
    return Looped(geometry) if robot.description.loops else Open(geometry)


@dataclass(frozen=True)
class OnRods:
    """A platform on six rods; with ``read``, its poses have the angle of the first rod's universal joint."""

    geometry: Geometry
    read: bool = False

    @cached_property
    def _rods(self) -> Rods:
        return Rods(self.geometry)

    def predict(self, q: Floats) -> Poses:
        """See :class:`TrueRobot`."""
        poses = self._rods.forward(q)
        if not self.read:
            return poses
        joint, angle, there = Universal.of(self.geometry.robot, 0), np.full(len(q), np.nan), poses.reached
        angle[there] = joint.coordinate(poses[there], self._rods.ends(q[there]))
        return poses.with_joints({joint.name: angle})

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """See :class:`TrueRobot`."""
        return self._rods.command_jacobian(q, poses)


@dataclass(frozen=True)
class Open:
    """An open chain."""

    geometry: Geometry

    @cached_property
    def machine(self) -> ArmMachine:
        """The chain with its joints as in the geometry."""
        robot = Arm.of(self.geometry.robot)
        off = twists(self.geometry)
        counted = np.array([off.get(name, np.zeros(6)) for name in robot.sites])
        return ArmMachine.nominal(robot).with_twists(counted, off.get("platform", np.zeros(6)))

    def predict(self, q: Floats) -> Poses:
        """See :class:`TrueRobot`."""
        return self.machine.forward(q)

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """See :class:`TrueRobot`."""
        return self.machine.command_jacobian(q)


@dataclass(frozen=True)
class Looped:
    """A chain whose loops are not rods."""

    geometry: Geometry

    @cached_property
    def _loops(self) -> Loops:
        return Loops.of(self.geometry.robot, twists(self.geometry), anchors(self.geometry))

    def predict(self, q: Floats) -> Poses:
        """See :class:`TrueRobot`."""
        return self._loops.forward(q)

    def command_jacobian(self, q: Floats, poses: Poses) -> Floats:
        """See :class:`TrueRobot`."""
        return self._loops.command_jacobian(q)


def anchors(geometry: Geometry) -> dict[str, Floats]:
    """Displacement (3,), m, link's frame, of each point of a loop that deviates from nominal, by the names of loop and link."""
    found: dict[str, Floats] = {}
    for parameter, value in zip(geometry.parameters, geometry.deviation, strict=True):
        place, _, axis = parameter.name.rpartition(".")
        if place.startswith("anchor["):
            name = place.removeprefix("anchor[").removesuffix("]")
            found.setdefault(name, np.zeros(3))["xyz".index(axis)] = value
    return found


def twists(geometry: Geometry) -> dict[str, Floats]:
    """Twist (6,), m and rad, of each joint whose placement deviates from nominal, by its name; ``platform``: of the tool."""
    axes = ("x", "y", "z", "rx", "ry", "rz")
    found: dict[str, Floats] = {}
    for parameter, value in zip(geometry.parameters, geometry.deviation, strict=True):
        place, _, axis = parameter.name.rpartition(".")
        name = place.removeprefix("placement[").removesuffix("]")
        if axis in axes and (place == "platform" or place.startswith("placement[")):
            found.setdefault(name, np.zeros(6))[axes.index(axis)] = value
    return found
