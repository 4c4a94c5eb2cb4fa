"""Values of MJCF attributes: numbers, default classes, units, orientations, frames; included files; objects; masses of bodies.

MuJoCo, XML reference: https://mujoco.readthedocs.io/en/stable/XMLreference.html (compiler, default, body, frame; of masses
inertiafromgeom, inertiagrouprange, boundmass, boundinertia, balanceinertia, settotalmass).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from gtpin.data.files import read_text
from gtpin.errors import RobotError, listed, warn
from gtpin.robot.description import parse_xml
from gtpin.robot.urdf_elements import numbers_of
from gtpin.typing import Floats

MAIN = "main"
"""The default class of elements without a class."""
TURNS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
"""Attributes that give an orientation; an element has one of them."""


@dataclass(frozen=True)
class Part:
    """An element of a body: the class that it inherits, and the ``pinocchio.SE3`` of its ``<frame>`` on the body."""

    element: Element
    inherited: str
    frame: Any


@dataclass(frozen=True)
class Values:
    """How an MJCF's attributes are read: its ``<compiler>`` and its ``<default>`` classes.

    - ``defaults``: default attributes, by class and tag.
    - ``compiler``: attributes of ``<compiler>``.
    - ``angle``: the file's unit of angles, rad.
    - ``euler``: order of Euler angles: lower case about moving axes, upper case about fixed ones.
    - ``limits``: whether a joint with a range is limited where it has no attribute ``limited``.
    """

    source: str
    defaults: Mapping[str, Mapping[str, Mapping[str, str]]] = field(default_factory=dict)
    compiler: Mapping[str, str] = field(default_factory=dict)
    angle: float = math.pi / 180.0
    euler: str = "xyz"
    limits: bool = True

    @staticmethod
    def of(root: Element, source: str) -> Values:
        """Read an MJCF's compiler options and defaults."""
        options: dict[str, str] = {}
        for compiler in root.findall("compiler"):
            options |= compiler.attrib
        if options.get("coordinate", "local") != "local":
            raise RobotError(
                'coordinate="global" is not read', file=source, hint="load and save the file in MuJoCo 2.3.3 or older"
            )
        found: dict[str, dict[str, dict[str, str]]] = {MAIN: {}}
        for element in root.findall("default"):
            _classes(element, MAIN, found)
        euler = options.get("eulerseq", "xyz")
        if len(euler) != 3 or not set(euler.lower()) <= set("xyz"):
            raise RobotError(f'eulerseq="{euler}"', file=source, hint="give three letters of x y z X Y Z")
        return Values(
            source,
            found,
            options,
            1.0 if options.get("angle") == "radian" else math.pi / 180.0,
            euler,
            options.get("autolimits", "true") == "true",
        )

    def error(self, what: str, hint: str) -> RobotError:
        """The error of something wrong in this file."""
        return RobotError(what, file=self.source, hint=hint)

    def attributes(self, element: Element, inherited: str, tag: str = "") -> dict[str, str]:
        """An element's attributes with those of its class, or of the class that its body gives its children.

        ``tag``: the tag under which ``<default>`` has them, if it is not the element's own.

        Raises `RobotError` if no default class has this name.
        """
        name = element.get("class", inherited)
        if name not in self.defaults:
            raise self.error(f"no default class is called {name!r}", "mend class or childclass")
        given = dict(self.defaults[name].get(tag or element.tag, {}))
        if any(
            key in element.attrib for key in TURNS
        ):  # an own orientation replaces the inherited one, however it is given
            given = {key: value for key, value in given.items() if key not in TURNS}
        inherited_size = given.get("size", "").split()
        given |= element.attrib
        if "size" in element.attrib:  # fewer numbers than the class has replace only its first ones
            own = element.attrib["size"].split()
            given["size"] = " ".join([*own, *inherited_size[len(own) :]])
        return given

    def parts(self, parent: Element, inherited: str, frame: Any = None) -> Iterator[Part]:
        """The elements of a body or a worldbody, in the order of the file, also those in its ``<frame>`` elements."""
        frame = pin.SE3.Identity() if frame is None else frame
        for child in parent:
            if child.tag == "frame":
                yield from self.parts(child, child.get("childclass", inherited), frame * self.placement(child.attrib))
            else:
                yield Part(child, inherited, frame)

    def numbers(
        self, attributes: Mapping[str, str], key: str, default: str, least: int, most: int | None = None
    ) -> Floats:
        """The numbers of an attribute: at least ``least`` and at most ``most`` of them (None: exactly ``least``).

        Raises `RobotError` if there are fewer or more, or one is not a finite number.
        """
        text = attributes.get(key, default)
        values = np.array(numbers_of(text))
        if not least <= len(values) <= (most or least) or not np.isfinite(values).all():
            raise self.error(f'{key}="{text[:60]}"', f"give {least} finite numbers")
        return values

    def placement(self, attributes: Mapping[str, str]) -> Any:
        """The ``pinocchio.SE3`` of an element's position (m) and orientation in its parent's frame.

        With ``fromto`` it is that of the middle between the two points, with z from the second one to the first.
        """
        if "fromto" in attributes:
            ends = self.numbers(attributes, "fromto", "", 6)
            return pin.SE3(_turned_to(self.unit(ends[:3] - ends[3:], "fromto")), (ends[3:] + ends[:3]) / 2.0)
        return pin.SE3(self._rotation(attributes), self.numbers(attributes, "pos", "0 0 0", 3))

    def _rotation(self, given: Mapping[str, str]) -> Floats:
        if "axisangle" in given:
            *axis, angle = self.numbers(given, "axisangle", "", 4)
            return np.asarray(pin.exp3(angle * self.angle * self.unit(np.array(axis), "axisangle")))
        if "euler" in given:
            found = np.eye(3)
            for letter, angle in zip(self.euler, self.numbers(given, "euler", "", 3) * self.angle, strict=True):
                turn = pin.exp3(angle * np.eye(3)["xyz".index(letter.lower())])
                found = found @ turn if letter.islower() else turn @ found
            return found
        if "xyaxes" in given:
            values = self.numbers(given, "xyaxes", "", 6)
            x = self.unit(values[:3], "xyaxes")
            y = self.unit(values[3:] - (values[3:] @ x) * x, "xyaxes")
            return np.column_stack([x, y, np.cross(x, y)])
        if "zaxis" in given:
            return _turned_to(self.unit(self.numbers(given, "zaxis", "", 3), "zaxis"))
        w, x, y, z = self.unit(self.numbers(given, "quat", "1 0 0 0", 4), "quat")
        return np.asarray(pin.Quaternion(w, x, y, z).matrix())

    def unit(self, vector: Floats, key: str) -> Floats:
        """A vector divided by its length.

        Raises `RobotError` if its length is zero.
        """
        length = float(np.linalg.norm(vector))
        if length < 1e-12:
            raise self.error(f"{key} of no length", "give a direction")
        return vector / length


