"""The tree of joints of a URDF, and its forward kinematics: they share no code with the diagnosis."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt
from defusedxml.ElementTree import fromstring

from gtpin.bench.simulator.poses import VirtualPoses, cross_matrix, exp
from gtpin.errors import RobotError
from gtpin.typing import Floats, Ints

MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, eq=False)
class TreeJoint:
    """A moving joint and its body: its child link with everything that is fixed to it."""

    name: str
    link: str  # Name of its child link
    parent: int  # Index of the joint whose body carries it; -1: the base
    R: Floats  # (3, 3) rotation of its frame on that body
    p: Floats  # (3,) its position there, m
    axis: Floats  # (3,) unit vector, own frame
    slides: bool  # Whether it slides (m) instead of turning (rad)
    lower: float  # Ends of its range, rad or m; infinite where the URDF gives none
    upper: float
    follows: tuple[int, float, float] | None  # Joint i, factor a, offset b where it mimics one: x = a x_i + b
    mass: float  # Of the body, kg
    centre: Floats  # (3,) the body's centre of mass, own frame, m


@dataclass(frozen=True, eq=False)
class TreeFrame:
    """A frame on the body of a joint (index; -1: the base): rotation R (3, 3) and position p (3,), m."""

    joint: int
    R: Floats
    p: Floats


@dataclass(frozen=True, eq=False)
class Urdf:
    """The moving joints of a URDF, parents first, and the frames of its links, by name, on their bodies."""

    joints: tuple[TreeJoint, ...]
    links: dict[str, TreeFrame]


def read_urdf(xml: str, still: Collection[str] = ()) -> Urdf:
    """Read the tree of a URDF's text; joints of the types ``still`` count as fixed.

    Raises RobotError if a joint has more than one degree of freedom, or the joints are no tree.
    """
    root = fromstring(xml.encode("utf-8"))
    elements = root.findall("joint")
    inertials = {str(link.get("name")): link.find("inertial") for link in root.findall("link")}
    children = {_link(joint, "child") for joint in elements}
    bodies: list[tuple[Element, str, TreeFrame]] = []
    masses: list[tuple[float, Floats]] = []
    frames = {name: TreeFrame(-1, np.eye(3), np.zeros(3)) for name in inertials if name not in children}
    waiting = list(elements)
    while waiting:
        ready = next((joint for joint in waiting if _link(joint, "parent") in frames), None)
        if ready is None:
            raise RobotError("the joints are no tree", hint="give every link one parent that is there")
        waiting.remove(ready)
        on, kind, name = frames[_link(ready, "parent")], str(ready.get("type")), str(ready.get("name"))
        local_R, local_p = _origin(ready)
        frame = TreeFrame(on.joint, on.R @ local_R, on.p + on.R @ local_p)
        child = _link(ready, "child")
        if kind in MOVING:
            bodies.append((ready, child, frame))
            masses.append((0.0, np.zeros(3)))
            frame = TreeFrame(len(bodies) - 1, np.eye(3), np.zeros(3))
        elif kind != "fixed" and kind not in still:
            raise RobotError(f"joint {name} is {kind}", hint="the simulator moves joints that turn or slide")
        frames[child] = frame
        if frame.joint >= 0:
            inertial, (before, moment) = inertials.get(child), masses[frame.joint]
            element = None if inertial is None else inertial.find("mass")
            if inertial is not None and element is not None:
                mass = float(element.get("value", 0.0))
                centre = frame.p + frame.R @ _origin(inertial)[1]
                masses[frame.joint] = before + mass, moment + mass * centre
    names = [str(element.get("name")) for element, _, _ in bodies]
    joints = [_joint(*body, names, *mass) for body, mass in zip(bodies, masses, strict=True)]
    return Urdf(tuple(joints), frames)


def _joint(element: Element, link: str, frame: TreeFrame, names: list[str], mass: float, moment: Floats) -> TreeJoint:
    axis = _numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0))
    limit, mimic = element.find("limit"), element.find("mimic")
    lower, upper = -np.inf, np.inf
    if limit is not None and element.get("type") != "continuous":
        lower, upper = float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))
    if not lower < upper:
        lower, upper = -np.inf, np.inf
    follows = None
    if mimic is not None and mimic.get("joint") in names:
        leader = names.index(str(mimic.get("joint")))
        follows = leader, float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0))
    return TreeJoint(
        name=str(element.get("name")),
        link=link,
        parent=frame.joint,
        R=frame.R,
        p=frame.p,
        axis=axis / np.linalg.norm(axis),
        slides=element.get("type") == "prismatic",
        lower=lower,
        upper=upper,
        follows=follows,
        mass=mass,
        centre=moment / mass if mass > 0.0 else np.zeros(3),
    )


def _link(joint: Element, which: str) -> str:
    found = joint.find(which)
    return "" if found is None else str(found.get("link"))


def _numbers(element: Element | None, key: str, otherwise: tuple[float, ...]) -> Floats:
    text = None if element is None else element.get(key)
    return np.array(otherwise if text is None else [float(word) for word in text.split()])


def _origin(element: Element) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and translation (3,) of an ``<origin>``."""
    origin = element.find("origin")
    return turn(_numbers(origin, "rpy", (0.0, 0.0, 0.0))), _numbers(origin, "xyz", (0.0, 0.0, 0.0))


