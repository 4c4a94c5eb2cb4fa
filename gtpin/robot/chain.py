"""The robot: its closed chain, its rods and links, the names of its sites, its passive joints and links that are measured."""

from __future__ import annotations

import copy
import difflib
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError, listed
from gtpin.robot.assembly import Assembly, assemble
from gtpin.robot.constrained_model import ConstrainedModel, joint_axis
from gtpin.robot.description import RobotDescription
from gtpin.robot.placement_frames import frame_of_anchor, frame_of_joint, frame_of_tcp, shift
from gtpin.robot.resting import coordinates, with_actuators
from gtpin.robot.rods import Rod, rods
from gtpin.typing import Floats


@dataclass(frozen=True)
class MeasuredJoint:
    """A passive joint of one coordinate that is measured.

    - ``name``: its name in the URDF.
    - ``joint_id``, ``index_q``, ``index_v``: its index among Pinocchio's joints, and its first index in a configuration and in
      a velocity.
    - ``turns``: whether its coordinate is an angle, rad, instead of a distance, m.
    - ``continuous``: whether Pinocchio keeps its coordinate as cosine and sine; then it is between -pi and pi.
    """

    name: str
    joint_id: int
    index_q: int
    index_v: int
    turns: bool
    continuous: bool

    def coordinates(self, X: Floats) -> Floats:
        """(N,) its coordinate, rad or m, in Pinocchio configurations X (N, nq)."""
        here = X[:, self.index_q]
        return np.asarray(np.arctan2(X[:, self.index_q + 1], here) if self.continuous else here.copy())


def measured_joint(robot: ConstrainedModel, name: str) -> MeasuredJoint:
    """The passive joint of a name.

    Raises `RobotError` if there is none: no such joint, or one that is driven, fixed, follows another, or has several
    coordinates.
    """
    model, known = robot.model, robot.readable
    if name in known:
        joint_id = int(model.getJointId(name))
        turns = bool(joint_axis(model, joint_id)[3:].any())
        index_q, index_v = int(model.idx_qs[joint_id]), int(model.idx_vs[joint_id])
        return MeasuredJoint(name, joint_id, index_q, index_v, turns, bool(model.nqs[joint_id] == 2))
    driven = {actuator.joint: f"q{number}" for number, actuator in enumerate(robot.actuators, 1)}
    masters = {mimic.joint: mimic.master for mimic in robot.description.tree.mimics}
    if name in driven:
        why = f"joint {name} is driven by {driven[name]}: an encoder reads a joint that nothing drives"
    elif name in masters:
        why = f"joint {name} follows {masters[name]} by <mimic>: an encoder reads a joint that only loops move"
    elif model.existJointName(name):
        why = f"joint {name} has {model.nvs[model.getJointId(name)]} coordinates: an encoder reads one"
    elif model.existFrame(name, pin.FrameType.FIXED_JOINT):
        why = f"joint {name} does not move: it is fixed, or no command and no loop moves it"
    else:
        why = f"{robot.name} has no joint {name!r}"
    can = f"joints that can be read: {listed(known)}" if known else "no joint of this robot is moved by its loops alone"
    raise RobotError(why, column="joint", hint=can)


@dataclass(frozen=True, eq=False)
class MeasuredLink:
    """A link whose rotation is measured: its name in the file, the Pinocchio joint that carries it (0: the base), and its
    rotation (3, 3) on this joint."""

    name: str
    joint_id: int
    rotation: Floats


def measured_link(robot: ConstrainedModel, name: str) -> MeasuredLink:
    """The link of a name. Raises `RobotError` if there is none; it names those with similar names."""
    if name in robot.links:
        frame = robot.link(name)
        return MeasuredLink(name, int(frame.parentJoint), np.array(frame.placement.rotation))
    close = difflib.get_close_matches(name, robot.links, n=3)
    hint = f"did you mean {' or '.join(close)}?" if close else f"links are {listed(robot.links)}"
    raise RobotError(f"{robot.name} has no link {name!r}", column="link", hint=hint)


SHORTEST = 1e-3
"""Distance of an end of a link from the link's own joint, m, below which both are one point, as in a wrist whose axes meet."""


@dataclass(frozen=True)
class MovingLink:
    """The child link of a joint, with everything fixed to it. It reaches from that joint's frame to its ends.

    ``name``: its name in the URDF. ``joint_id``: the Pinocchio joint that moves it. ``ends``: indices of what it carries, the
    tip first: placement frames of joints, the TCP, anchors of loops (:mod:`~gtpin.robot.placement_frames`).
    """

    name: str
    joint_id: int
    ends: tuple[int, ...]

    @property
    def tip(self) -> int:
        """The first end: the next joint towards the TCP, or the TCP; where it carries neither, another joint or an anchor."""
        return self.ends[0]


def moving_links(robot: Chain) -> tuple[MovingLink, ...]:
    """The links of the actuated joints, in the joints' order, and of the joints that carry the TCP and follow one of them.

    Of a robot without rods also those of the other joints of its loops, except for links without length. Links that carry
    nothing, no joint, TCP or anchor, are left out.
    """
    model, names = robot.model, dict[int, str]()
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            names.setdefault(int(frame.parentJoint), str(frame.name))
    led = [joint for number in range(len(robot.actuators)) for joint, _ in robot.carriers(number)]
    carried_by = [model.supports[joint] for joint in (robot.tcp_joint, *(joint for joint, _ in robot.anchors))]
    bearing = {int(joint) for way in carried_by for joint in way}
    others = [joint for joint in range(1, model.njoints) if robot.constraints and not robot.rods]
    others = [joint for joint in others if joint in bearing and joint not in led]
    found = []
    for joint_id in (*led, *others):
        ends = _ends(robot, joint_id, bearing)
        if joint_id in others:
            far = [end for end in ends if float(np.linalg.norm(on_link(robot, end).translation)) >= SHORTEST]
            ends = [*far, *(end for end in ends if end not in far)] if far else []
        if ends and joint_id in names:
            found.append(MovingLink(names[joint_id], joint_id, tuple(ends)))
    return tuple(found)


