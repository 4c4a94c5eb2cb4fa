"""Joints that follow others in MJCF: in proportion, and by cranks, whose pins show harmonics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from gtpin.export.curves import SAME, Harmonic
from gtpin.export.mechanism import Body, Coupling, Joint, Mechanism
from gtpin.export.mjcf_drives import STIFF
from gtpin.export.text import numbers

ROD, RADIUS = 1.0, 1e-3
"""m from a crank's axis to the point that its tendon ends at, and to its pin: RADIUS / (2 ROD) is the relative error of a
cosine. MuJoCo takes a pin within 1e-6 m of the axis for one on it."""
LIGHT, FIRM = 1e-3, 0.03
"""Inertia of a crank as what turns it feels it, over the inertia of that; of the crank that a play is limited by."""
SELF = Harmonic(1.0, -np.pi / 2.0, 1.0)
"""A joint's own small coordinate x: cos(x - pi / 2)."""


def with_cranks(mechanism: Mechanism) -> Mechanism:
    """A mechanism with a massless body on a hinge for each harmonic of its couplings and plays: it turns with their joint.

    All that follow one joint share its cranks.
    """
    base = mechanism.bodies[0].name
    bodies, couplings = [], []
    for (other, rate), name in _cranks(mechanism).items():
        joint = Joint(name, "hinge", np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0)
        bodies.append(Body(name, base, pin.SE3.Identity(), (joint,), pin.Inertia.Zero()))
        couplings.append(Coupling(name, other, SAME.times(rate)))
    return replace(mechanism, bodies=(*mechanism.bodies, *bodies), couplings=(*mechanism.couplings, *couplings))


def _cranks(mechanism: Mechanism) -> Mapping[tuple[str, float], str]:
    """Names of the cranks, by the joint that turns them and their turn for a unit of it."""
    turned = [(c.other, h.rate) for c in mechanism.couplings for h in c.curve.harmonics]
    for play in mechanism.plays:
        turned += [*((play.other, h.rate) for h in play.half.harmonics), (play.joint, SELF.rate)]
    found: dict[tuple[str, float], str] = {}
    for other, rate in dict.fromkeys(turned):
        found[other, rate] = f"{other}_crank_{sum(name == other for name, _ in found) + 1}"
    return found


def add_couplings(root: Element, tendons: Element, mechanism: Mechanism) -> None:
    """Equalities of the couplings; of those with harmonics, between tendons.

    A tendon has a length of a constant less the sum of the harmonics (:func:`_rod`). A second one is the part of the joint's
    coordinate that is not proportional to the other's.
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
        # Lengths count from home, where the curve's harmonics have a value of their own.
        start = curve.offset + sum(h.amplitude * np.cos(h.phase) for h in curve.harmonics)
        attributes = {"tendon1": f"{coupling.joint}_bends", "tendon2": f"{coupling.joint}_waves"}
        follows = numbers(start, -1.0, 0.0, 0.0, 0.0)
        SubElement(equality, "tendon", {"name": f"{coupling.joint}_follows", "polycoef": follows} | attributes)


def add_plays(root: Element, tendons: Element, mechanism: Mechanism) -> None:
    """Limits of the plays that vary, to both sides, as tendons: half the play less the joint's coordinate is not below zero."""
    for play in mechanism.plays:
        for side, sign in (("ahead", -1.0), ("behind", 1.0)):
            parts = [(play.other, h) for h in play.half.harmonics]
            parts.append((play.joint, replace(SELF, amplitude=sign * SELF.amplitude)))
            rod = _rod(root, tendons, mechanism, f"{play.joint}_{side}", parts)
            length = sum(abs(h.amplitude) for _, h in parts) * ROD / RADIUS
            length += SELF.amplitude * (np.hypot(ROD, RADIUS) - ROD) / RADIUS  # the pin of SELF stands across
            rod.set("range", numbers(0.0, length + play.half.offset))
            rod.set("solreflimit", STIFF["solref"])
            rod.set("solimplimit", STIFF["solimp"])


def _rod(
    root: Element, tendons: Element, mechanism: Mechanism, name: str, parts: Sequence[tuple[str, Harmonic]]
) -> Element:
    """A tendon from pins of cranks to a point far away, by a pulley for each amplitude.

    Its length is a constant less the sum of harmonics, each of a joint's coordinate.
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
    """The point of the base that the tendons of cranks end at."""
    name, base = "cranks_end", root.find("worldbody/body")
    assert base is not None
    if not any(site.get("name") == name for site in base.findall("site")):
        SubElement(base, "site", name=name, pos=numbers(ROD, 0.0, 0.0), size="0.001", group="5")
    return name
