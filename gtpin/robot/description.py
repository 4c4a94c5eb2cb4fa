"""What a robot's URDF says beyond the tree: loops, actuators, rods, platform, home, gravity, tolerances."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal
from xml.etree.ElementTree import Element, ParseError

import numpy as np
import pinocchio as pin
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray

from gtpin.data.files import read_text, refuse_control
from gtpin.errors import RobotError, warn
from gtpin.extensions import extension
from gtpin.robot.closures import SUFFIX, closes, urdf_with_loops
from gtpin.robot.tree import TOOL, Tree
from gtpin.robot.urdf_elements import numbers_of

Vector = tuple[float, ...]
Kind = Literal["urdf", "mjcf"]

LOOPS = ("spherical", "fixed")
"""Types of ``<loop_joint>``: two points, or two frames, coincide."""

CONVERT = {
    ".sdf": "convert it to an MJCF first, as by sdf2mjcf of the package sdformat-mjcf",
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), "convert it to a URDF first, as by Isaac Sim's URDF exporter"),
}
"""Formats of robots that are not read, with what to do."""

MOST_JOINTS = 300
"""Largest number of joints of a URDF. The parser in C++ is recursive, and a chain of thousands overflows its stack."""

LEVER = 0.1
"""Distance, m, of the points that stand for a loop of type ``fixed``: an angle counts as its arc at this distance. Assumed."""


@dataclass(frozen=True)
class Anchor:
    """A frame fixed to a link: its position (m) and orientation (rad, roll pitch yaw) in the link's frame."""

    link: str
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    def along(self, axis: str) -> Anchor:
        """The anchor at `LEVER` along an axis of this one."""
        way = pin.rpy.rpyToMatrix(*self.rpy)[:, "xy".index(axis)]
        return replace(self, xyz=tuple(float(x) for x in self.xyz + LEVER * way))


@dataclass(frozen=True)
class Loop:
    """Two anchors that coincide: a spherical joint that closes a loop.

    A ``<loop_joint>`` of type ``fixed`` (a weld, Gepetto's ``6d``) is three of them: its origin, and points at `LEVER` along x
    and y of its frame. Three points on two rigid bodies coincide exactly if the frames do. ``point_of``: for the second and
    the third of them the name of the first; empty for others.
    """

    name: str
    anchor1: Anchor
    anchor2: Anchor
    point_of: str = ""


@dataclass(frozen=True)
class ActuatorElement:
    """A driven joint, the name of the site that it moves, and whether its drive scale is declared unknown."""

    joint: str
    site: str
    scale_unknown: bool = False


@dataclass(frozen=True)
class RodElement:
    """A rod: the link that has its end at the carrier joint, the loop that closes there, and its site."""

    link: str
    loop: str
    site: str


@dataclass(frozen=True)
class Home:
    """The assembly mode: commands, and the TCP's pose (m, rotation vector in rad) in the base frame.

    ``link`` is the link that has this pose; None: the TCP that the URDF names.
    """

    q: Vector
    tcp_xyz: Vector
    tcp_rotvec: Vector
    link: str | None = None


