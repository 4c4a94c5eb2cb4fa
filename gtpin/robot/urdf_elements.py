"""Elements of a URDF that is written: joints, masses, numbers that are read again exactly; and such numbers that are read."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import pinocchio as pin


def exact_text(values: Iterable[float]) -> str:
    """Numbers as text from which exactly the same floats are read."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def numbers_of(text: str) -> tuple[float, ...]:
    """The numbers of a text; one that is not a number where a word of it is none."""
    try:
        return tuple(float(word) for word in text.split())
    except ValueError:
        return (math.nan,)


def own_element(root: Element) -> Element:
    """The ``<gtpin>`` of a URDF's outer element; a new one where it has none."""
    own = root.find("gtpin")
    return SubElement(root, "gtpin") if own is None else own


def set_origin(joint: Element, placement: Any) -> None:
    """Write a placement (``pinocchio.SE3``) into a joint's ``<origin>``; a new one where it has none."""
    origin = joint.find("origin")
    origin = SubElement(joint, "origin") if origin is None else origin
    origin.set("xyz", exact_text(placement.translation))
    origin.set("rpy", exact_text(pin.rpy.matrixToRpy(placement.rotation)))


def add_joint(root: Element, name: str, kind: str, parent: str, child: str, placement: Any) -> Element:
    """Add a joint between two links, with the child's placement."""
    joint = SubElement(root, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    set_origin(joint, placement)
    return joint


def add_inertia(link: Element, inertia: Any) -> None:
    """Add the mass and the moments of inertia (``pinocchio.Inertia``) of a link; none where it has no mass."""
    if inertia.mass > 0.0:
        element = SubElement(link, "inertial")
        SubElement(element, "origin", xyz=exact_text(inertia.lever))
        SubElement(element, "mass", value=repr(float(inertia.mass)))
        entries = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        own = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia.inertia[i, j])) for i, j in entries}
        SubElement(element, "inertia", own)
