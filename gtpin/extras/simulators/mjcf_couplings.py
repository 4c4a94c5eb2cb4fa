"""Joints that follow others in MJCF: in proportion, or by harmonics.

MJCF has no constraint with a cosine. A harmonic is made by a crank: a massless body that turns in proportion to a joint, with a
pin at a small radius. The distance of the pin from a point far away varies as a cosine of the crank's angle, and the length of
a tendon between the two is that distance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from gtpin.export.xml_text import numbers
from gtpin.extras.simulators.curves import SAME, Harmonic
from gtpin.extras.simulators.mechanism import Coupling, Joint, Mechanism, shaft

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
