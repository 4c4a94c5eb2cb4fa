"""Objects in an MJCF's scene that are not part of the robot, such as doors or a table that rolls."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

JOINTS = ("joint", "freejoint")
NAMING = ("actuator", "equality", "tendon")
"""Parts of a file that name what belongs to the robot."""


def without_objects(root: Element) -> None:
    """Remove objects: bodies on the world that move, but are not part of the robot.

    Nothing in ``<actuator>``, ``<equality>`` and ``<tendon>`` names an object or what is on it. Where a file has no actuators,
    an object must also float freely. Where all moving bodies would be objects, none is removed.
    """
    on_world = [(place, body) for world in root.findall("worldbody") for place, body in _bodies(world)]
    moving = [(world, body) for world, body in on_world if _joints(body)]
    parts = [element for tag in NAMING for part in root.findall(tag) for element in part.iter()]
    named = {value for element in parts for key, value in element.attrib.items() if key != "name"}
    driven = any(len(part) for part in root.findall("actuator"))
    objects = [
        (world, body)
        for world, body in moving
        if not named & {element.get("name", "") for element in body.iter()} - {""} and (driven or _floats(body))
    ]
    if len(objects) < len(moving):
        for world, body in objects:
            world.remove(body)


def _bodies(place: Element) -> Iterator[tuple[Element, Element]]:
    """The bodies on the world, also those in ``<frame>`` elements, each after the element that has it as a child."""
    for child in place:
        if child.tag == "body":
            yield place, child
        elif child.tag == "frame":
            yield from _bodies(child)


def _joints(body: Element) -> list[Element]:
    return [element for element in body.iter() if element.tag in JOINTS]


def _floats(body: Element) -> bool:
    return all(joint.tag == "freejoint" or joint.get("type") == "free" for joint in _joints(body))
