"""Writes the URDF of a machine with rods from a sketch: a list of its points and directions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.typing import Floats

Point = Sequence[float] | Floats

PASSIVE = {"lower": "-1.5", "upper": "1.5", "effort": "0", "velocity": "10"}
DRIVEN = {"effort": "5000", "velocity": "3"}
THICK = 0.02
"""Radius of the shapes, m. They are only drawn."""


@dataclass(frozen=True)
class Carrier:
    """What an actuator moves along a track or about an axis.

    - ``site``: its name: ``cart1``, ``arm1``.
    - ``point``: (3,) a point of the track or axis, base frame, m.
    - ``axis``: (3,) its direction, base frame. Positive commands move along it, or turn about it by the right-hand rule.
    - ``range``: lowest and highest command, m or rad.
    - ``turns``: whether it turns instead of sliding.
    - ``mass``: mass, kg, with its centre at ``point``.
    """

    site: str
    point: Point
    axis: Point
    range: tuple[float, float]
    turns: bool = False
    mass: float = 10.0


@dataclass(frozen=True)
class SketchRod:
    """A rod between two spherical joints.

    - ``site``: its name: ``link2a``; for a leg of variable length ``leg1``, which is also the site of its actuator.
    - ``joint``: (3,) its joint on the platform, TCP frame, m.
    - ``seat``: (3,) its carrier joint with all commands zero, base frame, m.
    - ``carrier``: the site of the carrier that moves its carrier joint; None: this joint is on the base.
    - ``range``: for a leg of variable length, its lowest and highest command, m. Its length is that at zero plus its
      command.
    - ``length``: length with all commands zero, m; None: the length that closes the loop at the home posture.
    - ``scale_unknown``: whether the scale of a leg's drive (travel per commanded unit) is unknown, so that every
      calibration identifies it.
    - ``mass``: mass, kg. A rod's centre of mass is at its middle. Half of a leg's mass is on its sliding part.
    """

    site: str
    joint: Point
    seat: Point
    carrier: str | None = None
    range: tuple[float, float] | None = None
    length: float | None = None
    scale_unknown: bool = False
    mass: float = 1.0


@dataclass(frozen=True)
class Sketch:
    """The dimensions of a machine with rods.

    - ``name``: the robot's.
    - ``rods``, ``carriers``: commands are in the order of the carriers, then of the legs of variable length.
    - ``home``: (n,) commands of the home posture.
    - ``T``, ``rotvec``: (3,) position, m, and rotation vector, rad, of the TCP at the home posture, base frame. The frame
      of the platform's link is the TCP frame.
    - ``plate_mass``, ``plate_center``: mass of the platform, kg, and its centre (3,), TCP frame, m.
    - ``tolerance``: 1-sigma manufacturing tolerances by kind of parameter: see :mod:`gtpin.robot.parameters`.
    - ``link_compliance``: typical compliance of such a machine's links, m/N; None: that of :mod:`gtpin.robot.description`.
    - ``note``: a comment at the top of the URDF: where the dimensions come from.
    """

    name: str
    rods: Sequence[SketchRod]
    carriers: Sequence[Carrier] = ()
    home: Sequence[float] = ()
    T: Point = (0.0, 0.0, 0.0)
    rotvec: Point = (0.0, 0.0, 0.0)
    plate_mass: float = 10.0
    plate_center: Point = (0.0, 0.0, 0.0)
    tolerance: Mapping[str, float] = field(default_factory=dict)
    link_compliance: float | None = None
    note: str = ""

    def urdf(self) -> str:
        """The machine's URDF, with its loops and its ``<gtpin>`` element.

        Raises `RobotError` if a rod names a carrier that is not there, or ``home`` does not have one command for each
        actuator.
        """
        return _Writer(self).text()


class _Writer:
    """Writes the URDF of one sketch."""

    def __init__(self, sketch: Sketch) -> None:
        self.sketch = sketch
        self.carriers = {carrier.site: carrier for carrier in sketch.carriers}
        self.sites = [*self.carriers, *(rod.site for rod in sketch.rods if rod.range is not None)]
        if len(sketch.home) != len(self.sites):
            raise RobotError(
                f"{sketch.name}: home has {len(sketch.home)} commands for {len(self.sites)} actuators",
                hint="give one for each carrier and each leg of variable length",
            )
        self.home = dict(zip(self.sites, map(float, sketch.home), strict=True))
        self.T, self.R = np.array(sketch.T, dtype=float), np.array(pin.exp3(np.array(sketch.rotvec, dtype=float)))
        self.root = Element("robot", name=sketch.name)

    def text(self) -> str:
        self._base_and_carriers()
        self._platform()
        for rod in self.sketch.rods:
            self._rod(rod)
        self._gtpin()
        indent(self.root)
        note = f"<!-- {self.sketch.note} -->\n" if self.sketch.note else ""
        return f'<?xml version="1.0" encoding="utf-8"?>\n{note}{tostring(self.root, encoding="unicode")}\n'

    def _base_and_carriers(self) -> None:
        base = SubElement(self.root, "link", name="base")
        for carrier in self.sketch.carriers:
            axis = np.array(carrier.axis, dtype=float) / np.linalg.norm(carrier.axis)
            point = np.array(carrier.point, dtype=float)
            if not carrier.turns:
                ends = [point + end * axis for end in carrier.range]
                _cylinder(base, ends[0], ends[1], 2.0 * THICK)
            link = _link(self.root, carrier.site, carrier.mass, np.zeros(3), np.full(3, 0.025 * carrier.mass))
            for rod in self.sketch.rods:
                if rod.carrier == carrier.site:
                    _cylinder(link, np.zeros(3), np.array(rod.seat, dtype=float) - point, THICK)
            kind = "revolute" if carrier.turns else "prismatic"
            joint = _joint(self.root, f"{carrier.site}_drive", kind, "base", carrier.site, point)
            _axis(joint, axis, carrier.range, DRIVEN)

    def _platform(self) -> None:
        mass = self.sketch.plate_mass
        center = np.array(self.sketch.plate_center, dtype=float)
        plate = _link(self.root, "platform", mass, center, np.full(3, 0.025 * mass))
        for rod in self.sketch.rods:
            _cylinder(plate, center, np.array(rod.joint, dtype=float), THICK)
        rpy = pin.rpy.matrixToRpy(self.R)
        _joint(self.root, "platform_pose", "floating", "base", "platform", self.T, rpy)

    def _rod(self, rod: SketchRod) -> None:
        seat, joint = np.array(rod.seat, dtype=float), np.array(rod.joint, dtype=float)
        at_home = self._seat_at_home(rod, seat)
        away = self.R.T @ (at_home - self.T) - joint
        span = float(np.linalg.norm(away))
        stretch = 0.0 if rod.range is None else self.home[rod.site]
        length = span - stretch if rod.length is None else rod.length
        cross, hung = f"{rod.site}_cross", rod.site if rod.range is None else f"{rod.site}_tube"
        SubElement(self.root, "link", name=cross)
        pitch = _joint(self.root, f"{rod.site}_pitch", "revolute", "platform", cross, joint, _along_z(away / span))
        _axis(pitch, np.array([1.0, 0.0, 0.0]), None, PASSIVE)
        part = rod.mass if rod.range is None else rod.mass / 2.0
        middle = 0.5 * length if rod.range is None else 0.3 * length
        _bar(self.root, hung, part, middle, length if rod.range is None else 0.6 * length)
        yaw = _joint(self.root, f"{rod.site}_yaw", "revolute", cross, hung, np.zeros(3))
        _axis(yaw, np.array([0.0, 1.0, 0.0]), None, PASSIVE)
        if rod.range is not None:
            _bar(self.root, rod.site, part, 0.7 * length, 0.6 * length)
            slide = _joint(self.root, f"{rod.site}_drive", "prismatic", hung, rod.site, np.zeros(3))
            _axis(slide, np.array([0.0, 0.0, 1.0]), rod.range, DRIVEN)
        loop = SubElement(self.root, "loop_joint", name=f"{rod.site}_ball", type="spherical")
        SubElement(loop, "link1", link=rod.site, xyz=_text([0.0, 0.0, length]), rpy="0 0 0")
        carrier = None if rod.carrier is None else self.carriers[rod.carrier]
        local = seat if carrier is None else seat - np.array(carrier.point, dtype=float)
        SubElement(loop, "link2", link=rod.carrier or "base", xyz=_text(local), rpy="0 0 0")

    def _seat_at_home(self, rod: SketchRod, seat: Floats) -> Floats:
        if rod.carrier is None:
            return seat
        if rod.carrier not in self.carriers:
            raise RobotError(f"{rod.site} sits on {rod.carrier}, which is not there", hint="name one of the carriers")
        carrier = self.carriers[rod.carrier]
        q, axis = self.home[rod.carrier], np.array(carrier.axis, dtype=float) / np.linalg.norm(carrier.axis)
        if not carrier.turns:
            return np.asarray(seat + q * axis)
        point = np.array(carrier.point, dtype=float)
        return np.asarray(point + pin.exp3(q * axis) @ (seat - point))

    def _gtpin(self) -> None:
        own = SubElement(self.root, "gtpin")
        unknown = {rod.site for rod in self.sketch.rods if rod.scale_unknown}
        for site in self.sites:
            element = SubElement(own, "actuator", joint=f"{site}_drive", site=site)
            if site in unknown:
                element.set("scale", "unknown")
        SubElement(own, "platform", link="platform")
        for rod in self.sketch.rods:
            SubElement(own, "rod", link=rod.site, loop=f"{rod.site}_ball", site=rod.site)
        q, rotvec = _text(list(self.home.values())), _text(self.sketch.rotvec)
        SubElement(own, "home", q=q, tcp_xyz=_text(self.T), tcp_rotvec=rotvec)
        SubElement(own, "gravity", xyz="0 0 -9.81")
        if self.sketch.tolerance:
            SubElement(own, "tolerance", {kind: _text([value]) for kind, value in self.sketch.tolerance.items()})
        if self.sketch.link_compliance is not None:
            SubElement(own, "compliance", link=_text([self.sketch.link_compliance]))


def _link(root: Element, name: str, mass: float, center: Floats, moments: Floats) -> Element:
    link = SubElement(root, "link", name=name)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(center))
    SubElement(inertial, "mass", value=_text([mass]))
    ixx, iyy, izz = (_text([m]) for m in moments)
    SubElement(inertial, "inertia", ixx=ixx, ixy="0", ixz="0", iyy=iyy, iyz="0", izz=izz)
    return link


def _bar(root: Element, name: str, mass: float, middle: float, length: float) -> None:
    """A slender bar along z."""
    across = mass * length**2 / 12.0
    link = _link(root, name, mass, np.array([0.0, 0.0, middle]), np.array([across, across, mass * THICK**2 / 2.0]))
    half = np.array([0.0, 0.0, length / 2.0])
    _cylinder(link, np.array([0.0, 0.0, middle]) - half, np.array([0.0, 0.0, middle]) + half, THICK)


def _cylinder(link: Element, start: Floats, end: Floats, radius: float) -> None:
    length = float(np.linalg.norm(end - start))
    if length < THICK:
        return
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz=_text((start + end) / 2.0), rpy=_text(_along_z((end - start) / length)))
    SubElement(SubElement(visual, "geometry"), "cylinder", radius=_text([radius]), length=_text([length]))


def _joint(
    root: Element, name: str, kind: str, parent: str, child: str, xyz: Floats, rpy: Point = (0.0, 0.0, 0.0)
) -> Element:
    joint = SubElement(root, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=_text(xyz), rpy=_text(rpy))
    return joint


def _axis(joint: Element, axis: Floats, limits: tuple[float, float] | None, others: Mapping[str, str]) -> None:
    SubElement(joint, "axis", xyz=_text(axis))
    ends = {} if limits is None else {"lower": _text([limits[0]]), "upper": _text([limits[1]])}
    SubElement(joint, "limit", {**others, **ends})


def _along_z(z: Floats) -> Floats:
    """Roll, pitch and yaw of a frame whose third axis is z."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.asarray(pin.rpy.matrixToRpy(np.column_stack([x, np.cross(z, x), z])))


def _text(values: Point | list[float]) -> str:
    """Numbers as text, rounded to 1e-13 so that no rounding errors of the computation appear."""
    return " ".join(f"{round(float(value), 13) + 0.0:.13g}" for value in values)
