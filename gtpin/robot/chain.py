"""The robot: its closed chain, its rods, and the names of its sites."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from gtpin.robot.assembly import Assembly, assemble
from gtpin.robot.commanded import with_actuators
from gtpin.robot.constrained_model import ConstrainedModel
from gtpin.robot.description import RobotDescription
from gtpin.robot.measured_joints import MeasuredJoint, measured_joint
from gtpin.robot.placement_frames import frame_of_anchor, shift
from gtpin.robot.rods import Rod, RodBody, rod_body, rods
from gtpin.typing import Floats


class Chain(ConstrainedModel):
    """A chain with its rods, its assembly at home and its measured joints, built from the URDF alone.

    Attributes
    ----------
    rods : tuple of Rod
        In the order of the URDF's ``<rod>`` elements; empty for a robot without rods.
    measured_joints : tuple of MeasuredJoint
        Passive joints whose coordinates are computed with each pose; none by default: see :meth:`measuring`.
    assembly : Assembly
        The assembly at home: see :func:`~gtpin.robot.assembly.assemble`.
    """

    def __init__(self, description: RobotDescription, tcp: str | None = None) -> None:
        super().__init__(description, tcp)
        self.rods: tuple[Rod, ...] = rods(self)
        self.measured_joints: tuple[MeasuredJoint, ...] = ()
        self.assembly: Assembly = assemble(self)
        self.memo: dict[str, Any] = {}
        """What the kinematics keep of this robot: see :func:`~gtpin.kinematics.kinematics.nominal`."""

    @classmethod
    def from_urdf(cls, path: str | Path, tcp: str | None = None) -> Self:
        """Build the robot of a URDF file.

        ``tcp``: name of the link that is the TCP; None: as for :class:`~gtpin.robot.constrained_model.ConstrainedModel`.
        """
        return cls(with_actuators(RobotDescription.read(Path(path)), ()), tcp)

    @property
    def rank(self) -> int:
        """Number of passive motions that the loops determine: ``n_passive`` for most robots."""
        return self.n_passive - int(self.assembly.free.shape[1])

    @property
    def home_posture(self) -> dict[str, tuple[float, ...]]:
        """Coordinates of the nominal robot's joints at home, by name, as ``posture`` of a description has them."""
        model, found = self.model, {}
        for joint in range(1, model.njoints):
            at, count = int(model.idx_qs[joint]), int(model.nqs[joint])
            own = tuple(float(x) for x in self.assembly.configuration[at : at + count])
            found[str(model.names[joint])] = (math.atan2(own[1], own[0]),) if count == 2 else own
        return found

    @property
    def home_coordinates(self) -> dict[str, float]:
        """Coordinates at home, rad or m, of the nominal robot's joints of one coordinate, by name."""
        return {name: own[0] for name, own in self.home_posture.items() if len(own) == 1}

    def rod(self, index: int) -> Rod:
        """The rod with an index: see :class:`~gtpin.robot.rods.Rod`."""
        return self.rods[index]

    def rods_on(self, actuator: int) -> tuple[int, ...]:
        """Indices of the rods whose joints are on an actuator's carrier."""
        return tuple(i for i, rod in enumerate(self.rods) if rod.carrier == actuator)

    @property
    def rod_seats(self) -> tuple[int, ...]:
        """By rod, the index of its anchor on the carrier."""
        return tuple(rod.seat for rod in self.rods)

    @cached_property
    def rod_bodies(self) -> tuple[RodBody, ...]:
        """The rods as bodies between two points, with their masses."""
        return tuple(rod_body(self, rod) for rod in self.rods)

    @cached_property
    def longer_rods(self) -> tuple[tuple[int, Floats], ...]:
        """By rod, the frame of the anchor at its end, and (6,) the twist of this frame per growth of the rod, m/m."""
        ways = ((rod.tip, self.anchor_axes[rod.tip].T @ rod.along) for rod in self.rods)
        return tuple((frame_of_anchor(self, tip), shift(way)) for tip, way in ways)

    @property
    def rod_sites(self) -> tuple[str, ...]:
        """Names of the rods' sites (``link2a``), in the order of ``rods``."""
        return tuple(rod.site for rod in self.rods)

    @property
    def joint_sites(self) -> tuple[str, ...]:
        """Sites whose joints are parts of the geometry: those of all actuators; none where rods hold the platform."""
        return () if self.rods else self.sites

    @property
    def rod_drivers(self) -> tuple[int | None, ...]:
        """By rod, the index of the actuator that moves its carrier joint or changes its length; None where none does."""
        return tuple(rod.driver for rod in self.rods)

    @property
    def rod_extensions(self) -> tuple[int | None, ...]:
        """By rod, the index of the actuator that changes its length; None where none does."""
        return tuple(rod.extension for rod in self.rods)

    @property
    def rod_loops(self) -> dict[str, tuple[str, int, Floats]]:
        """By site of a rod: its loop, which of the loop's ends is on the rod, 0 or 1, and (3,) its joint on the platform, TCP
        frame, m."""
        return {rod.site: (self.description.loops[rod.loop].name, rod.rod_end, rod.P) for rod in self.rods}

    @property
    def rod_carriers(self) -> tuple[int | None, ...]:
        """By rod, the index of the actuator that moves its carrier joint; None where this joint is fixed to the base."""
        return tuple(rod.carrier for rod in self.rods)

    @property
    def carrier_joints(self) -> Floats:
        """(n, 3) by actuator, the mean position of the joints on its carrier with all commands zero, base frame, m."""
        C = np.array([rod.C for rod in self.rods])
        carrier = np.array(self.rod_carriers)
        return np.array([C[carrier == i].mean(axis=0) for i in range(self.n_actuators)])

    def attachments(self, actuator: int) -> list[tuple[str, int]]:
        """What an actuator's carrier holds: of each of its rods, the loop's name and which of the loop's ends, 0 or 1."""
        return [(self.description.loops[r.loop].name, 1 - r.rod_end) for r in self.rods if r.carrier == actuator]

    @property
    def rod_tips(self) -> dict[str, tuple[str, int, Floats]]:
        """By site of a rod: its link, the Pinocchio joint that moves it, and (3,) its free end in that joint's frame, m."""
        ends = ((rod, *self.anchors[rod.tip]) for rod in self.rods)
        return {rod.site: (rod.link, joint, np.array(tip.translation)) for rod, joint, tip in ends}

    def rods_at(self, site: str) -> list[int]:
        """Indices of the rods of a site: the rods that an actuator moves, one rod, or all rods for ``arm``."""
        actuator = self.sites.index(site) if site in self.sites else -1
        return [
            i
            for i, rod in enumerate(self.rods)
            if site in ("arm", rod.site) or actuator in (rod.carrier, rod.extension)
        ]

    @property
    def motion_size(self) -> int:
        """Number of components of a motion: six of the TCP, then one of each measured joint."""
        return 6 + len(self.measured_joints)

    def measuring(self, joints: Iterable[str]) -> Self:
        """A copy of the robot with some measured joints: passive joints whose coordinates are computed with each pose.

        Parameters
        ----------
        joints
            Names of these joints in the URDF; a name given twice counts once. They replace the present measured joints.

        Raises
        ------
        RobotError
            For a joint that is driven, fixed, follows another, has several coordinates, or does not exist.
        """
        names = tuple(dict.fromkeys(joints))
        if names == tuple(joint.name for joint in self.measured_joints):
            return self
        other = copy.copy(self)
        other.memo = {}
        other.measured_joints = tuple(measured_joint(self, name) for name in names)
        return other

    def __reduce__(self) -> tuple[type[Chain], tuple[RobotDescription, str], tuple[str, ...]]:
        return type(self), (self.description, self.tcp_frame), tuple(joint.name for joint in self.measured_joints)

    def __setstate__(self, joints: tuple[str, ...]) -> None:
        self.measured_joints = tuple(measured_joint(self, name) for name in joints)

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {self.n_actuators} actuators, {len(self.constraints)} loops)"
