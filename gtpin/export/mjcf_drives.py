"""Drives in MJCF: position actuators, joints that follow their motors, and the friction beyond a play."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from gtpin.export.mechanism import Guide, Joint, Mechanism, Spring
from gtpin.export.text import numbers

DRIVE = 2000.0
"""Largest natural frequency of drives, rad/s, for the time step; reflected inertia reduces it to this value."""
SAG = 3e-7
"""Deflection of a drive, m, under the weight of all moving bodies."""
GRIP = 2.0
"""Friction of a guide beyond a play: multiple of the machine's weight (times its reach, where the actuator turns), and of the
largest load of the fit."""
STIFF = {"solref": "0.001 1", "solimp": "0.9999 0.9999 0.001"}
"""Constraints as stiff as the time step allows."""


def add_guides(tendons: Element, mechanism: Mechanism) -> None:
    """Friction of the guides beyond a play, as tendons over the joints whose sum it holds."""
    joints = {joint.name: joint for body in mechanism.bodies for joint in body.joints}
    for guide in mechanism.guides:
        friction = {"frictionloss": numbers(_friction(mechanism, guide, joints[guide.joints[0]]))}
        stiff = {"solreffriction": STIFF["solref"], "solimpfriction": STIFF["solimp"]}
        tendon = SubElement(tendons, "fixed", {"name": f"{guide.joints[-1]}_guide"} | friction | stiff)
        for name in guide.joints:
            SubElement(tendon, "joint", joint=name, coef="-1" if guide.ahead and name == guide.joints[-1] else "1")


def _friction(mechanism: Mechanism, guide: Guide, joint: Joint) -> float:
    """Friction force of a guide, N, or moment, N m."""
    return max(GRIP * _weight(mechanism) * _reach(mechanism, joint), GRIP * guide.load)


def _weight(mechanism: Mechanism) -> float:
    """Weight of all moving bodies, N."""
    mass = sum(body.inertia.mass for body in mechanism.bodies)
    return max(float(mass * np.linalg.norm(mechanism.gravity)), 1.0)


def _reach(mechanism: Mechanism, joint: Joint) -> float:
    """m by which a joint's travel moves the machine: the machine's size where the joint turns."""
    return 1.0 if joint.kind == "slide" else mechanism.reach


def add_actuators(root: Element, mechanism: Mechanism) -> None:
    """A position actuator for each drive."""
    actuators = SubElement(root, "actuator")
    joints = {joint.name: joint for body in mechanism.bodies for joint in body.joints}
    elements = {str(element.get("name")): element for element in root.iter("joint") if element.get("name")}
    follower = {coupling.other: coupling.joint for coupling in mechanism.couplings if coupling.other.endswith("_motor")}
    for coupling in mechanism.couplings:
        # Reflected inertia, also of what follows a motor and of play: it makes couplings and friction firm.
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
