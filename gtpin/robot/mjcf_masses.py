"""Masses of an MJCF's bodies: of ``<inertial>``, or of their geoms, and what ``<compiler>`` does to them.

MuJoCo, XML reference: compiler (inertiafromgeom, inertiagrouprange, boundmass, boundinertia, balanceinertia, settotalmass).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from gtpin.errors import warn
from gtpin.robot.mjcf_values import MAIN, Part, Values
from gtpin.typing import Floats

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
            inertias = [masses.inertia("", parts) for parts in _bodies(root, values)]
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
            names = list(dict.fromkeys(names))
            more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
            warn(f"{self.values.source}: {what}: bodies {', '.join(names[:SHOWN])}{more}")

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
        return self._inertial(given) if given is not None and total.mass == 0.0 else total

    def _inertial(self, part: Part) -> Any:
        given = part.element.attrib
        if "fullinertia" in given:
            xx, yy, zz, xy, xz, yz = self.values.numbers(given, "fullinertia", "", 6)
            matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            matrix = np.diag(self.values.numbers(given, "diaginertia", "0 0 0", 3))
        own = pin.Inertia(float(self.values.numbers(given, "mass", "", 1)[0]), np.zeros(3), matrix)
        return part.frame.act(self.values.placement(given).act(own))

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
        return at.act(pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)) if solid is None else mass * solid[1]))

    def _option(self, key: str, default: str, count: int) -> Floats:
        return self.values.numbers(self.values.compiler, key, default, count)


def _bodies(root: Element, values: Values) -> Iterator[list[Part]]:
    """The elements of each body."""
    waiting = [part for world in root.findall("worldbody") for part in values.parts(world, MAIN)]
    while waiting:
        part = waiting.pop()
        if part.element.tag == "body":
            own = list(values.parts(part.element, part.element.get("childclass", part.inherited)))
            waiting += own
            yield own


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
        if tube + caps == 0.0:
            return None
        across = tube * (r**2 / 4.0 + h**2 / 3.0) + caps * (0.4 * r**2 + h**2 + 0.75 * h * r)
        along = tube * r**2 / 2.0 + caps * 0.4 * r**2
        return tube + caps, np.diag([across, across, along]) / (tube + caps)
    return None