def _classes(element: Element, name: str, found: dict[str, dict[str, dict[str, str]]]) -> None:
    """Read a ``<default>`` and those inside it, each with the attributes that it inherits."""
    own = {tag: dict(values) for tag, values in found.get(name, {}).items()}
    for child in element:
        if child.tag != "default":
            own[child.tag] = {**own.get(child.tag, {}), **child.attrib}
    found[name] = own
    for child in element.findall("default"):
        inner = child.get("class", "")
        found[inner] = own
        _classes(child, inner, found)


def _turned_to(direction: Floats) -> Floats:
    """The smallest rotation, (3, 3), that turns z to a unit vector; half a turn about x where this is -z."""
    axis = np.array([-direction[1], direction[0], 0.0])  # z cross direction
    sine = float(np.linalg.norm(axis))
    axis = axis / sine if sine > 1e-10 else np.array([1.0, 0.0, 0.0])
    return np.asarray(pin.exp3(math.atan2(sine, direction[2]) * axis))


def with_includes(root: Element, file: Path) -> None:
    """Replace each ``<include file>`` by the content of that file, as MuJoCo does.

    Paths start at the folder of the main file; where there is no such file, at that of the file with the ``<include>``.

    Raises `RobotError` if an included file can't be read, or is included twice.
    """
    _include(root, file.parent, file.parent, {file.absolute()})


def _include(root: Element, main: Path, own: Path, read: set[Path]) -> None:
    for parent in list(root.iter()):
        if all(child.tag != "include" for child in parent):
            continue
        kept: list[Element] = []
        for child in parent:
            if child.tag != "include":
                kept.append(child)
                continue
            name = child.get("file", "")
            file = main / name if (main / name).exists() else own / name
            if file.absolute() in read:
                raise RobotError("this file is included twice", file=file, hint="include each file once")
            read.add(file.absolute())
            inside = parse_xml(read_text(file, RobotError, hint="mend <include>"), str(file))
            _include(inside, main, file.parent, read)
            kept += inside
        parent[:] = kept