def turn(rpy: npt.ArrayLike) -> Floats:
    """(3, 3) rotation of the angles roll, pitch and yaw (3,), rad, about the fixed axes x, y, z in this order."""
    roll, pitch, yaw = np.asarray(rpy, dtype=float)
    return np.asarray(exp([0.0, 0.0, yaw]) @ exp([0.0, pitch, 0.0]) @ exp([roll, 0.0, 0.0]))


Displaced = TypeVar("Displaced", TreeJoint, TreeFrame)


def moved(frame: Displaced, twist: Floats) -> Displaced:
    """A joint or a frame, displaced by the exponential of a twist (6,): translation, m, then rotation vector, rad."""
    v, w = twist[:3], twist[3:]
    angle, K = float(np.linalg.norm(w)), cross_matrix(w)
    second, third = 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
    if angle > 1e-2:
        second, third = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return replace(frame, R=frame.R @ exp(w), p=frame.p + frame.R @ (v + second * K @ v + third * K @ (K @ v)))


def way_from(joints: Sequence[TreeJoint], joint: int) -> list[int]:
    """Indices of the joints from a joint to the base."""
    found = []
    while joint >= 0:
        found.append(joint)
        joint = joints[joint].parent
    return found


@dataclass(frozen=True, eq=False)
class Bending:
    """Deviations inside a tree of J joints at N poses; a field is None where there is no such deviation."""

    # (N, J, 6) shifts, m, and rotation vectors, rad: of each joint's axis, joint's frame at coordinate zero; of everything
    # that is fixed to each joint's body, about the body's end, body's frame
    axis: Floats | None = None
    tip: Floats | None = None
    ends: Floats | None = None  # (J, 3) the bodies' ends, own frames, m; None: everything is carried there

    def take(self, rows: Ints) -> Bending:
        """The deviations at some of the poses."""
        axis, tip = (None if field is None else field[rows] for field in (self.axis, self.tip))
        return Bending(axis, tip, self.ends)

    def on(self, p: Floats, R: Floats, joint: int) -> tuple[Floats, Floats]:
        """Position p (3,) and rotation R (3, 3) of a frame on a joint's body, with the bending; (N, ...) where there is one."""
        if self.tip is None or joint < 0:
            return p, R
        shift, turn = self.tip[:, joint, :3], exp(self.tip[:, joint, 3:])
        if self.ends is not None:
            shift = shift + (turn - np.eye(3)) @ (p - self.ends[joint])
        return p + shift, turn @ R


STRAIGHT = Bending()
"""No deviations."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Bodies at N poses, base frame."""

    R: Floats  # (N, J, 3, 3) rotations of the joints' frames, which move with the bodies
    p: Floats  # (N, J, 3) their positions, m
    seats: Floats  # (N, J, 3, 3) rotations of the joints' frames before the joints' own motions
    x: Floats  # (N, J) the joints' coordinates, rad or m

    def at(self, frame: TreeFrame, bending: Bending = STRAIGHT) -> VirtualPoses:
        """Poses of a frame on a body."""
        count = len(self.R)
        if frame.joint < 0:
            return VirtualPoses(np.tile(frame.p, (count, 1)), np.tile(frame.R, (count, 1, 1)))
        R, p = self.R[:, frame.joint], self.p[:, frame.joint]
        local_p, local_R = bending.on(frame.p, frame.R, frame.joint)
        way = np.einsum("nij,...j->ni" if local_p.ndim == 1 else "nij,nj->ni", R, local_p)
        return VirtualPoses(p + way, R @ local_R)


def placed(joints: tuple[TreeJoint, ...], x: Floats, bending: Bending = STRAIGHT) -> Placed:
    """The bodies of a tree at joint coordinates x (N, J), m and rad."""
    count, number = x.shape
    R, p, seats = np.empty((count, number, 3, 3)), np.empty((count, number, 3)), np.empty((count, number, 3, 3))
    base_R, base_p = np.eye(3)[None], np.zeros((1, 3))
    for j, joint in enumerate(joints):
        on_R, on_p = (base_R, base_p) if joint.parent < 0 else (R[:, joint.parent], p[:, joint.parent])
        at, turn = bending.on(joint.p, joint.R, joint.parent)
        here_R, here_p = on_R @ turn, on_p + (on_R @ np.broadcast_to(at, (count, 3))[..., None])[..., 0]
        if bending.axis is not None:
            here_p = here_p + (here_R @ bending.axis[:, j, :3, None])[..., 0]
            here_R = here_R @ exp(bending.axis[:, j, 3:])
        seats[:, j] = here_R
        motion = x[:, j, None] * joint.axis
        R[:, j] = here_R if joint.slides else here_R @ exp(motion)
        p[:, j] = here_p + (here_R @ motion[..., None])[..., 0] if joint.slides else here_p
    return Placed(R, p, seats, x)
