"""MJCF, MuJoCo's format: bodies nested as the tree, loops as ``equality/connect``, drives as position actuators."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import numpy.typing as npt

from gtpin.export.mechanism import WORLD, Body, Guide, Joint, Mechanism, Spring
from gtpin.export.shapes import Shape
from gtpin.export.text import numbers, xml_text
from gtpin.kinematics.rotations import to_quaternions

Floats = npt.NDArray[np.float64]

TIMESTEP = 5e-4
"""s."""
DRIVE, SPRING = 2000.0, 1000.0
"""Natural frequency of drives and springs, rad/s, which the time step allows; reflected inertia brings it down to this."""
DAMPING = 5.0
"""Of springs, in stiffness over frequency (2 is critical): more would bring the platform to rest sooner, 20 is not stable."""
SAG = 3e-7
"""m by which a drive gives way under the weight of everything that moves."""
GRIP = 2.0
"""Friction of a guide beyond a play, over the machine's weight (times its reach, where the actuator turns), and over the
largest load of the fit."""
STIFF = {"solref": "0.001 1", "solimp": "0.9999 0.9999 0.001"}
"""As stiff as the time step allows."""
SMALLEST = {"boundmass": 1e-6, "boundinertia": 1e-9}
"""kg and kg m^2 for bodies without any: massless ends of springs."""


def to_mjcf(mechanism: Mechanism) -> str:
    """MJCF of a mechanism: at rest with ``ctrl`` = q, its platform is where the mechanism puts it.

    Initial configuration and keyframe ``home`` are the robot's home. Coordinates, ranges and commands are the URDF's; shapes
    don't collide. Drives give way by less than a micrometre under the machine's weight; drives and springs are damped, and
    have the reflected inertia that keeps them stable at the time step: rest is right, vibrations are not the machine's.
    """
    root = Element("mujoco", model=mechanism.name)
    bounds = {key: numbers(value) for key, value in SMALLEST.items()}
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
    # Stiff loops: at rest they open by less than a nanometre under the machine's weight.
    SubElement(default, "equality", STIFF)
    elements = {WORLD: SubElement(root, "worldbody")}
    for body in mechanism.bodies:
        elements[body.name] = _body(elements[body.parent], body)
    equality = SubElement(root, "equality")
    for name, (one, other) in mechanism.loops.items():
        # MuJoCo takes the other body's anchor from the initial configuration, which is home, where the loops are closed.
        attributes = {"name": name, "body1": _free(one.body), "body2": _free(other.body), "anchor": numbers(*one.point)}
        SubElement(equality, "connect", attributes)
    for coupling in mechanism.couplings:
        attributes = {"joint1": coupling.joint, "joint2": coupling.other, "polycoef": numbers(*coupling.polynomial)}
        SubElement(equality, "joint", {"name": f"{coupling.joint}_follows"} | attributes)
    _guides(root, mechanism)
    _actuators(root, mechanism)
    return xml_text(root)


def _body(parent: Element, body: Body) -> Element:
    element = SubElement(parent, "body", {"name": _free(body.name)} | _pose(body.placement))
    if body.free is not None:
        SubElement(element, "freejoint", name=body.free)
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
    """A body's name; ``world`` is MuJoCo's own."""
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


def _guides(root: Element, mechanism: Mechanism) -> None:
    if not mechanism.guides:
        return
    tendons = SubElement(root, "tendon")
    joints = {joint.name: joint for body in mechanism.bodies for joint in body.joints}
    for guide in mechanism.guides:
        friction = {"frictionloss": numbers(_friction(mechanism, guide, joints[guide.joints[0]]))}
        stiff = {"solreffriction": STIFF["solref"], "solimpfriction": STIFF["solimp"]}
        tendon = SubElement(tendons, "fixed", {"name": f"{guide.site}_guide"} | friction | stiff)
        for name in guide.joints:
            SubElement(tendon, "joint", joint=name, coef="1")


def _friction(mechanism: Mechanism, guide: Guide, joint: Joint) -> float:
    """N, or N m."""
    return max(GRIP * _weight(mechanism) * _reach(mechanism, joint), GRIP * guide.load)


def _weight(mechanism: Mechanism) -> float:
    """N, of everything that moves."""
    mass = sum(body.inertia.mass for body in mechanism.bodies)
    return max(float(mass * np.linalg.norm(mechanism.gravity)), 1.0)


def _reach(mechanism: Mechanism, joint: Joint) -> float:
    """m by which a joint's travel moves the machine: the machine's size where the joint turns."""
    return 1.0 if joint.kind == "slide" else mechanism.reach


def _actuators(root: Element, mechanism: Mechanism) -> None:
    actuators = SubElement(root, "actuator")
    joints = {joint.name: joint for body in mechanism.bodies for joint in body.joints}
    elements = {str(element.get("name")): element for element in root.iter("joint") if element.get("name")}
    guides = {guide.site: guide for guide in mechanism.guides}
    follower = {coupling.other: coupling.joint for coupling in mechanism.couplings if coupling.other.endswith("_motor")}
    for coupling in mechanism.couplings:
        # Reflected inertia, also of what follows a motor and of play: it makes couplings and friction firm.
        stiffness = _weight(mechanism) * _reach(mechanism, joints[coupling.joint]) ** 2 / SAG
        elements[coupling.joint].set("armature", numbers(stiffness / DRIVE**2))
    for drive in mechanism.drives:
        moved = follower.get(drive.joint, drive.joint)
        reach = _reach(mechanism, joints[moved])
        guide = guides.get(drive.site)
        friction = 0.0 if guide is None else _friction(mechanism, guide, joints[moved])
        spring = Spring((_weight(mechanism) * reach + friction) * reach / SAG)
        for name in {drive.joint, moved, *(() if guide is None else guide.joints)}:
            elements[name].set("armature", numbers(spring.stiffness / DRIVE**2))
        # A gear turns commands into travel, and the force of the drive with it.
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
    keyframe = SubElement(root, "keyframe")
    ctrl = numbers(*(drive.home / drive.scale for drive in mechanism.drives))
    SubElement(keyframe, "key", name="home", qpos=numbers(*_qpos(mechanism)), ctrl=ctrl)


def _qpos(mechanism: Mechanism) -> list[float]:
    """MuJoCo's configuration at home: joints in the order of the bodies, depth first."""
    children: dict[str, list[Body]] = {}
    for body in mechanism.bodies:
        children.setdefault(body.parent, []).append(body)

    def coordinates(body: Body) -> list[float]:
        own = [joint.home for joint in body.joints]
        if body.free is not None:
            own = [*body.placement.translation, *to_quaternions(body.placement.rotation[None])[0]]
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
