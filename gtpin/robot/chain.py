"""The robot: its closed chain, its rods, and the names of its sites."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin

from gtpin.robot.assembly import Assembly, assemble
from gtpin.robot.commanded import with_actuators
from gtpin.robot.constrained_model import ConstrainedModel
from gtpin.robot.description import RobotDescription
from gtpin.robot.measured_joints import MeasuredJoint, measured_joint
from gtpin.robot.rods import Rod, rods
from gtpin.typing import Floats


class Chain(ConstrainedModel):
    """A chain with its rods, its assembly at home and its measured joints, built from the URDF alone.

    Attributes
    ----------
    rods : tuple of Rod
        In the order of the URDF's ``<rod>`` elements; empty for a robot without rods.
    measured_joints : tuple of MeasuredJoint
        Passive joints whose coordinates are computed with each pose; none by default: see :meth:`measuring`.
    """

    def __init__(self, description: RobotDescription, tcp: str | None = None) -> None:
        super().__init__(description, tcp)
        self.rods: tuple[Rod, ...] = rods(self)
        self.measured_joints: tuple[MeasuredJoint, ...] = ()
        self._nominal: Chain | None = None
        self._assembly: Assembly | None = None

    @classmethod
    def from_urdf(cls, path: str | Path, tcp: str | None = None) -> Self:
        """Build the robot of a URDF file.

        ``tcp``: name of the link that is the TCP; None: as for :class:`~gtpin.robot.constrained_model.ConstrainedModel`.
        """
        return cls(with_actuators(RobotDescription.read(Path(path)), ()), tcp)

    @property
    def nominal(self) -> Chain:
        """The robot as its URDF describes it: itself, or the one whose joints :meth:`with_placements` displaced."""
        return self._nominal or self

    @property
    def rank(self) -> int:
        """Number of passive motions that the loops determine: ``n_passive`` for most robots."""
        return self.n_passive - int(self.assembly.free.shape[1])

    @property
    def assembly(self) -> Assembly:
        """The assembly at home of the nominal robot; displaced copies share it: see :func:`~gtpin.robot.assembly.assemble`."""
        nominal = self.nominal
        if nominal._assembly is None:
            nominal._assembly = assemble(nominal)
        return nominal._assembly

    @property
    def home_coordinates(self) -> dict[str, float]:
        """Coordinates at home, rad or m, of the nominal robot's joints of one coordinate, by name."""
        model, configuration = self.model, self.assembly.configuration
        found = {}
        for joint in range(1, model.njoints):
            if model.nvs[joint] == 1:
                at = int(model.idx_qs[joint])
                both = configuration[at : at + int(model.nqs[joint])]
                found[str(model.names[joint])] = float(both[0] if len(both) == 1 else np.arctan2(both[1], both[0]))
        return found

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
        other._nominal = self.nominal
        other.measured_joints = tuple(measured_joint(self, name) for name in names)
        return other

    def with_placements(self, twists: Floats, platform: Floats | None = None, anchors: Floats | None = None) -> Self:
        """A copy of the robot with displaced joints, TCP and loops' anchors.

        Each joint's placement is multiplied from the right by the exponential of its twist: ``twists`` is (njoints, 6),
        position (m) then rotation (rad), by Pinocchio joint. ``platform`` (6,) is the twist of the TCP on the body that
        carries it. ``anchors`` (2 L, 3) are displacements, m, of the anchors of L loops, in the frames of their links. None:
        zero.
        """
        other = copy.copy(self)
        other._nominal = self.nominal
        other.model = self.model.copy()
        if platform is not None:
            other.tcp_placement = self.tcp_placement * pin.exp6(platform)
        for joint_id in range(1, self.model.njoints):
            other.model.jointPlacements[joint_id] = self.model.jointPlacements[joint_id] * pin.exp6(twists[joint_id])
        if anchors is not None:
            placed = zip(self.anchors, self.anchor_axes, anchors, strict=True)
            other.place_anchors([(joint, pin.SE3(M.rotation, M.translation + R @ d)) for (joint, M), R, d in placed])
        other.data = other.model.createData()
        other.prepare_constraints()
        return other

    def __reduce__(self) -> tuple[type[Chain], tuple[RobotDescription, str], tuple[list[Any], tuple[str, ...]]]:
        return (
            type(self),
            (self.description, self.tcp_frame),
            (self._placed(), tuple(j.name for j in self.measured_joints)),
        )

    def __setstate__(self, state: tuple[list[Any], tuple[str, ...]]) -> None:
        # Displaced placements and measured joints are not in the URDF.
        placed, joints = state
        if placed != self._placed():
            self._nominal = type(self)(self.description, self.tcp_frame)
        count = self.model.njoints
        for joint_id, placement in enumerate(placed[:count]):
            self.model.jointPlacements[joint_id] = placement
        self.tcp_placement = placed[count]
        carriers = (joint for joint, _ in self.anchors)
        self.place_anchors(list(zip(carriers, placed[count + 1 :], strict=True)))
        self.measured_joints = tuple(measured_joint(self, name) for name in joints)

    def _placed(self) -> list[Any]:
        """Placements (``pinocchio.SE3``) of every joint, of the TCP on its body, then of the loops' anchors."""
        moved = (*self.model.jointPlacements, self.tcp_placement, *(placement for _, placement in self.anchors))
        return [pin.SE3(placement) for placement in moved]

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {self.n_actuators} actuators, {len(self.constraints)} loops)"
