"""A robot as physics engines describe it: bodies with their joints, and loops that join points of two bodies; all at home."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, Literal
from xml.etree.ElementTree import tostring

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError, warn
from gtpin.extras.simulators.curves import SAME, DriveCurve
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.robot.chain import Chain
from gtpin.robot.description import parse_xml
from gtpin.robot.resting import joint_jacobian
from gtpin.typing import Floats

SIMPLE = ("box", "cylinder", "sphere")
WORLD = ""
"""Name of the body that does not move; the robot's root link is fixed to it."""
LIGHTEST = 1e-12
"""Mass, kg, up to which a body counts as massless. MJCF that gtpin writes has such bodies between two joints."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A box (sides), a cylinder along z (radius and length) or a sphere (radius), m, with its colour.

    ``placement`` is its ``pinocchio.SE3`` in its body's frame.
    """

    kind: str
    size: tuple[float, ...]
    placement: Any
    rgba: tuple[float, ...]


def shapes_of(robot: Chain) -> dict[int, tuple[Shape, ...]]:
    """Shapes by the Pinocchio joint that carries them. Meshes are left out, with a warning."""
    description = robot.description
    root = parse_xml(description.xml, description.source)
    meshes = 0
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            if all(visual.find(f"geometry/{kind}") is None for kind in SIMPLE):
                link.remove(visual)
                meshes += 1
        for collision in link.findall("collision"):
            link.remove(collision)
    if meshes:
        warn(f"{meshes} mesh{'es' if meshes > 1 else ''} of {robot.name} left out")
    found: dict[int, tuple[Shape, ...]] = {}
    geometry = pin.buildGeomFromUrdfString(robot.model, tostring(root, encoding="unicode"), pin.GeometryType.VISUAL)
    for item in geometry.geometryObjects:
        solid, kind = item.geometry, type(item.geometry).__name__.lower()
        if kind == "box":
            size = tuple(2.0 * float(s) for s in solid.halfSide)
        else:
            size = (float(solid.radius), *([2.0 * float(solid.halfLength)] if kind == "cylinder" else []))
        shape = Shape(kind, size, item.placement, tuple(round(float(c), 6) for c in item.meshColor))
        found[item.parentJoint] = (*found.get(item.parentJoint, ()), shape)
    return found


@dataclass(frozen=True)
class Spring:
    """A spring along or about a joint: force = stiffness (rest - coordinate); stiffness in N/m or N m/rad, rest in m or rad.

    For a revolute joint, "force" is a moment, N m.
    """

    stiffness: float
    rest: float = 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """A motion of one degree of freedom of a body relative to its parent. Of several, the first is the one next to the parent.

    - ``name``, ``kind``: its name, as in the URDF, and whether it is prismatic (``slide``) or revolute (``hinge``).
    - ``axis``, ``point``: (3,) unit vector along its axis, and a point on the axis, m; at home, in the body's frame.
    - ``home``: its coordinate at home, m or rad.
    - ``lower``, ``upper``: its range, m or rad; infinite where it has no limits.
    - ``spring``: its spring; None if it moves freely or is driven.
    - ``play``: whether it is the play of a drive, and its range is this play.
    - ``link``: the link that it carries in the URDF; empty for a joint of an effect.
    """

    name: str
    kind: Literal["slide", "hinge"]
    axis: Floats
    point: Floats
    home: float
    lower: float = -np.inf
    upper: float = np.inf
    spring: Spring | None = None
    play: bool = False
    link: str = ""


@dataclass(frozen=True, eq=False)
class Coupling:
    """A joint that follows another: its coordinate less its home, m or rad, is a curve of the other's coordinate less its
    home."""

    joint: str
    other: str
    curve: DriveCurve


@dataclass(frozen=True, eq=False)
class Play:
    """A play that varies: ``joint`` moves freely from -half to +half, m or rad.

    ``half`` is a curve of the coordinate of the joint ``other``, less its home.
    """

    joint: str
    other: str
    half: DriveCurve


