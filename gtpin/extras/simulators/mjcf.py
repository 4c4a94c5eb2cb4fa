"""MJCF, MuJoCo's format: bodies nested as the tree, loops as ``equality/connect``, drives as position actuators."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from gtpin.export.xml_text import numbers, xml_text
from gtpin.extras.simulators.curves import SAME, Harmonic
from gtpin.extras.simulators.mechanism import (
    LIGHTEST,
    WORLD,
    Body,
    Coupling,
    Guide,
    Joint,
    Mechanism,
    Shape,
    Spring,
    shaft,
)
from gtpin.extras.simulators.read_mjcf import ADDED_MARK, PLANE_MARK, TCP_MARK
from gtpin.kinematics.rotations import to_quaternions

TIMESTEP = 5e-4
"""Time step, s."""
SPRING = 1000.0
"""Largest natural frequency of springs, rad/s, that the time step allows. Springs have a reflected inertia that limits their
frequency to this value."""
DAMPING = 5.0
"""Damping of springs over stiffness / frequency; 2 is critical damping. With more damping, this simulation comes to rest
earlier, but with 20 it is unstable."""
SMALLEST = {"boundmass": 1e-6, "boundinertia": 1e-9}
"""Mass, kg, and inertia, kg m^2, of bodies without mass, in files with moving ones, such as ends of springs."""
DRIVE = 2000.0
"""Largest natural frequency of drives, rad/s, that the time step allows. Drives have a reflected inertia that limits their
frequency to this value."""
SAG = 3e-7
"""Deflection of a drive, m, under the weight of all moving bodies and the friction of its guide."""
GRIP = 2.0
"""Friction of a guide behind a play, over the larger of two loads: the machine's weight (times its size, if the actuator is
revolute), and the largest load of the model's fit."""
_SPECK = pin.Inertia(LIGHTEST, np.zeros(3), LIGHTEST * np.eye(3))
"""Inertia of a link without mass between two joints: MuJoCo takes none without."""


def to_mjcf(mechanism: Mechanism, plain: Mechanism) -> str:
    """MJCF of a mechanism: at rest with ``ctrl`` = q, its platform has the pose of the mechanism at q.

    Initial configuration and keyframe ``home`` are the robot's home. Coordinates, ranges and commands are those of the URDF;
    shapes don't collide. Drives deflect by less than 1 um under the machine's weight. Drives and springs have damping and
    reflected inertia that keep the simulation stable at its time step. So its static poses are those of the machine, but its
    vibrations are not. Joints that are not in ``plain``, the mechanism without effects, are marked.

    Pinocchio reads the file too: it takes only the first body of the world, so all others are on this one, also a platform
    that floats.
    """
    root = Element("mujoco", model=mechanism.name)
    robot = _joint_names(plain)
    cranked = _with_single_joints(with_cranks(mechanism), robot)
    massless = any((body.joints or body.free) and body.inertia.mass == 0.0 for body in cranked.bodies)
    bounds = {key: numbers(value) for key, value in SMALLEST.items()} if massless else {}
    SubElement(root, "compiler", {"angle": "radian", "autolimits": "true", "balanceinertia": "true"} | bounds)
    SubElement(
        root,
        "option",
        timestep=numbers(TIMESTEP),
        integrator="implicitfast",
        tolerance="1e-14",
        iterations="200",
        gravity=numbers(*mechanism.gravity),
    )
    default = SubElement(root, "default")
    SubElement(default, "geom", contype="0", conaffinity="0", mass="0", group="1")
    # Stiff loops: at rest, their two points are less than 1 nm apart under the machine's weight.
    SubElement(default, "equality", STIFF)
    elements = {WORLD: SubElement(root, "worldbody")}
    for body in cranked.bodies:
        elements[body.name] = _body(elements[body.parent], body)
    equality = SubElement(root, "equality")
    for name, (one, other) in mechanism.loops.items():
        # MuJoCo computes the second body's anchor from the initial configuration. This is home, where the loops are closed.
        attributes = {"name": name, "body1": _free(one.body), "body2": _free(other.body), "anchor": numbers(*one.point)}
        SubElement(equality, "connect", attributes)
    marks = SubElement(root, "custom")
    SubElement(marks, "text", name=TCP_MARK, data=_free(mechanism.tcp))
    driven = {drive.site: drive.joint for drive in plain.drives}
    stands = {drive.joint: driven[drive.site] for drive in mechanism.drives}
    for name in _joint_names(cranked):
        if name not in robot:
            SubElement(marks, "text", name=f"{ADDED_MARK}{name}", data=stands.get(name, name))
    for name, normals in mechanism.planes.items():
        SubElement(marks, "numeric", name=f"{PLANE_MARK}{name}", data=numbers(*normals.ravel()))
    tendons = SubElement(root, "tendon")
    add_guides(tendons, mechanism)
    add_actuators(root, mechanism)
    add_couplings(root, tendons, cranked)
    add_plays(root, tendons, cranked)
    ctrl = numbers(*(drive.home / drive.scale for drive in cranked.drives))
    SubElement(SubElement(root, "keyframe"), "key", name="home", qpos=numbers(*_qpos(cranked)), ctrl=ctrl)
    return xml_text(root)


