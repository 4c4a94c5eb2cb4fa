"""Values of MJCF attributes: numbers, default classes, units of angles, orientations, and the mass of bodies.

MuJoCo, XML reference: https://mujoco.readthedocs.io/en/stable/XMLreference.html (compiler, default, body, inertial, geom).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import RobotError

Floats = npt.NDArray[np.float64]
DENSITY = 1000.0
"""Density, kg/m3, of geoms that give neither mass nor density: MuJoCo's default."""


@dataclass(frozen=True)
class Values:
    """How an MJCF's attributes are read: its ``<compiler>`` and its ``<default>`` classes.

    Parameters
    ----------
    defaults
        Default attributes, by class and tag. The class ``main`` is that of elements without a class.
    angle
        The file's unit of angles, rad.
    euler
        Order of Euler angles: lower case about moving axes, upper case about fixed ones.
    limits
        Whether a joint with a range is limited where it has no attribute ``limited``.
    """

    source: str
    defaults: Mapping[str, Mapping[str, Mapping[str, str]]] = field(default_factory=dict)
    angle: float = math.pi / 180.0
    euler: str = "xyz"
    limits: bool = True

    @staticmethod
    def of(root: Element, source: str) -> Values:
        """Read an MJCF's compiler options and defaults."""
        options: dict[str, str] = {}
        for compiler in root.findall("compiler"):
            options |= compiler.attrib
        found: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        for element in root.findall("default"):
            _classes(element, "main", found)
        euler = options.get("eulerseq", "xyz")
        if len(euler) != 3 or not set(euler.lower()) <= set("xyz"):
            raise RobotError(f'eulerseq="{euler}"', file=source, hint="give three letters of x y z X Y Z")
        return Values(
            source,
            found,
            1.0 if options.get("angle") == "radian" else math.pi / 180.0,
            euler,
            options.get("autolimits", "true") == "true",
        )

    def attributes(self, element: Element, inherited: str) -> dict[str, str]:
        """An element's attributes with those of its class, or of the class that its body gives its children."""
        chosen = self.defaults.get(element.get("class", inherited), self.defaults["main"])
        return {**chosen.get(element.tag, {}), **element.attrib}

    def numbers(
        self, attributes: Mapping[str, str], key: str, default: str, least: int, most: int | None = None
    ) -> Floats:
        """The numbers of an attribute: at least ``least`` and at most ``most`` of them (None: exactly ``least``).

        Raises
        ------
        RobotError
            If there are fewer or more, or one is not a finite number.
        """
        text = attributes.get(key, default)
        try:
            values = np.array([float(word) for word in text.split()])
        except ValueError:
            values = np.array([np.nan])
        if not least <= len(values) <= (most or least) or not np.isfinite(values).all():
            raise RobotError(f'{key}="{text[:60]}"', file=self.source, hint=f"give {least} finite numbers")
        return values

    def placement(self, attributes: Mapping[str, str]) -> Any:
        """The ``pinocchio.SE3`` of an element's position (m) and orientation in its parent's frame."""
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
            z = self.unit(self.numbers(given, "zaxis", "", 3), "zaxis")
            return np.asarray(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z).matrix())
        w, x, y, z = self.unit(self.numbers(given, "quat", "1 0 0 0", 4), "quat")
        return np.asarray(pin.Quaternion(w, x, y, z).matrix())

    def unit(self, vector: Floats, key: str) -> Floats:
        """A vector divided by its length.

        Raises
        ------
        RobotError
            If its length is zero.
        """
        length = float(np.linalg.norm(vector))
        if length < 1e-12:
            raise RobotError(f"{key} of no length", file=self.source, hint="give a direction")
        return vector / length

    def inertia(self, body: Element, inherited: str) -> Any:
        """The ``pinocchio.Inertia`` of a body in its frame: that of its ``<inertial>``, else the sum of its geoms'.

        A mesh with a mass counts as a point mass. A mesh without a mass is left out, because its volume is not known.
        """
        given = body.find("inertial")
        if given is not None:
            at = self.placement(given.attrib)
            if "fullinertia" in given.attrib:
                xx, yy, zz, xy, xz, yz = self.numbers(given.attrib, "fullinertia", "", 6)
                matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            else:
                matrix = np.diag(self.numbers(given.attrib, "diaginertia", "0 0 0", 3))
            own = pin.Inertia(float(self.numbers(given.attrib, "mass", "", 1)[0]), np.zeros(3), matrix)
            return at.act(own)
        total = pin.Inertia.Zero()
        for geom in body.findall("geom"):
            total = total + self._geom(self.attributes(geom, inherited))
        return total

    def _geom(self, geom: Mapping[str, str]) -> Any:
        shape, at = geom.get("type", "sphere"), self.placement(geom)
        size = self.numbers(geom, "size", "0", 1, 3)
        if (size < 0.0).any():
            raise RobotError(f'size="{geom["size"]}" of a {shape}', file=self.source, hint="sizes are positive, m")
        if "fromto" in geom:
            ends = self.numbers(geom, "fromto", "", 6)
            along = ends[3:] - ends[:3]
            turn = self._rotation({"zaxis": " ".join(map(repr, along.tolist()))})
            at = pin.SE3(turn, (ends[3:] + ends[:3]) / 2.0)
            size = np.array(
                [size[0], *([size[0]] if shape in ("box", "ellipsoid") else []), np.linalg.norm(along) / 2.0]
            )
        solid = _solid(shape, size)
        if "mass" in geom:
            mass = float(self.numbers(geom, "mass", "", 1)[0])
            own = pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)) if solid is None else mass * solid[1])
        elif solid is None:
            return pin.Inertia.Zero()
        else:
            mass = solid[0] * float(self.numbers(geom, "density", repr(DENSITY), 1)[0])
            own = pin.Inertia(mass, np.zeros(3), mass * solid[1])
        return at.act(own)


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


def _solid(shape: str, size: Floats) -> tuple[float, Floats] | None:
    """Volume, m3, and inertia about the centre over the mass, (3, 3), m2, of a homogeneous solid; None for other shapes."""
    if shape == "sphere":
        r = size[0]
        return 4.0 / 3.0 * math.pi * r**3, 0.4 * r**2 * np.eye(3)
    if shape in ("box", "ellipsoid") and len(size) == 3:
        x, y, z = size**2
        diagonal = np.diag([y + z, x + z, x + y])
        return (
            (8.0 * size.prod(), diagonal / 3.0)
            if shape == "box"
            else (4.0 / 3.0 * math.pi * size.prod(), diagonal / 5.0)
        )
    if shape in ("cylinder", "capsule") and len(size) >= 2:
        r, h = size[0], size[1]  # h is half the length
        tube, caps = math.pi * r**2 * 2.0 * h, 4.0 / 3.0 * math.pi * r**3 if shape == "capsule" else 0.0
        across = tube * (r**2 / 4.0 + h**2 / 3.0) + caps * (0.4 * r**2 + h**2 + 0.75 * h * r)
        along = tube * r**2 / 2.0 + caps * 0.4 * r**2
        return tube + caps, np.diag([across, across, along]) / (tube + caps)
    return None