def _ends(robot: ConstrainedModel, joint_id: int, bearing: Collection[int]) -> list[int]:
    """Indices of the frames on a joint's link that bear the TCP or an anchor, the tip first; of another joint if none does."""
    model, way = robot.model, [int(joint) for joint in robot.model.supports[robot.tcp_joint]]
    children = sorted((j for j in range(1, model.njoints) if model.parents[j] == joint_id), key=lambda j: j not in way)
    tcp = [frame_of_tcp(robot)] if joint_id == robot.tcp_joint else []
    anchors = [frame_of_anchor(robot, a) for a, (joint, _) in enumerate(robot.anchors) if joint == joint_id]
    ends = [*tcp, *(frame_of_joint(j) for j in children if j in bearing), *anchors]
    return ends or [frame_of_joint(j) for j in children[:1]]


def on_link(robot: ConstrainedModel, end: int) -> pin.SE3:
    """Placement of a frame, by its index, on its link, relative to the link's own joint; of the nominal robot."""
    tcp = frame_of_tcp(robot)
    if end < tcp:
        return robot.model.jointPlacements[end + 1]
    if end == tcp:
        return robot.tcp_placement
    anchor = end - frame_of_anchor(robot, 0)
    return pin.SE3(robot.anchor_axes[anchor], robot.anchors[anchor][1].translation)


class Chain(ConstrainedModel):
    """A chain with its rods, its assembly at home and its measured joints, built from the URDF alone.

    Attributes
    ----------
    rods : tuple of Rod
        In the order of the URDF's ``<rod>`` elements; empty for a robot without rods.
    measured_joints : tuple of MeasuredJoint
        Passive joints whose coordinates are computed with each pose; none by default: see :meth:`measuring`.
    measured_links : tuple of MeasuredLink
        Links whose rotations are computed with each pose; none by default.
    assembly : Assembly
        The assembly at home: see :func:`~gtpin.robot.assembly.assemble`.
    """

    def __init__(self, description: RobotDescription, tcp: str | None = None) -> None:
        super().__init__(description, tcp)
        self.rods: tuple[Rod, ...] = rods(self)
        self.measured_joints: tuple[MeasuredJoint, ...] = ()
        self.measured_links: tuple[MeasuredLink, ...] = ()
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
        return coordinates(self.model, self.assembly.configuration)

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
    def rod_loops(self) -> dict[str, tuple[str, int, Floats]]:
        """By site of a rod: its loop, which of the loop's ends is on the rod, 0 or 1, and (3,) its joint on the platform, TCP
        frame, m."""
        return {rod.site: (self.description.loops[rod.loop].name, rod.rod_end, rod.P) for rod in self.rods}

    @property
    def rod_carriers(self) -> tuple[int | None, ...]:
        """By rod, the index of the actuator that moves its carrier joint; None where this joint is fixed to the base."""
        return tuple(rod.carrier for rod in self.rods)

    @property
    def up(self) -> Floats:
        """(3,) unit vector against gravity, base frame; along z where the robot has no gravity."""
        gravity = np.array(self.description.gravity, dtype=float)
        size = float(np.linalg.norm(gravity))
        return -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])

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
        own = (site in ("arm", rod.site) or actuator in (rod.carrier, rod.extension) for rod in self.rods)
        return [i for i, one in enumerate(own) if one]

    @property
    def motion_size(self) -> int:
        """Number of components of a motion: six of the TCP, three of each measured link, then one of each measured joint."""
        return 6 + 3 * len(self.measured_links) + len(self.measured_joints)

    def measuring(self, joints: Iterable[str], links: Iterable[str] = ()) -> Self:
        """A copy of the robot with some measured joints: passive joints whose coordinates are computed with each pose.

        Parameters
        ----------
        joints
            Names of these joints in the URDF; a name given twice counts once. They replace the present measured joints.
        links
            Names of links whose rotations are computed with each pose, likewise.

        Raises
        ------
        RobotError
            For a joint that is driven, fixed, follows another, has several coordinates, or does not exist; for a link that does
            not exist.
        """
        names = tuple(dict.fromkeys(joints)), tuple(dict.fromkeys(links))
        if names == self._measured:
            return self
        other = copy.copy(self)
        other.memo = {}
        other.__setstate__(names)
        return other

    @property
    def _measured(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the measured joints, and of the measured links."""
        return tuple(joint.name for joint in self.measured_joints), tuple(link.name for link in self.measured_links)

    def __reduce__(self) -> tuple[type[Chain], tuple[RobotDescription, str], tuple[tuple[str, ...], tuple[str, ...]]]:
        return type(self), (self.description, self.tcp_frame), self._measured

    def __setstate__(self, names: tuple[tuple[str, ...], tuple[str, ...]]) -> None:
        self.measured_joints = tuple(measured_joint(self, name) for name in names[0])
        self.measured_links = tuple(measured_link(self, name) for name in names[1])

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {self.n_actuators} actuators, {len(self.constraints)} loops)"
