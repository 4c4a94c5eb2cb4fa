"""MJCF as URDF: bodies, hinges and slides, closed loops by ``equality/connect``, followers by ``equality/joint``.

Pinocchio's own reader (4.1) leaves out all but the first of several bodies on the world, so gtpin converts the file to a URDF.
After that the robot is treated like any other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.data.files import read_text
from gtpin.errors import RobotError
from gtpin.robot.mjcf_scene import without_objects
from gtpin.robot.mjcf_values import Values
from gtpin.robot.tree import Tree

Floats = npt.NDArray[np.float64]

WORLD = "world"
MOST_BODIES = 300
REFUSED = ("frame", "replicate", "attach", "composite", "flexcomp")
"""Elements of a body tree that gtpin does not read."""


def mjcf_to_urdf(root: Element, source: str) -> str:
    """URDF of an MJCF's outer element, with its loops and gravity; where it has loops, also with its actuators and home.

    Bodies and named sites become links with the same names. Joints keep their names.

    Raises
    ------
    RobotError
        If the file holds an element that gtpin can't convert; the message names it.
    """
    for tag in REFUSED:
        if root.find(f"worldbody//{tag}") is not None:
            raise RobotError(f"<{tag}> is not read", file=source, hint="write the bodies out")
    without_objects(root)
    if sum(1 for _ in root.iter("body")) > MOST_BODIES:
        raise RobotError("too many bodies", file=source, hint=f"a robot has {MOST_BODIES} at most")
    writer = _Writer(Values.of(root, source), Element("robot", name=root.get("model", "mjcf")))
    return writer.write(root)


@dataclass
class _Writer:
    """Writes the URDF element by element.

    ``at``: placements (``pinocchio.SE3``) of links in the world at MuJoCo's initial posture. ``sites``: name, body, and
    placement on the body. ``initial``: coordinates of joints at this posture, rad or m.
    """

    values: Values
    robot: Element
    at: dict[str, Any] = field(default_factory=dict)
    sites: list[tuple[str, str, Any]] = field(default_factory=list)
    initial: dict[str, float] = field(default_factory=dict)

    def write(self, root: Element) -> str:
        self._link(WORLD, pin.SE3.Identity())
        for world in root.findall("worldbody"):
            self._children(world, WORLD, "main")
        own = Element("gtpin")
        for equality in root.findall("equality"):
            for element in equality:
                self._equality(element)
        if self.robot.find("loop_joint") is not None:
            self._drives(root, own)
        tip = Tree.of(self.robot, self.values.source).tip
        for name, body, placement in self.sites:
            if name not in self.at:
                self._link(name, self.at[body] * placement)
                self._joint(f"{name}_site", "fixed", body, name, placement)
        SubElement(own, "platform", link=tip)
        if own.find("actuator") is not None:
            q = [self.initial.get(drive.get("joint", ""), 0.0) for drive in own.findall("actuator")]
            pose = self.at[tip]
            SubElement(
                own,
                "home",
                q=_text(np.array(q)),
                tcp_xyz=_text(pose.translation),
                tcp_rotvec=_text(pin.log3(pose.rotation)),
            )
        option = next((option for option in root.findall("option") if option.get("gravity")), None)
        if option is not None:
            SubElement(own, "gravity", xyz=_text(self.values.numbers(option.attrib, "gravity", "", 3)))
        self.robot.append(own)
        indent(self.robot)
        return tostring(self.robot, encoding="unicode")

    # ------------------------------------------------------------------------------------------------ bodies

    def _children(self, parent: Element, link: str, inherited: str) -> None:
        for site in parent.findall("site"):
            given = self.values.attributes(site, inherited)
            if "name" in given:
                self.sites.append((given["name"], link, self.values.placement(given)))
        for body in parent.findall("body"):
            self._body(body, link, body.get("childclass", inherited))

    def _body(self, body: Element, parent: str, inherited: str) -> None:
        name = body.get("name") or f"body{len(self.at)}"
        placement = self.values.placement(body.attrib)
        pose = self.at[parent] * placement
        joints = [joint for joint in body if joint.tag in ("joint", "freejoint")]
        before, above = pin.SE3(placement), parent
        for number, joint in enumerate(joints):
            given = self.values.attributes(joint, inherited)
            called = given.get("name") or (f"{name}_joint" if len(joints) == 1 else f"{name}_joint{number + 1}")
            pos = self.values.numbers(given, "pos", "0 0 0", 3)
            last = number == len(joints) - 1 and not pos.any()
            child = name if last else f"{called}_frame"
            at = pin.SE3(np.eye(3), pos)
            self._link(child, pose if last else pose * at)
            self._moving(called, given, joint.tag, above, child, before * at)
            before, above = at.inverse(), child
        if above != name:
            self._link(name, pose)
            self._joint(f"{name}_fixed", "fixed", above, name, before)
        self._mass(name, self.values.inertia(body, inherited))
        self._children(body, name, inherited)

    def _moving(self, name: str, given: dict[str, str], tag: str, parent: str, child: str, origin: Any) -> None:
        kind = "free" if tag == "freejoint" else given.get("type", "hinge")
        if kind == "free":
            self._joint(name, "floating", parent, child, origin)
            return
        if kind not in ("hinge", "slide"):
            raise RobotError(
                f"joint {name} is of type {kind}", file=self.values.source, hint="use hinge and slide joints"
            )
        unit = self.values.angle if kind == "hinge" else 1.0
        axis = self.values.unit(self.values.numbers(given, "axis", "0 0 1", 3), "axis")
        start = float(self.values.numbers(given, "ref", "0", 1)[0]) * unit
        back = pin.SE3(pin.exp3(-start * axis), np.zeros(3)) if kind == "hinge" else pin.SE3(np.eye(3), -start * axis)
        limited = given.get("limited", "auto")
        if limited == "auto":
            limited = "true" if self.values.limits and "range" in given else "false"
        lower, upper = self.values.numbers(given, "range", "0 0", 2) * unit if limited == "true" else (0.0, 0.0)
        turning = "revolute" if limited == "true" else "continuous"
        joint = self._joint(name, turning if kind == "hinge" else "prismatic", parent, child, origin * back)
        SubElement(joint, "axis", xyz=_text(axis))
        # A range of zero width means no range: URDF has no prismatic joint without a range.
        SubElement(joint, "limit", lower=repr(float(lower)), upper=repr(float(upper)), effort="0", velocity="0")
        self.initial[name] = start

    # ------------------------------------------------------------------------------------------------ loops

    def _equality(self, element: Element) -> None:
        given = self.values.attributes(element, "main")
        if given.get("active", "true") != "true":
            return
        if element.tag == "connect":
            self._connect(given)
        elif element.tag == "joint":
            self._follow(given)
        else:
            raise RobotError(
                f"equality/{element.tag} is not read", file=self.values.source, hint="use connect, or joint"
            )

    def _connect(self, given: dict[str, str]) -> None:
        number = len(self.robot.findall("loop_joint")) + 1
        sites = {name: (body, placement.translation) for name, body, placement in self.sites}
        if "site1" in given:
            ends = [sites.get(given.get(key, ""), (given.get(key, ""), np.zeros(3))) for key in ("site1", "site2")]
        else:
            first, second = given.get("body1", ""), given.get("body2", WORLD)
            anchor = self.values.numbers(given, "anchor", "", 3)
            ends = [(first, anchor), (second, anchor)]
            if first in self.at and second in self.at:  # they meet at the initial posture
                ends[1] = (second, self.at[second].actInv(self.at[first].act(anchor)))
        loop = SubElement(self.robot, "loop_joint", name=given.get("name", f"connect{number}"), type="spherical")
        for tag, (link, xyz) in zip(("link1", "link2"), ends, strict=True):
            if link not in self.at:
                raise RobotError(
                    f"connect {loop.get('name')} of unknown {link!r}", file=self.values.source, hint="name a body"
                )
            SubElement(loop, tag, link=link, xyz=_text(xyz))

    def _follow(self, given: dict[str, str]) -> None:
        joints = {joint.get("name", ""): joint for joint in self.robot.findall("joint")}
        follower, master = given.get("joint1", ""), given.get("joint2", "")
        poly = np.zeros(5)
        given_poly = self.values.numbers(given, "polycoef", "0 1 0 0 0", 1, 5)
        poly[: len(given_poly)] = given_poly
        if follower not in self.initial or master not in self.initial or poly[2:].any():
            raise RobotError(
                f"equality/joint of {follower or 'no joint'}",
                file=self.values.source,
                hint="give joint1 and joint2, and a polycoef of two numbers and zeros",
            )
        offset = self.initial[follower] + poly[0] - poly[1] * self.initial[master]
        SubElement(joints[follower], "mimic", joint=master, multiplier=repr(float(poly[1])), offset=repr(float(offset)))

    def _drives(self, root: Element, own: Element) -> None:
        """Write the joints that ``<actuator>`` drives, once each: in a robot with loops not all joints can be commanded."""
        followers = {joint.get("name") for joint in self.robot.findall("joint") if joint.find("mimic") is not None}
        named = [drive.get("joint") for actuator in root.findall("actuator") for drive in actuator]
        for name in dict.fromkeys(named):
            if name in self.initial and name not in followers:
                SubElement(own, "actuator", joint=name)

    # ------------------------------------------------------------------------------------------------ elements

    def _link(self, name: str, placement: Any) -> None:
        if name in self.at:
            raise RobotError(f"two bodies are called {name}", file=self.values.source, hint="name each once")
        SubElement(self.robot, "link", name=name)
        self.at[name] = placement

    def _mass(self, name: str, inertia: Any) -> None:
        if inertia.mass <= 0.0:
            return
        link = next(link for link in self.robot.findall("link") if link.get("name") == name)
        inertial = SubElement(link, "inertial")
        SubElement(inertial, "origin", xyz=_text(inertia.lever))
        SubElement(inertial, "mass", value=repr(float(inertia.mass)))
        I = inertia.inertia  # noqa: E741
        entries = {"ixx": I[0, 0], "iyy": I[1, 1], "izz": I[2, 2], "ixy": I[0, 1], "ixz": I[0, 2], "iyz": I[1, 2]}
        SubElement(inertial, "inertia", {key: repr(float(value)) for key, value in entries.items()})

    def _joint(self, name: str, kind: str, parent: str, child: str, origin: Any) -> Element:
        joint = SubElement(self.robot, "joint", name=name, type=kind)
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        SubElement(joint, "origin", xyz=_text(origin.translation), rpy=_text(pin.rpy.matrixToRpy(origin.rotation)))
        return joint


def with_includes(root: Element, folder: Path, parse: Any, depth: int = 0) -> None:
    """Replace each ``<include file>`` by the content of that file; paths start at the main file's folder.

    Raises
    ------
    RobotError
        If an included file can't be read, or files include each other.
    """
    for parent in list(root.iter()):
        for place, child in reversed(list(enumerate(parent))):
            if child.tag != "include":
                continue
            file = folder / child.get("file", "")
            if depth > 8:
                raise RobotError("files that include each other", file=file, hint="end the ring")
            inside = parse(read_text(file, RobotError, hint="mend <include>"), str(file))
            with_includes(inside, folder, parse, depth + 1)
            parent.remove(child)
            for offset, element in enumerate(inside):
                parent.insert(place + offset, element)


def _text(values: Floats) -> str:
    """Numbers as text from which exactly the same floats are read."""
    return " ".join(repr(float(value) + 0.0) for value in values)