JOINTS = ("joint", "freejoint")
NAMING = ("actuator", "equality", "tendon")
"""Parts of a file that name what belongs to the robot."""


def without_objects(root: Element) -> None:
    """Remove objects: bodies on the world that move, but are not part of the robot.

    Nothing in ``<actuator>``, ``<equality>`` and ``<tendon>`` names an object or what is on it. Where a file has no actuators,
    an object must also float freely. Where all moving bodies would be objects, none is removed.
    """
    on_world = [(place, body) for world in root.findall("worldbody") for place, body in _bodies(world)]
    joints = {body: [element for element in body.iter() if element.tag in JOINTS] for _, body in on_world}
    moving = [(world, body) for world, body in on_world if joints[body]]
    floating = {
        body
        for _, body in moving
        if all(joint.tag == "freejoint" or joint.get("type") == "free" for joint in joints[body])
    }
    parts = [element for tag in NAMING for part in root.findall(tag) for element in part.iter()]
    named = {value for element in parts for key, value in element.attrib.items() if key != "name"}
    driven = any(len(part) for part in root.findall("actuator"))
    objects = [
        (world, body)
        for world, body in moving
        if not named & {element.get("name", "") for element in body.iter()} - {""} and (driven or body in floating)
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


DENSITY = 1000.0
"""Density, kg/m3, of geoms that give neither mass nor density: MuJoCo's default."""
FLAT = ("plane", "hfield")
"""Types of geoms without mass."""
SHOWN = 8
"""Number of names in a warning."""


@dataclass
class Masses:
    """The ``pinocchio.Inertia`` of bodies.

    ``unread``: names of bodies, by what they have that is not read. ``scale``: what ``settotalmass`` multiplies masses by.
    """

    values: Values
    scale: float = 1.0
    unread: dict[str, list[str]] = field(default_factory=dict)

    @staticmethod
    def of(root: Element, values: Values) -> Masses:
        """Masses of all bodies of an MJCF's outer element, also of those that the robot will not have."""
        masses = Masses(values)
        total = float(masses._option("settotalmass", "-1", 1)[0])
        if total > 0.0:
            inertias = [masses.inertia("", parts) for parts in parts_of_bodies(root, values)]
            sum_now = sum(inertia.mass for inertia in inertias)
            masses = Masses(values, total / sum_now if sum_now > 0.0 else 1.0)
        return masses

    def inertia(self, name: str, parts: Sequence[Part]) -> Any:
        """The ``pinocchio.Inertia`` of a body in its frame, from its elements: as MuJoCo makes it.

        Of a mesh neither the volume nor the shape is known: with a mass it counts as a point mass, without one it is left out.

        Raises `RobotError` if a mass is negative.
        """
        found = self._found(name, parts)
        if found.mass < 0.0:
            raise self.values.error(f"the mass of {name} is {found.mass:g}", "give a mass above 0")
        mass = max(found.mass, float(self._option("boundmass", "0", 1)[0]))
        least = float(self._option("boundinertia", "0", 1)[0])
        moments, axes = np.linalg.eigh(found.inertia)
        bounded = np.maximum(moments, least)
        if self.values.compiler.get("balanceinertia") == "true" and 2.0 * bounded.max() > bounded.sum():
            bounded = np.full(3, bounded.mean())
        matrix = found.inertia if (bounded == moments).all() else axes @ np.diag(bounded) @ axes.T
        return pin.Inertia(self.scale * mass, found.lever, self.scale * matrix)

    def warn(self) -> None:
        """Warn of what is not read, with the names of the bodies."""
        for what, names in self.unread.items():
            warn(f"{self.values.source}: {what}: bodies {listed(list(dict.fromkeys(names)), SHOWN)}")

    def _found(self, name: str, parts: Sequence[Part]) -> Any:
        """The inertia that ``<inertial>`` gives, or the sum of the geoms'."""
        given = next((part for part in parts if part.element.tag == "inertial"), None)
        rule = self.values.compiler.get("inertiafromgeom", "auto")
        geoms = [part for part in parts if part.element.tag == "geom"]
        if rule == "false" or (rule != "true" and given is not None):
            geoms = []
        low, high = self._option("inertiagrouprange", "0 5", 2)
        total = pin.Inertia.Zero()
        for part in geoms:
            geom = self.values.attributes(part.element, part.inherited)
            if low <= float(self.values.numbers(geom, "group", "0", 1)[0]) <= high:
                total = total + part.frame.act(self._geom(name, geom))
        if given is None or total.mass != 0.0:
            return total
        own, read = given.element.attrib, self.values.numbers
        if "fullinertia" in own:
            xx, yy, zz, xy, xz, yz = read(own, "fullinertia", "", 6)
            matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            matrix = np.diag(read(own, "diaginertia", "0 0 0", 3))
        inertia = pin.Inertia(float(read(own, "mass", "", 1)[0]), np.zeros(3), matrix)
        return given.frame.act(self.values.placement(own).act(inertia))

    def _geom(self, name: str, geom: Mapping[str, str]) -> Any:
        shape, at = geom.get("type", "sphere"), self.values.placement(geom)
        size = self.values.numbers(geom, "size", "0", 1, 3)
        if (size < 0.0).any():
            raise self.values.error(f'size="{geom["size"]}" of a {shape}', "sizes are positive, m")
        if "fromto" in geom:
            ends = self.values.numbers(geom, "fromto", "", 6)
            across = [size[0]] * (2 if shape in ("box", "ellipsoid") else 1)
            size = np.array([*across, np.linalg.norm(ends[3:] - ends[:3]) / 2.0])
        known = "mesh" not in geom
        solid = _solid(shape, size) if known else None
        density = float(self.values.numbers(geom, "density", repr(DENSITY), 1)[0])
        volume = 0.0 if solid is None else solid[0]
        mass = float(self.values.numbers(geom, "mass", repr(float(volume * density)), 1)[0])
        if mass < 0.0:
            raise self.values.error(f"a geom of {name} has a negative mass", "give a mass above 0")
        weighs = mass > 0.0 or ("mass" not in geom and density > 0.0)
        if solid is None and shape not in FLAT and weighs:
            what = "the masses of meshes are not read (give each body its <inertial>)"
            self.unread.setdefault(what, []).append(name)
        if geom.get("shellinertia") == "true" and weighs:
            self.unread.setdefault("shellinertia is not read, the geoms count as solids", []).append(name)
        return at.act(pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)) if solid is None else mass * solid[1].inertia))

    def _option(self, key: str, default: str, count: int) -> Floats:
        return self.values.numbers(self.values.compiler, key, default, count)