@dataclass(frozen=True, eq=False)
class Guide:
    """Friction of the part that an actuator moves in its guide: it keeps the sum of the coordinates of ``joints`` constant.

    ``load``: the largest load, N or N m, at which it does so. ``ahead``: the last joint's coordinate is subtracted and not
    added, so that it moves in the direction of the others: a drive that overshoots.
    """

    site: str
    joints: tuple[str, ...]
    load: float
    ahead: bool = False


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body.

    - ``name``, ``parent``: link names.
    - ``placement``: ``pinocchio.SE3`` of the body in its parent's frame at home.
    - ``joints``: its joints relative to its parent; empty for a body that floats.
    - ``inertia``: ``pinocchio.Inertia`` in the body's frame.
    - ``free``: name of its floating joint (six degrees of freedom); None if it does not float.
    - ``shapes``: its shapes, for drawings.
    - ``frames``: links that are fixed to it, by name: their ``pinocchio.SE3`` in its frame.
    """

    name: str
    parent: str
    placement: Any
    joints: tuple[Joint, ...]
    inertia: Any
    free: str | None = None
    shapes: tuple[Shape, ...] = ()
    frames: Mapping[str, Any] = field(default_factory=dict)


def shaft(base: Body, joint: Joint) -> Body:
    """A massless body on the base, with the name of its one joint, that is not a part of the robot."""
    return Body(joint.name, base.name, pin.SE3.Identity(), (joint,), pin.Inertia.Zero())


@dataclass(frozen=True, eq=False)
class End:
    """A point (3,) of a body, in its frame, m."""

    body: str
    point: Floats


@dataclass(frozen=True, eq=False)
class Drive:
    """An actuator: its site and its joint; the range of its commands, m or rad; its joint's coordinate at home, m or rad; and
    ``scale``, its travel per command."""

    site: str
    joint: str
    lower: float
    upper: float
    home: float
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Bodies, parents before children; loops by name, each two coincident points; drives; gravity, m/s^2; size ``reach``, m.

    ``tcp``: name of the body, or of the link on a body, that is the TCP. ``planes``: by loop, the directions (k, 3) in which it
    is left open, in the frame of the body of its first end: a planar loop's normal. ``couplings``: joints that follow others.
    ``guides``: friction. ``plays``: joints whose play varies.
    """

    name: str
    bodies: tuple[Body, ...]
    loops: Mapping[str, tuple[End, End]]
    drives: tuple[Drive, ...]
    gravity: tuple[float, ...]
    reach: float
    tcp: str
    planes: Mapping[str, Floats] = field(default_factory=dict)
    couplings: tuple[Coupling, ...] = ()
    guides: tuple[Guide, ...] = ()
    plays: tuple[Play, ...] = ()

    def body(self, name: str) -> Body:
        """The body with this name."""
        return next(body for body in self.bodies if body.name == name)

    def placements(self) -> dict[str, Any]:
        """``pinocchio.SE3`` of each body at home, base frame."""
        found: dict[str, Any] = {WORLD: pin.SE3.Identity()}
        for body in self.bodies:
            found[body.name] = found[body.parent] * body.placement
        return found

    def joint(self, name: str) -> Joint:
        """The joint with this name."""
        return next(joint for body in self.bodies for joint in body.joints if joint.name == name)

    def with_joints(self, name: str, joints: Sequence[Joint]) -> Mechanism:
        """The mechanism with ``joints`` in place of the joint ``name``."""

        def changed(body: Body) -> Body:
            own = ((*joints,) if joint.name == name else (joint,) for joint in body.joints)
            return replace(body, joints=tuple(chain.from_iterable(own)))

        return replace(self, bodies=tuple(changed(body) for body in self.bodies))

    def with_couplings(self, couplings: Sequence[Coupling]) -> Mechanism:
        """The mechanism with more couplings."""
        return replace(self, couplings=(*self.couplings, *couplings))

    def carrying(self, joint: str) -> Body:
        """The body that a joint moves."""
        return next(body for body in self.bodies if joint in {own.name for own in body.joints})

    def on_springs(self, name: str, ends: Sequence[tuple[str, int]], joints: Sequence[Joint]) -> Mechanism:
        """The mechanism with a new massless body, with ``joints``, between a body and the ends of loops on it.

        ``ends``: the loops' names, each with 0 or 1 for its end; all are on one body, and move to the new one. The new body
        ``name`` has its origin at the mean of these ends, and the axes of the old body.
        """
        old = {self.loops[loop][side].body for loop, side in ends}.pop()
        middle = np.mean([self.loops[loop][side].point for loop, side in ends], axis=0)
        body = Body(name, old, pin.SE3(np.eye(3), middle), tuple(joints), pin.Inertia.Zero())
        loops = dict(self.loops)
        for loop, side in ends:
            moved = End(name, loops[loop][side].point - middle)
            loops[loop] = (moved, loops[loop][1]) if side == 0 else (loops[loop][0], moved)
        return replace(self, bodies=(*self.bodies, body), loops=loops)