def _joint_names(mechanism: Mechanism) -> list[str]:
    return [joint.name for body in mechanism.bodies for joint in body.joints]


def _with_single_joints(mechanism: Mechanism, robot: Collection[str]) -> Mechanism:
    """A mechanism in which each of the joints ``robot`` is the last one of a body; links without mass are bodies again.

    Of several joints of a body, Pinocchio 4.1 ignores the ``ref`` of the first, which is then one of an effect, with 0.
    """
    bodies = []
    for body in mechanism.bodies:
        groups: list[list[Joint]] = [[]]
        for joint in body.joints:
            groups[-1].append(joint)
            if joint.name in robot:
                groups.append([])
        if len(groups) > 1:  # what follows the last one moves along or about its axis: their order does not matter
            last = groups.pop()
            groups[-1][-1:-1] = last
        parent, placement = body.parent, body.placement
        for group in groups[:-1]:
            between = Body(group[-1].link, parent, placement, tuple(group), _SPECK)
            bodies.append(between)
            parent, placement = between.name, pin.SE3.Identity()
        bodies.append(replace(body, parent=parent, placement=placement, joints=tuple(groups[-1])))
    return replace(mechanism, bodies=tuple(bodies))


def _body(parent: Element, body: Body) -> Element:
    element = SubElement(parent, "body", {"name": _free(body.name)} | _pose(body.placement))
    if body.free is not None:
        # MuJoCo takes a <freejoint> on the world only. These have the same velocities; their coordinates count from home.
        for name, axis in zip("xyz", body.placement.rotation, strict=True):
            SubElement(element, "joint", name=f"{body.free}_{name}", type="slide", axis=numbers(*axis))
        SubElement(element, "joint", name=body.free, type="ball")
    for joint in body.joints:
        element.append(_joint(joint))
    if body.inertia.mass > 0.0:
        i = body.inertia.inertia
        full = (i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2])
        SubElement(
            element,
            "inertial",
            pos=numbers(*body.inertia.lever),
            mass=numbers(body.inertia.mass),
            fullinertia=numbers(*full),
        )
    for shape in body.shapes:
        SubElement(element, "geom", _geom(shape))
    for name, placement in body.frames.items():
        SubElement(element, "body", {"name": _free(name)} | _pose(placement))
    return element


def _free(name: str) -> str:
    """A body's name in the file. The name ``world`` is replaced: MuJoCo reserves it."""
    return "world_link" if name == "world" else name


