"""The joints and links of a URDF in the order of the document: what moves, what follows, where the longest chain ends."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

from gtpin.errors import RobotError
from gtpin.robot.urdf_elements import numbers_of

MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints with one degree of freedom."""
MOST = 1e6
"""Largest multiplier and offset of a follower: rad/m, m/rad, rad or m."""
TOOL = "tool0"
"""ROS-Industrial's name of the link at a robot's tool flange: the TCP where a URDF has it and names no other."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: its coordinate is ``multiplier * q_master + offset`` (m or rad).

    ``master`` follows no other joint: where a joint follows a follower, it is the first joint of that series.
    """

    joint: str
    master: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Tree:
    """The joints and links of a URDF.

    - ``moving``: names of the joints of one degree of freedom that follow no other, in document order.
    - ``mimics``: the joints that follow one of them, in document order.
    - ``tip``: the TCP where nothing names it: the link ``tool0``; else the last link at the end of the longest chain of
      moving joints (of several, the last in document order), of those that no loop holds. Empty where there are no links.
    - ``ends``: the links at the ends of chains of moving joints that no loop holds, in document order; all, if it holds all.
      More than one: ``tip`` is a guess, except where it is ``tool0``.
    - ``above``: by link, the link above it, and the joint between the two.
    """

    moving: tuple[str, ...]
    mimics: tuple[Mimic, ...]
    tip: str
    ends: tuple[str, ...]
    above: Mapping[str, tuple[str, str]]

    def path(self, link: str) -> set[str]:
        """Names of the joints between a link and the root."""
        found = set()
        for _ in range(len(self.above)):  # ends also for a ring of links, which Pinocchio refuses later
            if link not in self.above:
                break
            link, joint = self.above[link]
            found.add(joint)
        return found

    @staticmethod
    def of(root: Element, source: str) -> Tree:
        """Read the joints and links of a URDF's outer element.

        Raises `RobotError` if a link is the child of two joints; or if a ``<mimic>`` names no joint that moves, or names its
        own, or holds what is no number or a huge one.
        """
        joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
        moving = [name for name, joint in joints.items() if joint.get("type") in MOVING]
        leading = ((name, joints[name].find("mimic")) for name in moving)
        follows = {name: _mimic(name, element, source) for name, element in leading if element is not None}
        mimics = tuple(_to_master(mimic, follows, moving, source) for mimic in follows.values())
        links = [link.get("name", "") for link in root.findall("link")]
        above: dict[str, tuple[str, str]] = {}
        for joint in root.findall("joint"):
            child, parent = joint.find("child"), joint.find("parent")
            if child is not None and parent is not None:
                if before := above.get(link := child.get("link", "")):
                    what = f"link {link} has two parents, {before[1]} and {joint.get('name', '')}"
                    raise RobotError(what, file=source, hint="keep one; a <loop_joint> closes a loop")
                above[link] = (parent.get("link", ""), joint.get("name", ""))
        tree = Tree(tuple(name for name in moving if name not in follows), mimics, "", (), above)
        fixed = {name for name, joint in joints.items() if joint.get("type") == "fixed"}
        depths = {link: len(tree.path(link) - fixed) for link in links}
        parents = {parent for parent, _ in above.values()}
        # What a loop holds at both sides is no tool, where there is another end.
        held = {end.get("link") for loop in root.findall("loop_joint") for end in loop}
        leaves = [link for link in links if link not in parents]
        leaves = [link for link in leaves if link not in held] or leaves
        deepest = max((depths[link] for link in leaves), default=0)
        longest = [link for link in leaves if depths[link] == deepest]
        tip = TOOL if TOOL in links else longest[-1] if longest else ""
        return replace(tree, tip=tip, ends=tuple(link for link in leaves if depths[link] > 0))


def _mimic(joint: str, element: Element, source: str) -> Mimic:
    numbers = numbers_of(f"{element.get('multiplier', '1')} {element.get('offset', '0')}")
    if len(numbers) != 2 or not all(map(math.isfinite, numbers)):
        raise RobotError(f"<mimic> of joint {joint} has what is no number", file=source, hint="mend the <mimic>")
    return Mimic(joint, element.get("joint", ""), *numbers)


def _to_master(mimic: Mimic, follows: Mapping[str, Mimic], moving: list[str], source: str) -> Mimic:
    """The same mimic, with a joint that follows no other as its master."""
    master, multiplier, offset = mimic.master, mimic.multiplier, mimic.offset
    for _ in follows:
        if master not in follows:
            break
        further = follows[master]
        offset += multiplier * further.offset
        multiplier *= further.multiplier
        master = further.master
    if max(abs(multiplier), abs(offset)) > MOST:
        what = f"<mimic> of joint {mimic.joint}: it follows {master} by a multiplier of {multiplier:g}, an offset of {offset:g}"
        raise RobotError(what, file=source, hint="mend the <mimic>; no joint moves so far")
    if master not in moving or master in follows:
        what = f"joint {mimic.joint} follows {mimic.master or 'no joint'} by <mimic>"
        why = "that follows it" if master in follows else "which does not move"
        raise RobotError(f"{what}, {why}", file=source, hint="let it follow a joint that moves by itself")
    return Mimic(mimic.joint, master, multiplier, offset)
