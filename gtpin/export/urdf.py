"""URDFs for other software: drive scales as transmissions; loops in the format of ``example-parallel-robots``; changes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element, SubElement, tostring

from gtpin.errors import RobotError
from gtpin.export.xml_text import numbers, xml_text
from gtpin.robot.chain import Chain
from gtpin.robot.closures import ENDS
from gtpin.robot.description import parse_xml

SIMPLE = "transmission_interface/SimpleTransmission"
"""The transmission whose joint moves by the actuator's travel over ``mechanicalReduction``."""


def with_transmissions(urdf: str, robot: Chain, scales: Mapping[str, float]) -> str:
    """The URDF with a transmission for each drive whose travel per command is not 1: its reduction is divided by this scale.

    A ``<mimic>`` is not used: it needs an additional joint, which other software would treat as another driven joint.
    """
    odd = [(actuator, scales[actuator.site]) for actuator in robot.actuators if scales[actuator.site] != 1.0]
    if not odd:
        return urdf
    root = parse_xml(urdf, f"the URDF of {robot.name}")
    own = {joint.get("name"): t for t in root.findall("transmission") for joint in t.findall("joint")}
    for actuator, scale in odd:
        reduction = _reduction(root, own.get(actuator.joint), actuator.joint)
        try:
            before = float(reduction.text or 1.0)
        except ValueError:
            continue  # not a number: no reader knows what it means
        reduction.text = numbers(before / scale)
    return xml_text(root)


def _reduction(root: Element, transmission: Element | None, joint: str) -> Element:
    """The element with a joint's reduction; added if there is none."""
    if transmission is None:
        transmission = SubElement(root, "transmission", name=f"{joint}_scale")
        SubElement(transmission, "type").text = SIMPLE
        SubElement(transmission, "joint", name=joint)
    motor = transmission.find("actuator")
    motor = SubElement(transmission, "actuator", name=f"{joint}_drive") if motor is None else motor
    found = next(transmission.iter("mechanicalReduction"), None)
    return SubElement(motor, "mechanicalReduction") if found is None else found


def with_anchors(robot: Chain) -> str:
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


def side_file(robot: Chain) -> str:
    """YAML that closes the loops by three coordinates each, or six, and names the driven joints in the order of q."""
    loops = [loop.name for loop in robot.description.loops if not loop.point_of]
    fixed = {loop.point_of for loop in robot.description.loops}
    lines = {
        "closed_loop": [[f"{name}{end}" for end in ENDS] for name in loops],
        "type": ["6d" if name in fixed else "3d" for name in loops],
        "name_mot": [actuator.joint for actuator in robot.actuators],
    }
    return "".join(f"{key}: {json.dumps(value)}\n" for key, value in lines.items())


def changed_origins(before: str, after: str, file: str) -> str:
    """What a calibration changes of a URDF, as a unified diff of these elements alone: the origins of joints, the anchors of
    loops, and in ``<gtpin>`` the TCP's link, home and planes. A joint that is new, of a TCP that had none, is shown whole.

    ``before``, ``after``: the URDFs. ``file``: the name of the first, for the heading.
    """
    lines = [f"--- {file}", f"+++ {file} (calibrated)"]
    old, new = (dict(_places(parse_xml(text, file))) for text in (before, after))
    for place in dict.fromkeys([*old, *new]):
        was = [f"-{_line(old[place][0])}"] if place in old else []
        now = [f"+{_line(new[place][0 if was else 1])}"] if place in new else []
        if not (was and now and was[0][1:] == now[0][1:]):
            lines += [f"@@ {place} @@", *was, *now]
    return "\n".join(lines) + "\n"


def _places(root: Element) -> Iterator[tuple[str, tuple[Element, Element]]]:
    """Names of all that has a place in a URDF, with the element that says it and the one that this belongs to."""
    for joint in root.findall("joint"):
        origin = joint.find("origin")
        own = Element("origin", xyz="0 0 0", rpy="0 0 0") if origin is None else origin
        yield f"joint {joint.get('name')}", (own, joint)
    for loop in root.findall("loop_joint"):
        for end in ("link1", "link2"):
            if (anchor := loop.find(end)) is not None:
                yield f"loop_joint {loop.get('name')} {end}", (anchor, loop)
    for tag in ("platform", "home", "plane"):
        for number, own in enumerate(root.findall(f"gtpin/{tag}")):
            yield f"gtpin {tag}{f' {number + 1}' if tag == 'plane' else ''}", (own, own)


def _line(element: Element) -> str:
    """An element on one line."""
    return " ".join(tostring(element, encoding="unicode").split()).replace("> <", "><")


def _mount(root: Element, name: str, anchor: Element) -> None:
    SubElement(root, "link", name=name)
    joint = SubElement(root, "joint", name=f"{name}_mount", type="fixed")
    SubElement(joint, "parent", link=anchor.get("link", ""))
    SubElement(joint, "child", link=name)
    SubElement(joint, "origin", xyz=anchor.get("xyz", "0 0 0"), rpy=anchor.get("rpy", "0 0 0"))
