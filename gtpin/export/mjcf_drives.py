"""Drives in MJCF: position actuators, the reflected inertia of their joints, and the friction behind a play."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from gtpin.export.mechanism import Guide, Joint, Mechanism, Spring
from gtpin.export.text import numbers

DRIVE = 2000.0
"""Largest natural frequency of drives, rad/s, that the time step allows. Drives have a reflected inertia that limits their
frequency to this value."""
SAG = 3e-7
"""Deflection of a drive, m, under the weight of all moving bodies and the friction of its guide."""
GRIP = 2.0
"""Friction of a guide behind a play, over the larger of two loads: the machine's weight (times its size, if the actuator is
revolute), and the largest load of the model's fit."""
STIFF = {"solref": "0.001 1", "solimp": "0.9999 0.9999 0.001"}
"""Constraints as stiff as the time step allows."""


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