def mechanism(robot: Chain) -> Mechanism:
    """The mechanism of a robot, at its home.

    A link without mass between two joints becomes a second joint of the link that it carries.

    Raises `RobotError` if a joint is neither prismatic nor revolute, nor floats on the base.
    """
    posture = home(robot)
    model, data = robot.model, posture.data
    merged = _massless(robot)
    frames = _fixed_links(robot)
    shapes = shapes_of(robot)
    bodies = []
    kept = {0: WORLD}
    for i in range(1, model.njoints):
        if i in merged:
            continue
        merged_joints, parent = [i], int(model.parents[i])
        while parent in merged:
            merged_joints.insert(0, parent)
            parent = int(model.parents[parent])
        kept[i] = frames[i][0][0]
        free = model.nvs[i] == 6
        if free and parent != 0:
            raise RobotError(f"{model.names[i]} floats on a moving link", hint="let it float on the root link")
        bodies.append(
            Body(
                name=kept[i],
                parent=kept[parent],
                placement=data.oMi[parent].inverse() * data.oMi[i],
                joints=() if free else tuple(_joint(robot, posture, j, i, frames[j][0][0]) for j in merged_joints),
                inertia=model.inertias[i],
                free=str(model.names[i]) if free else None,
                shapes=shapes.get(i, ()),
                frames=dict(frames[i][1:]),
            )
        )
    shown, fixed = shapes.get(0, ()), dict(frames[0][1:])
    base = Body(frames[0][0][0], WORLD, pin.SE3.Identity(), (), model.inertias[0], None, shown, fixed)
    rooted = tuple(replace(b, parent=base.name) if b.parent == WORLD else b for b in bodies)
    kept[0] = base.name
    loops = {
        loop.name: (
            End(kept[constraint.joint1_id], constraint.joint1_placement.translation.copy()),
            End(kept[constraint.joint2_id], constraint.joint2_placement.translation.copy()),
        )
        for loop, constraint in zip(robot.description.loops, robot.constraints, strict=True)
    }
    drives = tuple(
        Drive(a.site, a.joint, a.lower, a.upper, float(q)) for a, q in zip(robot.actuators, posture.q, strict=True)
    )
    gravity = robot.description.gravity
    names = {int(model.idx_vs[j]): str(model.names[j]) for j in range(1, model.njoints)}
    mimics = tuple(Coupling(names[f.index_v], names[f.master_v], SAME.times(f.multiplier)) for f in robot.followers)
    closing = zip(robot.description.loops, robot.constraints, robot.planes, strict=True)
    planes = {loop.name: n @ c.joint1_placement.rotation.T for loop, c, n in closing if len(n)}
    return Mechanism(robot.name, (base, *rooted), loops, drives, gravity, robot.size, robot.tcp_frame, planes, mimics)


def _massless(robot: Chain) -> set[int]:
    """Joints whose bodies have no mass, carry one other joint, and have no loop, no TCP and no second link."""
    model = robot.model
    children = [sum(parent == i for parent in model.parents) for i in range(model.njoints)]
    needed = {c.joint1_id for c in robot.constraints} | {c.joint2_id for c in robot.constraints} | {robot.tcp_joint}
    links = _fixed_links(robot)
    return {
        i
        for i in range(1, model.njoints)
        if model.inertias[i].mass <= LIGHTEST and children[i] == 1 and i not in needed and len(links[i]) == 1
        if model.nvs[i] == 1
    }


def _fixed_links(robot: Chain) -> dict[int, list[tuple[str, Any]]]:
    """By joint, the links on it: its own first, then those fixed to it, with their placements on it."""
    found: dict[int, list[tuple[str, Any]]] = {i: [] for i in range(robot.model.njoints)}
    for frame in robot.model.frames:
        if frame.type == pin.FrameType.BODY:
            found[frame.parentJoint].append((frame.name, frame.placement))
    return found


def _joint(robot: Chain, posture: ClosedPosture, joint: int, body: int, link: str) -> Joint:
    model, data = robot.model, posture.data
    name = str(model.names[joint])
    if model.nvs[joint] != 1:
        raise RobotError(
            f"{name} has {model.nvs[joint]} degrees of freedom", hint="prismatic and revolute joints export"
        )
    column = joint_jacobian(model, data, joint)[:, model.idx_vs[joint]]
    slides = bool(np.linalg.norm(column[:3]) > 0.5)
    index = model.idx_qs[joint]
    endless = model.nqs[joint] == 2
    here = posture.configuration[index : index + model.nqs[joint]]
    place = data.oMi[body]
    lower, upper = (-np.inf, np.inf) if endless else (model.lowerPositionLimit[index], model.upperPositionLimit[index])
    driven = [q for q, a in zip(posture.q, robot.actuators, strict=True) if a.joint_id == joint]
    turn = float(np.arctan2(here[1], here[0])) if endless else float(here[0])
    return Joint(
        name,
        "slide" if slides else "hinge",
        place.rotation.T @ (column[:3] if slides else column[3:]),
        place.actInv(data.oMi[joint].translation),
        float(driven[0]) if driven else turn,
        float(lower) if lower < upper else -np.inf,
        float(upper) if lower < upper else np.inf,
        link=link,
    )