@dataclass(frozen=True)
class RobotDescription:
    """A URDF's text, and what its ``<loop_joint>`` and ``<gtpin>`` elements say.

    - ``kind``: what was read: ``urdf`` or ``mjcf``.
    - ``xml``: the URDF as it was read, or what the reader of MJCF makes of one: see :mod:`~gtpin.extensions`.
    - ``source``: where it came from, for messages.
    - ``home``: the home that ``<home>`` names by the pose of its TCP.
    - ``posture``: the home that ``<home>`` names by coordinates of joints, m or rad, in ``<joint name value>`` elements; of a
      floating joint position, m, and quaternion x y z w. Empty where it names none.
    - ``planes``: by loop, (k, 3) unit normals across which it does not close, in the frame of its first anchor, where
      ``<plane>`` names them.
    - ``tree``: its joints and links in document order.
    - ``tcp_guessed``: whether nothing names the TCP, and there are several ends of chains that it can be.
    - ``link_compliance``: typical compliance of such a machine's links, m/N: the typical size of the effect
      ``link_compliance``; None where it is not given.
    """

    kind: Kind
    xml: str
    source: str
    name: str
    loops: tuple[Loop, ...]
    actuators: tuple[ActuatorElement, ...]
    platform: str | None
    tcp: str | None
    rods: tuple[RodElement, ...]
    home: Home | None
    posture: Mapping[str, Vector]
    gravity: Vector
    tolerance: Mapping[str, float]
    link_compliance: float | None
    planes: Mapping[str, NDArray[np.float64]]
    tree: Tree
    tcp_guessed: bool

    def __reduce__(self) -> tuple[Callable[[str, str, Kind], RobotDescription], tuple[str, str, Kind]]:
        return RobotDescription.parse, (self.xml, self.source, self.kind)  # read-only mappings don't pickle

    def error(self, what: str, hint: str) -> RobotError:
        """The error of something wrong in this file."""
        return RobotError(what, file=self.source, hint=hint)

    @staticmethod
    def read(path: Path, keyframe: str = "") -> RobotDescription:
        """Read a URDF or MJCF file, or the YAML of example-parallel-robots beside a URDF.

        ``keyframe``: name of the keyframe of an MJCF that is home; empty: the first.

        Raises `RobotError` if the file can't be read, or is no URDF and no MJCF that gtpin understands. Warns: if angles in
        a URDF look like degrees, a YAML beside it says how its loops close, or an MJCF has what is not read.
        """
        suffix, beside = path.suffix.lower(), path.with_suffix(SUFFIX)
        if suffix in CONVERT:
            raise RobotError(f"{suffix} files are not read", file=path, hint=CONVERT[suffix])
        if suffix == SUFFIX:
            return RobotDescription.parse(urdf_with_loops(path, parse_xml), source=str(path))
        text = read_text(path, RobotError, hint="give the path of a URDF or MJCF file")
        described = RobotDescription.parse(text, source=str(path), keyframe=keyframe)
        if described.kind == "urdf":
            warn_of_degrees(parse_xml(text, str(path)), str(path))
            if not described.loops and closes(beside):
                warn(f"{path}: {beside.name} beside it says how its loops close: they are read")
                return RobotDescription.read(beside)
        return described

    @staticmethod
    def parse(xml: str, source: str = "URDF", kind: Kind = "urdf", keyframe: str = "") -> RobotDescription:
        """Read a URDF, or an MJCF, from its text; see :meth:`read`. ``kind``: format of the file that the text came from."""
        root, xml = parse_xml(xml, source), xml.lstrip()
        if root.tag == "mujoco":
            return RobotDescription.parse(extension("gtpin.readers", "mjcf")(root, source, keyframe), source, "mjcf")
        if root.tag != "robot":
            hint = CONVERT.get(f".{root.tag}", "a URDF's is <robot>, an MJCF's <mujoco>")
            raise RobotError(f"the outer element is <{root.tag}>", file=source, hint=hint)
        reader, joints = _AttributeReader(source), len(root.findall("joint"))
        if keyframe:
            raise reader.error(f"a URDF has no keyframe {keyframe!r}", "give home as commands")
        if root.find("constraint") is not None:
            raise reader.error("<constraint> is not read", "close the loop by <loop_joint>: see docs/own_machine.md")
        refuse_xacro(root, source)
        check_masses(root, source)
        if joints > MOST_JOINTS:
            raise reader.error(f"{joints} joints", f"a robot has {MOST_JOINTS} joints at most")
        loops = tuple(loop for element in root.findall("loop_joint") for loop in reader.loops(element))
        own = reader.only(root, "gtpin")
        own = Element("gtpin") if own is None else own
        platform, home = own.find("platform"), reader.only(own, "home")
        posture = {reader.text(e, "name"): reader.numbers(e, "value", None) for e in own.findall("home/joint")}
        gravity, tolerance, compliance = (own.find(tag) for tag in ("gravity", "tolerance", "compliance"))
        tree = Tree.of(root, source)
        several = len(tree.ends) > 1 and tree.tip != TOOL
        return RobotDescription(
            kind=kind,
            xml=xml,
            source=source,
            name=root.get("name", "robot"),
            loops=loops,
            actuators=tuple(reader.actuator(e) for e in own.findall("actuator")),
            platform=None if platform is None else reader.text(platform, "link"),
            tcp=None if platform is None else platform.get("tcp"),
            rods=tuple(
                RodElement(reader.text(e, "link"), reader.text(e, "loop"), e.get("site", reader.text(e, "link")))
                for e in own.findall("rod")
            ),
            home=None if home is None or posture else reader.home(home),
            posture=MappingProxyType(posture),
            gravity=(0.0, 0.0, -9.81) if gravity is None else reader.numbers(gravity, "xyz", 3),
            tolerance=MappingProxyType({} if tolerance is None else reader.positive(tolerance)),
            link_compliance=None if compliance is None else reader.compliance(compliance),
            planes=MappingProxyType(reader.planes(own, {loop.name for loop in loops})),
            tree=tree,
            tcp_guessed=several if platform is None else platform.get("guessed") == "true",
        )


