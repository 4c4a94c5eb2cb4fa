"""MJCF as URDF: bodies, hinges and slides, closed loops by ``equality/connect``, followers by ``equality/joint``.

Pinocchio's own reader (4.1) leaves out all but the first of several bodies on the world, so gtpin converts the file to a URDF.
After that the robot is treated like any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError, listed, warn
from gtpin.extras.simulators.mjcf_values import (
    JOINTS,
    MAIN,
    SHOWN,
    Masses,
    Part,
    Values,
    parts_of_bodies,
    with_includes,
    without_objects,
)
from gtpin.robot.tree import TOOL, Tree
from gtpin.robot.urdf_elements import add_inertia, add_joint, exact_text, set_origin
from gtpin.typing import Floats

WORLD = "world"
MOST = 300
"""Largest number of elements that may be nested: bodies, frames, default classes."""
REFUSED = ("replicate", "attach", "composite", "flexcomp")
"""Elements of a body tree that gtpin does not read."""
FLOATING = ["slide", "slide", "slide", "ball"]
"""Joints of a body that floats: `gtpin.export` writes them on the base, where MuJoCo takes no ``<freejoint>``."""
TCP_MARK = "gtpin_tcp"
"""Name of the ``<custom><text>`` that names the body or site that is the TCP. `gtpin.export` writes it."""

ADDED_MARK = "gtpin_added_"
"""Start of the name of a ``<custom><text>`` for a joint of an effect (a play, a spring), which is no part of the robot, before
the joint's name. Its data is the robot's joint for which a motor stands, else the name once more; see `TCP_MARK`."""
PLANE_MARK = "gtpin_plane_"
"""Start of the name of a ``<custom><numeric>`` with the normal of a loop's plane, before the loop's name; see `TCP_MARK`."""


def mjcf_to_urdf(root: Element, source: str, key: str) -> str:
    """URDF of an MJCF's outer element and of what it includes, with its loops and gravity.

    Where it has loops, also with its actuators and home.

    Home are the joints' coordinates of the ``<key>`` of this name, of the first ``<key>`` without a name; where the file has
    none, those of MuJoCo's initial posture.

    Bodies and named sites become links with the same names; a body with the name of a site gets another one. Joints keep their
    names.

    Raises `RobotError` if the file holds an element that gtpin can't convert; the message names it. Warns: if the file
    holds something that changes loads and that gtpin does not read, with the names of the bodies.
    """
    with_includes(root, Path(source))
    for tag in REFUSED:
        if root.find(f"worldbody//{tag}") is not None:
            raise RobotError(f"<{tag}> is not read", file=source, hint="write the bodies out")
    for tag in ("frame", "default"):
        _check_number(root, tag, source)
    values = Values.of(root, source)
    masses = Masses.of(root, values)
    whole = _counted(root, values)
    without_objects(root)
    _check_number(root, "body", source)
    keyframe = _keyframe(root, values, key, (whole, _counted(root, values)))
    writer = _UrdfWriter(values, masses, Element("robot", name=root.get("model", "mjcf")), keyframe)
    return writer.write(root)


def _check_number(root: Element, tag: str, source: str) -> None:
    if sum(1 for _ in root.iter(tag)) > MOST:
        raise RobotError(f"too many <{tag}> elements", file=source, hint=f"a robot has {MOST} at most")


@dataclass(frozen=True)
class _Keyframe:
    """Coordinates of all joints: ``qpos`` of a ``<key>``, and the index in it of the first coordinate of each joint's element;
    both empty without a ``<key>``."""

    qpos: Floats
    places: Mapping[Element, int]

    def at(self, joint: Element, count: int) -> Floats:
        """The coordinates of a joint."""
        place = self.places[joint]
        return self.qpos[place : place + count]


def _keyframe(
    root: Element, values: Values, name: str, counts: Sequence[tuple[Mapping[Element, int], int]]
) -> _Keyframe:
    """The keyframe of a name; the first one without a name. ``counts``: see `_counted`, with and without objects of a scene.

    Raises `RobotError` if there is none of this name, or its numbers are not those of the joints.
    """
    every = root.findall("keyframe/key")
    keys = [key for key in every if name in ("", key.get("name"))]
    if name and not keys:
        named = ", ".join(key.get("name", "") for key in every) or "none"
        raise values.error(f"no keyframe is called {name!r}", f"keyframes are {named}")
    if not keys or not keys[0].get("qpos"):
        return _Keyframe(np.zeros(0), {})
    qpos = values.numbers(keys[0].attrib, "qpos", "", 1, len(keys[0].get("qpos", "").split()))
    for places, size in counts:
        if len(qpos) == size:
            return _Keyframe(qpos, places)
    what = (
        f"keyframe {keys[0].get('name', '')}".strip()
        + f" has {len(qpos)} numbers for {counts[0][1]} coordinates of joints"
    )
    raise values.error(what, "MuJoCo refuses it too: give one for each, or remove it")


def _counted(root: Element, values: Values) -> tuple[Mapping[Element, int], int]:
    """The index of each joint's first coordinate in ``qpos``, and the length of this: joints of a body before its bodies."""
    places: dict[Element, int] = {}
    size = 0
    for joint in (part for parts in parts_of_bodies(root, values) for part in parts if part.element.tag in JOINTS):
        places[joint.element] = size
        size += {"free": 7, "ball": 4}.get(_kind(joint, values), 1)
    return places, size


