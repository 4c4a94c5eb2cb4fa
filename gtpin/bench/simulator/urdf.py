"""The tree of joints of a URDF, read by the simulator itself: its kinematics share no code with the diagnosis."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt
from defusedxml.ElementTree import fromstring

from gtpin.bench.simulator.poses import exp
from gtpin.errors import RobotError
from gtpin.typing import Floats

MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, eq=False)
class Joint:
    """A moving joint and its body: its child link with everything that is fixed to it."""

    # `name`, `link`: Names of the URDF's joint and of its child link
    name: str
    link: str
    parent: int  # Index of the joint whose body carries it; -1: the base
    # `R`, `p`: (3, 3) rotation and (3,) position, m, of its frame on that body
    R: Floats
    p: Floats
    axis: Floats  # (3,) unit vector, own frame
    slides: bool  # Whether it slides (m) instead of turning (rad)
    # `lower`, `upper`: Its range, rad or m; infinite where the URDF gives none
    lower: float
    upper: float
    # (index, factor, offset) of the joint that it mimics: x = factor * x_index + offset; None where it mimics none
    follows: tuple[int, float, float] | None
    # `mass`, `centre`: Mass of the body, kg, and (3,) its centre of mass, own frame, m
    mass: float
    centre: Floats


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame on the body of a joint (index; -1: the base): rotation R (3, 3) and position p (3,), m."""

    joint: int
    R: Floats
    p: Floats


@dataclass(frozen=True, eq=False)
class Urdf:
    """The moving joints of a URDF, parents first, and the frames of its links, by name, on their bodies."""

    joints: tuple[Joint, ...]
    links: dict[str, Frame]

    def index(self, name: str) -> int:
        """Index of a joint by its name."""
        return [joint.name for joint in self.joints].index(name)


def read_urdf(xml: str, still: Collection[str] = ()) -> Urdf:
    """Read the tree of a URDF's text; joints of the types ``still`` count as fixed.

    Raises RobotError if a joint has more than one degree of freedom, or the joints are no tree.
    """
    root = fromstring(xml.encode("utf-8"))
    elements = root.findall("joint")
    inertials = {str(link.get("name")): link.find("inertial") for link in root.findall("link")}
    children = {_link(joint, "child") for joint in elements}
    bodies: list[dict[str, object]] = []
    masses: list[tuple[float, Floats]] = []
    frames = {name: Frame(-1, np.eye(3), np.zeros(3)) for name in inertials if name not in children}
    waiting = list(elements)
    while waiting:
        ready = next((joint for joint in waiting if _link(joint, "parent") in frames), None)
        if ready is None:
            raise RobotError("the joints are no tree", hint="give every link one parent that is there")
        waiting.remove(ready)
        on, kind, name = frames[_link(ready, "parent")], str(ready.get("type")), str(ready.get("name"))
        local_R, local_p = _origin(ready)
        frame = Frame(on.joint, on.R @ local_R, on.p + on.R @ local_p)
        child = _link(ready, "child")
        if kind in MOVING:
            bodies.append(
                {"element": ready, "name": name, "link": child, "parent": frame.joint, "R": frame.R, "p": frame.p}
            )
            masses.append((0.0, np.zeros(3)))
            frame = Frame(len(bodies) - 1, np.eye(3), np.zeros(3))
        elif kind != "fixed" and kind not in still:
            raise RobotError(f"joint {name} is {kind}", hint="the simulator moves joints that turn or slide")
        frames[child] = frame
        if frame.joint >= 0:
            mass, centre = _inertia(inertials.get(child))
            before, moment = masses[frame.joint]
            masses[frame.joint] = before + mass, moment + mass * (frame.p + frame.R @ centre)
    names = [str(body["name"]) for body in bodies]
    joints = [_joint(body, names, mass, moment) for body, (mass, moment) in zip(bodies, masses, strict=True)]
    return Urdf(tuple(joints), frames)


def _joint(body: dict[str, object], names: list[str], mass: float, moment: Floats) -> Joint:
    element = body.pop("element")
    assert isinstance(element, Element)
    axis = _numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0))
    limit, mimic = element.find("limit"), element.find("mimic")
    lower, upper = -np.inf, np.inf
    if limit is not None and element.get("type") != "continuous":
        lower, upper = float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0))
    if not lower < upper:
        lower, upper = -np.inf, np.inf
    follows = None
    if mimic is not None and mimic.get("joint") in names:
        leader = names.index(str(mimic.get("joint")))
        follows = leader, float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0))
    return Joint(
        **body,  # type: ignore[arg-type]
        axis=axis / np.linalg.norm(axis),
        slides=element.get("type") == "prismatic",
        lower=lower,
        upper=upper,
        follows=follows,
        mass=mass,
        centre=moment / mass if mass > 0.0 else np.zeros(3),
    )


def _link(joint: Element, which: str) -> str:
    found = joint.find(which)
    return "" if found is None else str(found.get("link"))


def _numbers(element: Element | None, key: str, otherwise: tuple[float, ...]) -> Floats:
    text = None if element is None else element.get(key)
    return np.array(otherwise if text is None else [float(word) for word in text.split()])


def _origin(element: Element) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and translation (3,) of an ``<origin>``."""
    origin = element.find("origin")
    return turn(_numbers(origin, "rpy", (0.0, 0.0, 0.0))), _numbers(origin, "xyz", (0.0, 0.0, 0.0))


def turn(rpy: npt.ArrayLike) -> Floats:
    """(3, 3) rotation of the angles roll, pitch and yaw (3,), rad, about the fixed axes x, y, z in this order."""
    roll, pitch, yaw = np.asarray(rpy, dtype=float)
    return np.asarray(exp([0.0, 0.0, yaw]) @ exp([0.0, pitch, 0.0]) @ exp([roll, 0.0, 0.0]))


def _inertia(inertial: Element | None) -> tuple[float, Floats]:
    """Mass, kg, and centre of mass (3,), m, of a link, from its ``<inertial>``."""
    mass = None if inertial is None else inertial.find("mass")
    if inertial is None or mass is None:
        return 0.0, np.zeros(3)
    return float(mass.get("value", 0.0)), _origin(inertial)[1]
