"""A description with other actuators: those that a dataset or a caller picks, in the order of its commands."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from gtpin.errors import RobotError
from gtpin.robot.description import RobotDescription, parse_xml
from gtpin.robot.mjcf_values import exact_text
from gtpin.robot.tree import Tree


def with_home(
    description: RobotDescription, q: Sequence[float], near: Mapping[str, tuple[float, ...]]
) -> RobotDescription:
    """The description with these commands, m or rad, as its home; its loops are closed from the coordinates ``near`` of joints.

    Raises `RobotError` if there are not as many as actuators, or one is not finite.
    """
    names = [actuator.joint for actuator in description.actuators] or list(description.tree.moving)
    if len(q) != len(names) or not all(map(math.isfinite, q)):
        hint = f"give {len(names)} finite numbers, of {', '.join(names)}"
        raise RobotError(f"home of {len(q)} numbers for {description.name}", column="home", hint=hint)
    root = parse_xml(description.xml, description.source)
    own = root.find("gtpin")
    own = SubElement(root, "gtpin") if own is None else own
    posture = {**near, **{name: (float(value),) for name, value in zip(names, q, strict=True)}}
    for home in own.findall("home"):
        own.remove(home)
    home = SubElement(own, "home")
    for name, values in posture.items():
        SubElement(home, "joint", name=name, value=exact_text(np.array(values)))
    return RobotDescription.parse(tostring(root, encoding="unicode"), description.source, description.kind)


def with_actuators(description: RobotDescription, names: Sequence[str]) -> RobotDescription:
    """The description with these joints as actuators, in this order; without names, with its own.

    The ``<actuator>`` elements of its text are replaced, so that files that are written from it have them too. Actuators that
    stay keep their sites and scales. Joints that these actuators do not move stay at Pinocchio's neutral configuration, and
    loops of such joints are removed.

    Raises `RobotError` if a name is not that of a joint that can be commanded, or comes twice.
    """
    own_names = tuple(actuator.joint for actuator in description.actuators)
    if not names or tuple(names) == own_names:
        return _without_resting_loops(description, own_names)
    follows = {mimic.joint: mimic.master for mimic in description.tree.mimics}
    for number, name in enumerate(names):
        if name in follows:
            raise _error(f"{name} follows {follows[name]} by <mimic>", f"name {follows[name]} in its place")
        if name not in description.tree.moving:
            known = ", ".join(description.tree.moving[:12]) + (" ..." if len(description.tree.moving) > 12 else "")
            raise _error(f"{description.name} has no moving joint {name!r}", f"moving joints are {known or 'none'}")
        if name in names[:number]:
            raise _error(f"{name} comes twice", "name each joint once")
    root = parse_xml(description.xml, description.source)
    own = root.find("gtpin")
    if own is None:
        own = Element("gtpin")
        root.append(own)
    before = {element.get("joint"): element for element in own.findall("actuator")}
    for element in before.values():
        own.remove(element)
    home = own.find("home")
    if home is not None and description.home is not None:
        q = dict(zip(before, description.home.q, strict=False))
        home.set("q", " ".join(repr(q.get(name, 0.0)) for name in names))
    for place, name in enumerate(names):
        own.insert(place, before.get(name, Element("actuator", joint=name)))
    described = RobotDescription.parse(tostring(root, encoding="unicode"), description.source, description.kind)
    return _without_resting_loops(described, names)


def _without_resting_loops(description: RobotDescription, driven: Sequence[str]) -> RobotDescription:
    """The description without the loops that no actuator moves; itself where there are none, or no actuators."""
    if not description.loops or not driven:
        return description
    root = parse_xml(description.xml, description.source)
    if not remove_resting_loops(root, driven, description.source):
        return description
    return RobotDescription.parse(tostring(root, encoding="unicode"), description.source, description.kind)


def _error(what: str, hint: str) -> RobotError:
    return RobotError(what, column="actuators", hint=hint)


def remove_resting_loops(root: Element, driven: Collection[str], source: str) -> bool:
    """Remove from a URDF's outer element the ``<loop_joint>`` elements that no joint named in ``driven`` moves.

    A loop moves where one of its joints is driven, follows a driven joint, or is also in another loop that moves. All other
    loops keep the shape that they have at neutral.

    Returns whether there was one to remove. Raises `RobotError` if a ``<mimic>`` is wrong.
    """
    tree = Tree.of(root, source)
    masters = {joint: joint for joint in tree.moving} | {mimic.joint: mimic.master for mimic in tree.mimics}
    resting = {}
    for loop in root.findall("loop_joint"):
        ends = (loop.find(tag) for tag in ("link1", "link2"))
        one, other = (tree.path("" if end is None else end.get("link", "")) for end in ends)
        resting[loop] = {masters[joint] for joint in one ^ other if joint in masters}
    moving = set(driven)
    while moved := [loop for loop, own in resting.items() if own & moving]:
        for loop in moved:
            moving |= resting.pop(loop)
    names = {loop.get("name") for loop in resting}
    for loop in resting:
        root.remove(loop)
    for own in root.findall("gtpin"):
        for plane in own.findall("plane"):
            if plane.get("loop") in names:
                own.remove(plane)
    return bool(resting)
