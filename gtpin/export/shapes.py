"""Shapes of links, for drawings: boxes, cylinders and spheres, which all formats can represent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal
from xml.etree.ElementTree import tostring

import pinocchio as pin

from gtpin.errors import warn
from gtpin.robot.description import parse_xml
from gtpin.robot.robot import Robot

SIMPLE = ("box", "cylinder", "sphere")


@dataclass(frozen=True, eq=False)
class Shape:
    """A box (sides), a cylinder along z (radius and length) or a sphere (radius), m, with its colour.

    ``placement`` is its ``pinocchio.SE3`` in its body's frame.
    """

    kind: Literal["box", "cylinder", "sphere"]
    size: tuple[float, ...]
    placement: Any
    rgba: tuple[float, ...]


def shapes_of(robot: Robot) -> dict[int, tuple[Shape, ...]]:
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
        shape = _shape(item)
        found[item.parentJoint] = (*found.get(item.parentJoint, ()), shape)
    return found


def _shape(item: Any) -> Shape:
    geometry, rgba = item.geometry, tuple(round(float(c), 6) for c in item.meshColor)
    name = type(geometry).__name__.lower()
    if name == "box":
        return Shape("box", tuple(2.0 * float(s) for s in geometry.halfSide), item.placement, rgba)
    if name == "cylinder":
        return Shape("cylinder", (float(geometry.radius), 2.0 * float(geometry.halfLength)), item.placement, rgba)
    return Shape("sphere", (float(geometry.radius),), item.placement, rgba)