def parts_of_bodies(root: Element, values: Values) -> Iterator[list[Part]]:
    """The elements of each body, in the order in which MuJoCo counts bodies: that of the file, a body before those on it."""
    waiting = [part for world in root.findall("worldbody") for part in values.parts(world, MAIN)][::-1]
    while waiting:
        part = waiting.pop()
        if part.element.tag == "body":
            own = list(values.parts(part.element, part.element.get("childclass", part.inherited)))
            waiting += own[::-1]
            yield own


def _solid(shape: str, size: Floats) -> tuple[float, Any] | None:
    """Volume, m3, and ``pinocchio.Inertia`` of 1 kg of a homogeneous solid; None for other shapes, or without volume."""
    needed = {"sphere": 1, "cylinder": 2, "capsule": 2, "box": 3, "ellipsoid": 3}
    if len(size) < needed.get(shape, 4):
        return None
    r, h = size[0], size[min(1, len(size) - 1)]  # h is half the length
    ball, tube = 4.0 / 3.0 * math.pi, 2.0 * math.pi * r**2 * h
    volume, make, sizes = {
        "sphere": (ball * r**3, pin.Inertia.FromSphere, (r,)),
        "cylinder": (tube, pin.Inertia.FromCylinder, (r, 2.0 * h)),
        "capsule": (tube + ball * r**3, pin.Inertia.FromCapsule, (r, 2.0 * h)),
        "box": (8.0 * size.prod(), pin.Inertia.FromBox, tuple(2.0 * size)),
        "ellipsoid": (ball * size.prod(), pin.Inertia.FromEllipsoid, tuple(size)),
    }[shape]
    return (float(volume), make(1.0, *map(float, sizes))) if volume else None