def _joint(joint: Joint) -> Element:
    element = Element(
        "joint",
        name=joint.name,
        type=joint.kind,
        axis=numbers(*joint.axis),
        pos=numbers(*joint.point),
        ref=numbers(joint.home),
    )
    if np.isfinite([joint.lower, joint.upper]).all():
        element.set("range", numbers(joint.lower, joint.upper))
    if joint.play:
        element.set("solreflimit", STIFF["solref"])
        element.set("solimplimit", STIFF["solimp"])
    if joint.spring is not None:
        element.set("springref", numbers(joint.spring.rest))
        element.set("stiffness", numbers(joint.spring.stiffness))
        element.set("damping", numbers(DAMPING * joint.spring.stiffness / SPRING))
        element.set("armature", numbers(joint.spring.stiffness / SPRING**2))
    return element


def _qpos(mechanism: Mechanism) -> list[float]:
    """MuJoCo's configuration at home: joints in the order of the bodies, depth first."""
    children: dict[str, list[Body]] = {}
    for body in mechanism.bodies:
        children.setdefault(body.parent, []).append(body)

    def coordinates(body: Body) -> list[float]:
        own = [joint.home for joint in body.joints]
        if body.free is not None:
            own = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        return [*own, *(x for child in children.get(body.name, []) for x in coordinates(child))]

    return [float(x) for body in children[WORLD] for x in coordinates(body)]


def _pose(placement: Any) -> dict[str, str]:
    quaternion = to_quaternions(np.asarray(placement.rotation)[None])[0]
    return {"pos": numbers(*placement.translation), "quat": numbers(*quaternion)}


def _geom(shape: Shape) -> dict[str, str]:
    size = shape.size if shape.kind == "sphere" else tuple(s / 2.0 for s in shape.size)
    if shape.kind == "cylinder":
        size = (shape.size[0], shape.size[1] / 2.0)
    return {"type": shape.kind, "size": numbers(*size), "rgba": numbers(*shape.rgba), **_pose(shape.placement)}


def add_guides(tendons: Element, mechanism: Mechanism) -> None:
    """Write the friction of the guides behind plays, as tendons over the joints whose sum of coordinates it holds."""
    joints = {joint.name: joint for body in mechanism.bodies for joint in body.joints}
    for guide in mechanism.guides:
        friction = {"frictionloss": numbers(_friction(mechanism, guide, joints[guide.joints[0]]))}
        stiff = {"solreffriction": STIFF["solref"], "solimpfriction": STIFF["solimp"]}
        tendon = SubElement(tendons, "fixed", {"name": f"{guide.joints[-1]}_guide"} | friction | stiff)
        for name in guide.joints:
            SubElement(tendon, "joint", joint=name, coef="-1" if guide.ahead and name == guide.joints[-1] else "1")


def _friction(mechanism: Mechanism, guide: Guide, joint: Joint) -> float:
    """Friction of a guide: force, N, or moment, N m."""
    return max(GRIP * _weight(mechanism) * _reach(mechanism, joint), GRIP * guide.load)


def _weight(mechanism: Mechanism) -> float:
    """Weight of all moving bodies, N."""
    mass = sum(body.inertia.mass for body in mechanism.bodies)
    return max(float(mass * np.linalg.norm(mechanism.gravity)), 1.0)


def _reach(mechanism: Mechanism, joint: Joint) -> float:
    """Motion of the machine per unit of a joint's coordinate: 1 for a slide; the machine's size, m per rad, for a hinge."""
    return 1.0 if joint.kind == "slide" else mechanism.reach


