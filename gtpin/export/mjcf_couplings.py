"""Joints that follow others in MJCF: in proportion, and by cranks, whose pins show harmonics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from gtpin.export.curves import SAME, Harmonic
from gtpin.export.mechanism import Body, Coupling, Joint, Mechanism
from gtpin.export.text import numbers

ROD, RADIUS = 1.0, 1e-3
"""m from a crank's axis to the point that its tendon ends at, and to its pin: RADIUS / (2 ROD) is the relative error of a
cosine. MuJoCo takes a pin within 1e-6 m of the axis for one on it."""
LIGHT = 0.1
"""Inertia of a crank as it is reflected to what turns it, kg or kg m^2: less than a thousandth of a drive's."""


def with_cranks(mechanism: Mechanism) -> Mechanism:
    """A mechanism with a massless body on a hinge for each harmonic of its couplings: it turns with the joint that they follow.

    Couplings of one joint share the cranks.
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
    found: dict[tuple[str, float], str] = {}
    for coupling in mechanism.couplings:
        for harmonic in coupling.curve.harmonics:
            key = coupling.other, harmonic.rate
            count = sum(other == coupling.other for other, _ in found)
            found.setdefault(key, f"{coupling.other}_crank_{count + 1}")
    return found


def add_couplings(root: Element, tendons: Element, mechanism: Mechanism) -> None:
    """Equalities of the couplings; of those with harmonics, between tendons.

    A tendon goes from the pins of cranks to a point far away, by a pulley for each amplitude. Its length is a constant less the
    sum of the harmonics. A second tendon is the part of the joint's coordinate that is not proportional to the other's.
    """
    equality, cranks = root.find("equality"), _cranks(mechanism)
    assert equality is not None
    joints = {element.get("name"): element for element in root.iter("joint")}
    for (_, rate), name in cranks.items():
        joints[name].set("armature", numbers(LIGHT / rate**2))
    for coupling in mechanism.couplings:
        curve, waves = coupling.curve, coupling.curve.harmonics
        if not waves:
            polynomial = numbers(curve.offset, curve.proportion, 0.0, 0.0, 0.0)
            attributes = {"joint1": coupling.joint, "joint2": coupling.other, "polycoef": polynomial}
            SubElement(equality, "joint", {"name": f"{coupling.joint}_follows"} | attributes)
            continue
        own = SubElement(tendons, "fixed", name=f"{coupling.joint}_bends")
        SubElement(own, "joint", joint=coupling.joint, coef="1")
        SubElement(own, "joint", joint=coupling.other, coef=numbers(-curve.proportion))
        rod = SubElement(tendons, "spatial", name=f"{coupling.joint}_waves", width="0.001", rgba="0 0 0 0")
        for k, wave in enumerate(waves):
            SubElement(rod, "pulley", divisor=numbers(RADIUS / abs(wave.amplitude)))
            crank = cranks[coupling.other, wave.rate]
            _pin(root, crank, f"{coupling.joint}_pin_{k + 1}", wave)
            SubElement(rod, "site", site=f"{coupling.joint}_pin_{k + 1}")
            SubElement(rod, "site", site=_far(root, mechanism))
        # Lengths count from home, where the curve's waves have a value of their own.
        start = curve.offset + sum(wave.amplitude * np.cos(wave.phase) for wave in waves)
        attributes = {"tendon1": f"{coupling.joint}_bends", "tendon2": f"{coupling.joint}_waves"}
        follows = numbers(start, -1.0, 0.0, 0.0, 0.0)
        SubElement(equality, "tendon", {"name": f"{coupling.joint}_follows", "polycoef": follows} | attributes)


def _pin(root: Element, crank: str, name: str, wave: Harmonic) -> None:
    """The pin of a crank: a site at a radius, turned by the phase."""
    body = next(element for element in root.iter("body") if element.get("name") == crank)
    place = np.copysign(RADIUS, wave.amplitude) * np.array([np.cos(wave.phase), np.sin(wave.phase), 0.0])
    SubElement(body, "site", name=name, pos=numbers(*place), size="0.001", group="5")


def _far(root: Element, mechanism: Mechanism) -> str:
    """The point that the tendons of cranks end at."""
    name = "cranks_end"
    if not any(element.get("name") == name for element in root.iter("site")):
        base = next(element for element in root.iter("body") if element.get("name") == mechanism.bodies[0].name)
        SubElement(base, "site", name=name, pos=numbers(ROD, 0.0, 0.0), size="0.001", group="5")
    return name