def _kind(joint: Part, values: Values) -> str:
    given = values.attributes(joint.element, joint.inherited)
    return "free" if joint.element.tag == "freejoint" else given.get("type", "hinge")


@dataclass
class _UrdfWriter:
    """Writes the URDF element by element.

    ``at``: placements (``pinocchio.SE3``) of links in the world at MuJoCo's initial posture. ``bodies``: links of bodies, by
    name. ``sites``: by name, the link that carries the site, and its placement on the link. ``named``: names of all sites.
    ``initial``: coordinates of joints at this posture, rad or m. ``moves``: their placements and twists. ``home``: their
    coordinates at home. ``added``: joints of effects, which are not written, each with the joint for which it stands: see
    `ADDED_MARK`. ``mocap``: bodies that users move. ``loops``: number of loops.
    """

    values: Values
    masses: Masses
    robot: Element
    keyframe: _Keyframe
    at: dict[str, Any] = field(default_factory=dict)
    bodies: dict[str, str] = field(default_factory=dict)
    sites: dict[str, tuple[str, Any]] = field(default_factory=dict)
    named: frozenset[str] = frozenset()
    initial: dict[str, float] = field(default_factory=dict)
    moves: dict[str, tuple[Any, Floats]] = field(default_factory=dict)
    home: dict[str, Floats] = field(default_factory=dict)
    added: dict[str, str] = field(default_factory=dict)
    mocap: set[str | None] = field(default_factory=set)
    loops: int = 0

    def write(self, root: Element) -> str:
        self.named = frozenset(site.get("name", "") for site in root.iterfind("worldbody//site")) - {""}
        for text in root.iterfind("custom/text"):
            if (called := text.get("name", "")).startswith(ADDED_MARK):
                self.added[called.removeprefix(ADDED_MARK)] = text.get("data", "")
        self.mocap = {body.get("name") for body in root.iter("body") if body.get("mocap") == "true"}
        self._link(WORLD, pin.SE3.Identity())
        self.bodies[WORLD] = WORLD
        for world in root.findall("worldbody"):
            self._children(list(self.values.parts(world, MAIN)), WORLD)
        own = Element("gtpin")
        for element in root.iterfind("equality/*"):
            self._equality(element)
        marked = self._marked(root)
        # Where a loop is not active, its passive joints rest. A file that gtpin wrote has the commands in their order.
        looped = any(element.tag in ("connect", "weld") for element in root.iterfind("equality/*"))
        if looped or marked is not None:
            self._drives(root, own, marked is not None)
        tree = Tree.of(self.robot, self.values.source)
        for name, (link, placement) in self.sites.items():
            self._link(name, self.at[link] * placement)
            add_joint(self.robot, f"{name}_site", "fixed", link, name, placement)
        tip = marked or (TOOL if TOOL in self.at else None)
        guessed = {"guessed": "true"} if tip is None and len(tree.ends) > 1 else {}
        tip = tip or tree.tip
        SubElement(own, "platform", {"link": tip} | guessed)
        for plane in root.iterfind("custom/numeric"):
            if (mark := plane.get("name", "")).startswith(PLANE_MARK):
                normals = self.values.numbers(plane.attrib, "data", "", 3, 9)
                for normal in np.reshape(normals, (-1, 3)):
                    SubElement(own, "plane", loop=mark.removeprefix(PLANE_MARK), normal=exact_text(normal))
        if self.home:
            home = SubElement(own, "home")
            for name, coordinates in self.home.items():
                SubElement(home, "joint", name=name, value=exact_text(coordinates))
        options = root.findall("option")
        given = [option for option in options if option.get("gravity")]
        flags = [flag.get("gravity") for option in options for flag in option.findall("flag") if flag.get("gravity")]
        if flags[-1:] == ["disable"]:
            SubElement(own, "gravity", xyz=exact_text(np.zeros(3)))
        elif given:
            SubElement(own, "gravity", xyz=exact_text(self.values.numbers(given[-1].attrib, "gravity", "", 3)))
        self.robot.append(own)
        self.masses.warn()
        lifted = [body.get("name", "a body") for body in root.iter("body") if body.get("gravcomp", "0").strip("0. ")]
        if lifted:
            names = listed(lifted, SHOWN)
            warn(f"{self.values.source}: gravcomp is not read, gravity acts on the whole mass: bodies {names}")
        for name in sorted(self.named & self.bodies.keys() - {WORLD}):
            what = f"a site and a body are called {name}: the link {name} is the site, and the link of the body is"
            warn(f"{self.values.source}: {what} {self.bodies[name]}")
        indent(self.robot)
        return tostring(self.robot, encoding="unicode")

    def _marked(self, root: Element) -> str | None:
        """The link that the file names as the TCP, if it names one."""
        marks = [text.get("data", "") for text in root.iterfind("custom/text") if text.get("name") == TCP_MARK]
        if not marks:
            return None
        link = marks[-1] if marks[-1] in self.sites else self.bodies.get(marks[-1])
        if link is None:
            what = f"{TCP_MARK} names {marks[-1]!r}, which is no body and no site"
            raise self.values.error(what, "mend <custom>")
        return link

    # ------------------------------------------------------------------------------------------------ bodies

    def _children(self, parts: list[Part], link: str) -> None:
        for part in parts:
            if part.element.tag == "site":
                given = self.values.attributes(part.element, part.inherited)
                if (name := given.get("name", "")) in self.sites:
                    raise self.values.error(f"two sites are called {name}", "name each once")
                if name:
                    self.sites[name] = (link, part.frame * self.values.placement(given))
            # A body with the name of its joint is a motor or a crank.
            elif part.element.tag == "body" and part.element.get("name") not in self.added:
                self._body(part, link)

    def _body(self, part: Part, parent: str) -> None:
        body = part.element
        name = body.get("name") or self._free(f"body{len(self.at)}")
        if name in self.bodies:
            raise self.values.error(f"two bodies are called {name}", "name each once")
        link = self._free(f"{name}_body") if name in self.named else name
        self.bodies[name] = link
        placement = part.frame * self.values.placement(body.attrib)
        pose = self.at[parent] * placement
        parts = list(self.values.parts(body, body.get("childclass", part.inherited)))
        joints = [one for one in parts if one.element.tag in JOINTS]
        joints = [one for one in joints if one.element.get("name") not in self.added]
        kinds = [_kind(joint, self.values) for joint in joints]
        if kinds == FLOATING:
            joints, kinds = joints[-1:], ["free"]
        before, above = pin.SE3(placement), parent
        for number, (joint, kind) in enumerate(zip(joints, kinds, strict=True)):
            given = self.values.attributes(joint.element, joint.inherited)
            called = given.get("name") or (f"{name}_joint" if len(joints) == 1 else f"{name}_joint{number + 1}")
            pos = joint.frame.act(self.values.numbers(given, "pos", "0 0 0", 3))
            last = number == len(joints) - 1 and (kind == "free" or not pos.any())
            child = link if last else self._free(f"{called}_frame")
            at = pin.SE3.Identity() if last else pin.SE3(np.eye(3), pos)
            self._link(child, pose if last else pose * at)
            self._moving(called, given, kind, joint, above, child, before * at)
            before, above = at.inverse(), child
        if above != link:
            self._link(link, pose)
            add_joint(self.robot, f"{name}_fixed", "fixed", above, link, before)
        element = next(element for element in self.robot.findall("link") if element.get("name") == link)
        add_inertia(element, self.masses.inertia(name, parts))
        self._children(parts, link)

    def _moving(
        self, name: str, given: dict[str, str], kind: str, part: Part, parent: str, child: str, origin: Any
    ) -> None:
        if kind == "free":
            add_joint(self.robot, name, "floating", parent, child, origin)
            if self.keyframe.places and _kind(part, self.values) == "free":
                x, y, z, qw, *vector = self.keyframe.at(part.element, 7)
                there = origin.inverse() * pin.XYZQUATToSE3(np.array([x, y, z, *vector, qw]))
                self.home[name] = pin.SE3ToXYZQUAT(there)
            return
        if kind not in ("hinge", "slide"):
            raise self.values.error(f"joint {name} is of type {kind}", "use hinge and slide joints")
        unit = self.values.angle if kind == "hinge" else 1.0
        axis = part.frame.rotation @ self.values.unit(self.values.numbers(given, "axis", "0 0 1", 3), "axis")
        start = float(self.values.numbers(given, "ref", "0", 1)[0]) * unit
        twist = np.concatenate([np.zeros(3), axis] if kind == "hinge" else [axis, np.zeros(3)])
        at_zero = origin * pin.exp6(-start * twist)
        limited = given.get("limited", "auto")
        if limited == "auto":
            limited = "true" if self.values.limits and "range" in given else "false"
        lower, upper = self.values.numbers(given, "range", "0 0", 2) * unit if limited == "true" else (0.0, 0.0)
        turning = "revolute" if limited == "true" else "continuous"
        joint = add_joint(self.robot, name, turning if kind == "hinge" else "prismatic", parent, child, at_zero)
        SubElement(joint, "axis", xyz=exact_text(axis))
        # A range of zero width means no range: URDF has no prismatic joint without a range.
        SubElement(joint, "limit", lower=repr(float(lower)), upper=repr(float(upper)), effort="0", velocity="0")
        self.initial[name], self.moves[name] = start, (at_zero, twist)
        if self.keyframe.places:
            self.home[name] = self.keyframe.at(part.element, 1)
        elif start and (lower <= start <= upper or limited != "true"):
            self.home[name] = np.array([start])

    def _drives(self, root: Element, own: Element, by_gtpin: bool) -> None:
        """Write the joints that ``<actuator>`` drives, once each: in a robot with loops not all joints can be commanded.

        ``by_gtpin``: gtpin wrote the file: ranges of joints are of commands, from which drive scales and effects make others.
        """
        tied = {
            joint.get("name")
            for joint in self.robot.findall("joint")
            if joint.find("mimic") is not None or joint.get("type") == "fixed"
        }
        joints, scaled = {str(joint.get("name")): joint for joint in self.robot.findall("joint")}, []
        for drive in root.iterfind("actuator/*"):
            name = drive.get("joint", "")
            name = self.added.get(name, name)
            if name not in self.initial or name in tied:
                continue
            if all(name != before.get("joint") for before in own.findall("actuator")):
                SubElement(own, "actuator", joint=name)
            limit = joints[name].find("limit")
            if by_gtpin and drive.get("ctrlrange") and limit is not None:
                lower, upper = self.values.numbers(drive.attrib, "ctrlrange", "", 2)
                limit.attrib.update(lower=repr(float(lower)), upper=repr(float(upper)))
            if by_gtpin and drive.get("gear", "1.0") != "1.0":
                scaled.append(f"scale of {name}")
        if without := [*scaled, *(name for name in self.added if "_crank_" not in name)]:
            what = f"the geometry is read without drive scales and effects: {listed(without, SHOWN)}"
            warn(f"{self.values.source}: {what}; give the model's folder")

    # ------------------------------------------------------------------------------------------------ equalities

    def _equality(self, element: Element) -> None:
        """Write an equality constraint, if it is active: a loop, a joint that follows another, or one that does not move."""
        given = self.values.attributes(element, MAIN, "equality")
        if given.get("active", "true") != "true":
            return
        # Where there are joints of effects, a tendon is a curve by which a joint follows another.
        if self.added.keys() & {given.get("joint1"), given.get("joint2")} or (self.added and element.tag == "tendon"):
            return
        if element.tag in ("connect", "weld"):
            if held := {given.get("body1"), given.get("body2")} & self.mocap:
                warn(f"{self.values.source}: equality/{element.tag} of mocap bodies is left out: {held.pop()}")
                return
            self._connect(given, element.tag)
        elif element.tag == "joint":
            self._tie(given)
        else:
            what = f"equality/{element.tag} {given.get('name', '')}".strip() + " is not read"
            raise self.values.error(what, "use connect, weld, or joint")

    def _connect(self, given: dict[str, str], tag: str) -> None:
        """Write a loop: two points that coincide, of two bodies or sites; of a ``weld`` two frames."""
        self.loops += 1
        name = given.get("name", f"{tag}{self.loops}")
        if "site1" in given or "site2" in given:
            ends = [self.sites.get(given.get(key, ""), ("", None)) for key in ("site1", "site2")]
            missing = next((given.get(f"site{i + 1}", "") for i, (_, at) in enumerate(ends) if at is None), None)
        else:
            names = given.get("body1", ""), given.get("body2", WORLD)
            missing = next((body for body in names if body not in self.bodies), None)
            if missing is None:
                first, second = (self.bodies[body] for body in names)
                place = self.values.numbers(given, "anchor", "0 0 0" if tag == "weld" else "", 3)
                anchor = pin.SE3(np.eye(3), place)
                if tag == "weld":  # the frame that they share: with ``relpose``, else in the initial posture
                    x, y, z, *quaternion = self.values.numbers(given, "relpose", "0 1 0 0 0 0 0", 7)
                    relative = self.at[first].actInv(self.at[second])
                    if any(quaternion):
                        w, *vector = self.values.unit(np.array(quaternion), "relpose")
                        relative = pin.XYZQUATToSE3(np.array([x, y, z, *vector, w]))
                    ends = [(first, relative * anchor), (second, anchor)]
                else:  # the point at which they meet in the initial posture
                    ends = [(first, anchor), (second, self.at[second].actInv(self.at[first] * anchor))]
        if missing is not None:
            raise self.values.error(f"{tag} {name} of unknown {missing!r}", "name two bodies or sites")
        loop = SubElement(self.robot, "loop_joint", name=name, type="fixed" if tag == "weld" else "spherical")
        for key, (link, at) in zip(("link1", "link2"), ends, strict=True):
            end = SubElement(loop, key, link=link, xyz=exact_text(at.translation))
            if tag == "weld":
                end.set("rpy", exact_text(pin.rpy.matrixToRpy(at.rotation)))

    def _tie(self, given: dict[str, str]) -> None:
        """Let a joint follow another by ``<mimic>``; without another one, fix it."""
        joints = {joint.get("name", ""): joint for joint in self.robot.findall("joint")}
        follower, master = given.get("joint1", ""), given.get("joint2")
        poly = np.array([0.0, 1.0, 0.0, 0.0, 0.0])
        own = self.values.numbers(given, "polycoef", "0 1 0 0 0", 1, 5)
        poly[: len(own)] = own
        hint = "give joint1 and joint2, and a polycoef of two numbers and zeros"
        unknown = [name for name in (follower, master) if name is not None and name not in self.initial]
        if unknown:
            what = f"equality/joint of {follower or 'no joint'}: no hinge or slide is called {unknown[0]!r}"
            raise self.values.error(what, hint)
        joint = joints[follower]
        if joint.find("mimic") is not None or joint.get("type") == "fixed":
            what = f"two equality constraints of joint {follower}"
            raise self.values.error(what, "keep one")
        if master is None:
            origin, twist = self.moves[follower]
            joint.set("type", "fixed")
            for part in [part for part in joint if part.tag in ("axis", "limit")]:
                joint.remove(part)
            set_origin(joint, origin * pin.exp6((self.initial[follower] + poly[0]) * twist))
            return
        if poly[2:].any():
            raise self.values.error(f"equality/joint of {follower} is a curve", hint)
        offset = self.initial[follower] + poly[0] - poly[1] * self.initial[master]
        SubElement(joint, "mimic", joint=master, multiplier=repr(float(poly[1])), offset=repr(float(offset)))

    # ------------------------------------------------------------------------------------------------ elements

    def _free(self, name: str) -> str:
        """A name for a link that the file has no body and no site for."""
        while name in self.at or name in self.bodies or name in self.named:
            name += "_"
        return name

    def _link(self, name: str, placement: Any) -> None:
        if name in self.at:
            raise self.values.error(f"two links would be called {name}", "rename the body or site")
        SubElement(self.robot, "link", name=name)
        self.at[name] = placement