def add_actuators(root: Element, mechanism: Mechanism) -> None:
    """A position actuator for each drive."""
    actuators = SubElement(root, "actuator")
    joints = {joint.name: joint for body in mechanism.bodies for joint in body.joints}
    elements = {str(element.get("name")): element for element in root.iter("joint") if element.get("name")}
    follower = {coupling.other: coupling.joint for coupling in mechanism.couplings if coupling.other.endswith("_motor")}
    for coupling in mechanism.couplings:
        # Joints that follow a motor, and joints with play, need a reflected inertia too: MuJoCo's constraints get stiffer with
        # it.
        stiffness = _weight(mechanism) * _reach(mechanism, joints[coupling.joint]) ** 2 / SAG
        elements[coupling.joint].set("armature", numbers(stiffness / DRIVE**2))
    for drive in mechanism.drives:
        moved = follower.get(drive.joint, drive.joint)
        reach = _reach(mechanism, joints[moved])
        guides = [guide for guide in mechanism.guides if guide.site == drive.site]
        friction = sum(_friction(mechanism, guide, joints[moved]) for guide in guides)
        spring = Spring((_weight(mechanism) * reach + friction) * reach / SAG)
        for name in {drive.joint, moved, *(name for guide in guides for name in guide.joints)}:
            elements[name].set("armature", numbers(spring.stiffness / DRIVE**2))
        # MuJoCo's gear is the inverse of the travel per command; it also scales the force of the drive.
        attributes = {
            "name": drive.site,
            "joint": drive.joint,
            "kp": numbers(spring.stiffness),
            "kv": numbers(2.0 * spring.stiffness / DRIVE),
            "gear": numbers(1.0 / drive.scale),
        }
        if np.isfinite([drive.lower, drive.upper]).all():
            attributes["ctrlrange"] = numbers(drive.lower, drive.upper)
        SubElement(actuators, "position", attributes)


ROD, RADIUS = 1.0, 1e-3
"""Distance, m, from a crank's axis to the far end of its tendon, and to its pin. RADIUS / (2 ROD) is the relative error of a
cosine. MuJoCo treats a pin within 1e-6 m of the axis as a pin on the axis."""
LIGHT, FIRM = 1e-3, 0.03
"""Inertia of a crank, as seen by the joint that turns it, over the reflected inertia of that joint: of most cranks, and of
those that limit a play."""
STIFF = {"solref": "0.001 1", "solimp": "0.9999 0.9999 0.001"}
"""Constraints as stiff as the time step allows."""
SELF = Harmonic(1.0, -np.pi / 2.0, 1.0)
"""A small coordinate x as a harmonic of itself: cos(x - pi / 2) = sin(x), about x."""


def with_cranks(mechanism: Mechanism) -> Mechanism:
    """A mechanism with cranks for the harmonics of its couplings and plays: massless bodies that turn with a joint.

    Couplings and plays that follow the same joint with the same rate share a crank.
    """
    bodies, couplings = [], []
    for (other, rate), name in _cranks(mechanism).items():
        joint = Joint(name, "hinge", np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0)
        bodies.append(shaft(mechanism.bodies[0], joint))
        couplings.append(Coupling(name, other, SAME.times(rate)))
    return replace(mechanism, bodies=(*mechanism.bodies, *bodies), couplings=(*mechanism.couplings, *couplings))


def _cranks(mechanism: Mechanism) -> Mapping[tuple[str, float], str]:
    """Names of the cranks, by the joint that turns them and their rotation per unit of its coordinate, rad per m or rad."""
    turned = [(c.other, h.rate) for c in mechanism.couplings for h in c.curve.harmonics]
    for play in mechanism.plays:
        turned += [*((play.other, h.rate) for h in play.half.harmonics), (play.joint, SELF.rate)]
    found: dict[tuple[str, float], str] = {}
    for other, rate in dict.fromkeys(turned):
        found[other, rate] = f"{other}_crank_{sum(name == other for name, _ in found) + 1}"
    return found


