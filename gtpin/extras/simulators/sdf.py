"""SDF, Gazebo's format: a graph of links in which loops are joints like the others."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.export.xml_text import numbers, xml_text
from gtpin.extras.simulators.mechanism import WORLD, Body, Joint, Mechanism

VERSION = "1.9"
SQUARE = 1e-9
"""Two joints become a universal joint if their axes are at most so far apart, m, and so far from a right angle, rad."""
SMALLEST = pin.Inertia(1e-3, np.zeros(3), 1e-6 * np.eye(3))
"""Inertia of links without mass: 1 g and 1e-6 kg m^2. Without one, physics engines assume a mass of 1 kg."""


def to_sdf(mechanism: Mechanism) -> str:
    """SDF of a mechanism at home. Every loop is a ``ball`` joint, two joints of a rod with crossing axes are a ``universal``
    one.

    The platform floats: only the rods' joints hold it. In SDF a joint's position is zero at the pose in the file, which is
    home. For a joint whose coordinate at home is not zero, the range is shifted by this coordinate, and ``gtpin:home`` gives
    it.

    Raises `RobotError` if a body has two joints whose axes do not intersect at a right angle, or more than two. A link
    without mass between two joints, which is merged with the next link, can cause this.
    """
    root = Element("sdf", {"version": VERSION, "xmlns:gtpin": "urn:gtpin"})
    base = mechanism.bodies[0]
    model = SubElement(root, "model", name=mechanism.name, canonical_link=base.name)
    placements = mechanism.placements()
    for body in mechanism.bodies:
        _link(model, body, placements[body.name])
    _joint(model, f"{base.name}_to_world", "fixed", "world", base.name)
    for body in mechanism.bodies[1:]:
        if body.free is None:
            _joints(model, body)
    for name, (one, other) in mechanism.loops.items():
        ball = _joint(model, name, "ball", other.body, one.body)
        _pose(ball, pin.SE3(np.eye(3), one.point))
    return xml_text(root)


def _link(model: Element, body: Body, placement: Any) -> None:
    link = SubElement(model, "link", name=body.name)
    _pose(link, placement)
    if body.parent != WORLD:
        inertia = body.inertia if body.inertia.mass > 0.0 else SMALLEST
        inertial = SubElement(link, "inertial")
        _pose(inertial, pin.SE3(np.eye(3), np.asarray(inertia.lever)))
        _value(inertial, "mass", inertia.mass)
        moments = SubElement(inertial, "inertia")
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            _value(moments, f"i{'xyz'[i]}{'xyz'[j]}", inertia.inertia[i, j])
    for number, shape in enumerate(body.shapes):
        visual = SubElement(link, "visual", name=f"{body.name}_{number}")
        _pose(visual, shape.placement)
        kind = SubElement(SubElement(visual, "geometry"), shape.kind)
        if shape.kind == "box":
            SubElement(kind, "size").text = numbers(*shape.size)
        else:
            for tag, size in zip(("radius", "length"), shape.size, strict=False):
                _value(kind, tag, size)
        colours = SubElement(visual, "material")
        for tag in ("ambient", "diffuse"):
            SubElement(colours, tag).text = numbers(*shape.rgba)
    for name, fixed in body.frames.items():
        _pose(SubElement(model, "frame", name=name, attached_to=body.name), fixed)


def _joints(model: Element, body: Body) -> None:
    if not body.joints:
        _joint(model, f"{body.name}_mount", "fixed", body.parent, body.name)
        return
    first, *others = body.joints
    if not others:
        kind = "prismatic" if first.kind == "slide" else "revolute"
        kind = "continuous" if kind == "revolute" and not np.isfinite(first.upper) else kind
        joint = _joint(model, first.name, kind, body.parent, body.name)
    elif (
        len(others) == 1
        and first.kind == others[0].kind == "hinge"
        and abs(float(first.axis @ others[0].axis)) < SQUARE
        and float(np.linalg.norm(first.point - others[0].point)) < SQUARE
    ):
        joint = _joint(model, f"{body.name}_joint", "universal", body.parent, body.name)
    else:
        names = " and ".join(j.name for j in body.joints)
        raise RobotError(f"SDF has no joint like {names} together", hint="give the link between them a mass")
    _pose(joint, pin.SE3(np.eye(3), first.point))
    for tag, axis in zip(("axis", "axis2"), body.joints, strict=False):
        _axis(joint, tag, axis)


def _axis(joint: Element, tag: str, axis: Joint) -> None:
    element = SubElement(joint, tag)
    SubElement(element, "xyz").text = numbers(*axis.axis)
    if np.isfinite([axis.lower, axis.upper]).all():
        limit = SubElement(element, "limit")
        _value(limit, "lower", axis.lower - axis.home)
        _value(limit, "upper", axis.upper - axis.home)
    if axis.spring is not None:
        dynamics = SubElement(element, "dynamics")
        _value(dynamics, "spring_reference", axis.spring.rest - axis.home)
        _value(dynamics, "spring_stiffness", axis.spring.stiffness)
    if axis.home:
        _value(element, "gtpin:home", axis.home)


def _joint(model: Element, name: str, kind: str, parent: str, child: str) -> Element:
    joint = SubElement(model, "joint", name=name, type=kind)
    SubElement(joint, "parent").text = parent
    SubElement(joint, "child").text = child
    return joint


def _pose(element: Element, placement: Any) -> None:
    rpy = pin.rpy.matrixToRpy(placement.rotation)
    SubElement(element, "pose").text = numbers(*placement.translation, *rpy)


def _value(element: Element, tag: str, value: float) -> None:
    SubElement(element, tag).text = numbers(value)