def parse_xml(xml: str, source: str) -> Element:
    """Parse XML from an untrusted file safely. Blank lines before its first element do not matter, as to Pinocchio.

    Raises `RobotError` if the text is not well-formed XML, or uses entities.
    """
    text = xml.lstrip()
    try:
        # Bytes, because a declared encoding in a text is an error to the parser.
        root: Element = fromstring(text.encode("utf-8"))
    except ParseError as error:
        if "unbound prefix" in str(error) and "<xacro:" in text:
            raise RobotError(XACRO, file=source, hint=EXPAND) from None
        row = xml[: len(xml) - len(text)].count("\n") + error.position[0]
        raise RobotError(f"not well-formed XML ({error})", file=source, row=row, hint="mend it there") from None
    except (DefusedXmlException, ValueError, LookupError) as error:
        raise RobotError(f"XML that can't be accepted ({error})", file=source, hint="write plain UTF-8 XML") from None
    refuse_control([value for element in root.iter() for value in element.attrib.values()], source, RobotError)
    return root


@dataclass(frozen=True)
class _AttributeReader:
    """Reads and checks attributes of the URDF's elements; its errors name the file ``source``."""

    source: str

    def error(self, what: str, hint: str) -> RobotError:
        return RobotError(what, file=self.source, hint=hint)

    def only(self, parent: Element, tag: str) -> Element | None:
        elements = parent.findall(tag)
        if len(elements) > 1:
            raise self.error(f"there are two <{tag}> elements", "keep one")
        return elements[0] if elements else None

    def text(self, element: Element, key: str) -> str:
        value = element.get(key)
        if not value:
            raise self.error(f"<{element.tag}> lacks the attribute {key}", f'write {key}="..."')
        return value

    def numbers(self, element: Element, key: str, count: int | None) -> Vector:
        text = self.text(element, key)
        values = numbers_of(text)
        if not all(map(math.isfinite, values)) or (count is not None and len(values) != count):
            wanted = "finite numbers" if count is None else f"{count} finite numbers"
            raise self.error(f'<{element.tag} {key}="{text}">', f"give {wanted}")
        return values

    def actuator(self, element: Element) -> ActuatorElement:
        joint, scale = self.text(element, "joint"), element.get("scale")
        if scale not in (None, "unknown"):
            raise self.error(f'<actuator scale="{scale}">', 'write scale="unknown", or leave it out')
        return ActuatorElement(joint, element.get("site", joint), scale is not None)

    def anchor(self, loop: Element, tag: str) -> Anchor:
        element = loop.find(tag)
        if element is None:
            raise self.error(f"loop {loop.get('name', '')} lacks <{tag}>", "give both <link1> and <link2>")
        given = {key: self.numbers(element, key, 3) for key in ("xyz", "rpy") if element.get(key)}
        return Anchor(self.text(element, "link"), **given)

    def loops(self, element: Element) -> Iterator[Loop]:
        name, kind = self.text(element, "name"), element.get("type", "spherical")
        if kind not in LOOPS:
            planar = (
                "a loop whose joints turn about parallel axes is recognised as planar, and closed in its plane only"
            )
            hint = f'write type="spherical" (two points coincide) or type="fixed" (two frames); {planar}'
            raise self.error(f"loop {name} is of type {kind}", hint)
        one, other = self.anchor(element, "link1"), self.anchor(element, "link2")
        yield Loop(name, one, other)
        for axis in "xy" if kind == "fixed" else "":
            yield Loop(f"{name}.{axis}", one.along(axis), other.along(axis), point_of=name)

    def home(self, element: Element) -> Home:
        xyz, rotvec = self.numbers(element, "tcp_xyz", 3), self.numbers(element, "tcp_rotvec", 3)
        return Home(self.numbers(element, "q", None), xyz, rotvec, element.get("link"))

    def planes(self, own: Element, loops: set[str]) -> dict[str, NDArray[np.float64]]:
        found: dict[str, list[NDArray[np.float64]]] = {}
        for element in own.findall("plane"):
            name, normal = self.text(element, "loop"), np.array(self.numbers(element, "normal", 3))
            if name not in loops or not normal.any():
                what = f"of {name} has a normal of no length" if name in loops else f"of no loop {name}"
                raise self.error(f"<plane> {what}", "name a <loop_joint> and the normal of its plane")
            found.setdefault(name, []).append(normal / np.linalg.norm(normal))
        return {name: np.array(normals) for name, normals in found.items()}

    def compliance(self, element: Element) -> float:
        self.text(element, "link")
        return self.positive(element)["link"]

    def positive(self, element: Element) -> dict[str, float]:
        values = {kind: self.numbers(element, kind, 1)[0] for kind in element.attrib}
        for kind, value in values.items():
            if value <= 0.0:
                raise self.error(f"{element.tag} {kind} is {value:g}", "give a positive value")
        return values


