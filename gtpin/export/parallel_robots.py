"""A URDF and a YAML file with its loops and motors, in the format of ``example-parallel-robots``."""

from __future__ import annotations

import json
from xml.etree.ElementTree import Element, SubElement

from gtpin.errors import RobotError
from gtpin.export.text import xml_text
from gtpin.robot.closures import ENDS, SPHERICAL
from gtpin.robot.description import parse_xml
from gtpin.robot.robot import Robot


def with_anchors(robot: Robot) -> str:
    """URDF of a robot in which both anchors of every loop are separate links, ``LOOP_A`` and ``LOOP_B``.

    Shapes are left out: the loader of example-parallel-robots removes a frame although shapes refer to frames by their number,
    and then crashes with some robots.

    Raises `RobotError` if the robot has no loops.
    """
    description = robot.description
    if not description.loops:
        raise RobotError(f"{robot.name} has no loops", hint="example-parallel-robots reads robots with loops")
    root = parse_xml(description.xml, description.source)
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for shape in link.findall(tag):
                link.remove(shape)
    for loop in root.findall("loop_joint"):
        for end_of_name, end in zip(ENDS, ("link1", "link2"), strict=True):
            anchor = loop.find(end)
            assert anchor is not None
            _mount(root, f"{loop.get('name')}{end_of_name}", anchor)
    return xml_text(root)


def side_file(robot: Robot) -> str:
    """YAML that closes the loops by three coordinates each, and names the driven joints in the order of q."""
    loops = [loop.name for loop in robot.description.loops]
    lines = {
        "closed_loop": [[f"{name}{end}" for end in ENDS] for name in loops],
        "type": [SPHERICAL] * len(loops),
        "name_mot": [actuator.joint for actuator in robot.actuators],
    }
    return "".join(f"{key}: {json.dumps(value)}\n" for key, value in lines.items())


def _mount(root: Element, name: str, anchor: Element) -> None:
    SubElement(root, "link", name=name)
    joint = SubElement(root, "joint", name=f"{name}_mount", type="fixed")
    SubElement(joint, "parent", link=anchor.get("link", ""))
    SubElement(joint, "child", link=name)
    SubElement(joint, "origin", xyz=anchor.get("xyz", "0 0 0"), rpy=anchor.get("rpy", "0 0 0"))
