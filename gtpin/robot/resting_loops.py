"""Loops that no actuator moves, such as those of a gripper on an arm: their joints rest, so they need no closure."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from xml.etree.ElementTree import Element

from gtpin.robot.tree import Tree


def remove_resting_loops(root: Element, driven: Collection[str], source: str) -> bool:
    """Remove from a URDF's outer element the ``<loop_joint>`` elements that no joint named in ``driven`` moves.

    A loop moves where one of its joints is driven, follows a driven joint, or is also in another loop that moves. All other
    loops keep the shape that they have at neutral.

    Returns
    -------
    removed
        Whether there was one to remove.

    Raises
    ------
    RobotError
        If a ``<mimic>`` is wrong.
    """
    tree = Tree.of(root, source)
    masters = {joint: joint for joint in tree.moving} | {mimic.joint: mimic.master for mimic in tree.mimics}
    above = {}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            above[child.get("link", "")] = (parent.get("link", ""), joint.get("name", ""))
    resting = {}
    for loop in root.findall("loop_joint"):
        one, other = (_joints_above(loop.find(tag), above) for tag in ("link1", "link2"))
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


def _joints_above(end: Element | None, above: Mapping[str, tuple[str, str]]) -> set[str]:
    """Names of the joints between one end of a loop and the root."""
    found, link = set(), "" if end is None else end.get("link", "")
    for _ in range(len(above)):  # a ring of links, which Pinocchio refuses, must not hang this
        if link not in above:
            break
        link, joint = above[link]
        found.add(joint)
    return found