XACRO = "this is a xacro file"
EXPAND = "expand it first (xacro FILE > robot.urdf)"
UNEXPANDED = re.compile(r"\$\{|\$\((arg|cwd|dirname|env|eval|find|optenv) ")
FULL_TURN = 2.0 * math.pi


def refuse_xacro(root: Element, source: str) -> None:
    """Refuse a file that xacro has still to expand: with its elements or attributes, or ``${...}`` in a link or joint.

    A file that only declares the namespace of xacro is what xacro writes.

    Raises `RobotError` if it is one.
    """
    parts = [root, *(element for part in root if part.tag in ("link", "joint") for element in part.iter())]
    names = [str(name) for element in root.iter() for name in (element.tag, *element.attrib)]
    values = [value for element in parts for value in element.attrib.values()]
    if any("xacro}" in name for name in names) or any(map(UNEXPANDED.search, values)):
        raise RobotError(XACRO, file=source, hint=EXPAND)


def check_masses(root: Element, source: str) -> None:
    """Refuse links with a mass that is negative or not finite.

    Raises `RobotError` if there is one, with its name. What is no number, Pinocchio reports.
    """
    for link in root.findall("link"):
        mass = link.find("inertial/mass")
        try:
            value = 0.0 if mass is None else float(mass.get("value", "0"))
        except ValueError:
            continue
        if not (math.isfinite(value) and value >= 0.0):
            what = f"the mass of link {link.get('name', '')} is {value:g}"
            raise RobotError(what, file=source, hint="give a mass of 0 or more, kg")


def warn_of_degrees(root: Element, source: str) -> None:
    """Warn of each ``rpy`` with an angle of more than a full turn: URDF has radians."""
    for part in root:
        for element in part.iter():
            if any(abs(angle) > FULL_TURN for angle in numbers_of(element.get("rpy", ""))):
                where = f"{part.tag} {part.get('name', '')}".strip()
                found = f'{source}: {where}: rpy="{element.get("rpy")}"'
                warn(f"{found} is more than a full turn: angles in a URDF are in rad")