def add_couplings(root: Element, tendons: Element, mechanism: Mechanism) -> None:
    """Write the couplings as equality constraints: between joints if their curve is a line, else between two tendons.

    The length of one tendon is a constant less the sum of the harmonics (:func:`_rod`). The length of the other is the
    following joint's coordinate less the part that is proportional to the other joint's.
    """
    equality = root.find("equality")
    assert equality is not None
    joints = {str(element.get("name")): element for element in root.iter("joint")}
    for (other, rate), name in _cranks(mechanism).items():
        light = FIRM if rate == SELF.rate else LIGHT
        joints[name].set("armature", numbers(light * float(joints[other].get("armature", "0")) / rate**2))
    for coupling in mechanism.couplings:
        curve = coupling.curve
        if not curve.harmonics:
            polynomial = numbers(curve.offset, curve.proportion, 0.0, 0.0, 0.0)
            attributes = {"joint1": coupling.joint, "joint2": coupling.other, "polycoef": polynomial}
            SubElement(equality, "joint", {"name": f"{coupling.joint}_follows"} | attributes)
            continue
        own = SubElement(tendons, "fixed", name=f"{coupling.joint}_bends")
        SubElement(own, "joint", joint=coupling.joint, coef="1")
        SubElement(own, "joint", joint=coupling.other, coef=numbers(-curve.proportion))
        _rod(root, tendons, mechanism, f"{coupling.joint}_waves", [(coupling.other, h) for h in curve.harmonics])
        # The constraint counts tendon lengths from their values at home. The harmonics are not zero there: add their sum.
        start = curve.offset + sum(h.amplitude * np.cos(h.phase) for h in curve.harmonics)
        attributes = {"tendon1": f"{coupling.joint}_bends", "tendon2": f"{coupling.joint}_waves"}
        follows = numbers(start, -1.0, 0.0, 0.0, 0.0)
        SubElement(equality, "tendon", {"name": f"{coupling.joint}_follows", "polycoef": follows} | attributes)


def add_plays(root: Element, tendons: Element, mechanism: Mechanism) -> None:
    """Write the limits of plays that vary as limits of tendons: half the play minus, and plus, the joint's coordinate >= 0."""
    for play in mechanism.plays:
        for side, sign in (("ahead", -1.0), ("behind", 1.0)):
            parts = [(play.other, h) for h in play.half.harmonics]
            parts.append((play.joint, replace(SELF, amplitude=sign * SELF.amplitude)))
            rod = _rod(root, tendons, mechanism, f"{play.joint}_{side}", parts)
            length = sum(abs(h.amplitude) for _, h in parts) * ROD / RADIUS
            # At x = 0, the pin of SELF is not on the rod's line, but at a right angle to it.
            length += SELF.amplitude * (np.hypot(ROD, RADIUS) - ROD) / RADIUS
            rod.set("range", numbers(0.0, length + play.half.offset))
            rod.set("solreflimit", STIFF["solref"])
            rod.set("solimplimit", STIFF["solimp"])


def _rod(
    root: Element, tendons: Element, mechanism: Mechanism, name: str, parts: Sequence[tuple[str, Harmonic]]
) -> Element:
    """Add a tendon from the pins of cranks to a point far away, with a pulley for each harmonic that sets its amplitude.

    ``parts``: the harmonics, each with the joint whose coordinate it depends on. The tendon's length is a constant less their
    sum.
    """
    cranks, far = _cranks(mechanism), _far(root)
    rod = SubElement(tendons, "spatial", name=name, width="0.001", rgba="0 0 0 0")
    for k, (other, harmonic) in enumerate(parts):
        body = next(e for e in root.iter("body") if e.get("name") == cranks[other, harmonic.rate])
        place = np.array([np.cos(harmonic.phase), np.sin(harmonic.phase), 0.0])
        place = np.copysign(RADIUS, harmonic.amplitude) * place
        SubElement(body, "site", name=f"{name}_{k + 1}", pos=numbers(*place), size="0.001", group="5")
        SubElement(rod, "pulley", divisor=numbers(RADIUS / abs(harmonic.amplitude)))
        SubElement(rod, "site", site=f"{name}_{k + 1}")
        SubElement(rod, "site", site=far)
    return rod


def _far(root: Element) -> str:
    """Name of the point on the base at which the tendons of all cranks end; added if there is none yet."""
    name, base = "cranks_end", root.find("worldbody/body")
    assert base is not None
    if not any(site.get("name") == name for site in base.findall("site")):
        SubElement(base, "site", name=name, pos=numbers(ROD, 0.0, 0.0), size="0.001", group="5")
    return name
