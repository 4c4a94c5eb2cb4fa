"""Equality constraints of an MJCF: loops, joints that follow others, and joints that do not move."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.robot.mjcf_values import MAIN, Values
from gtpin.typing import Floats

WORLD = "world"


@dataclass(frozen=True)
class EqualityTargets:
    """What of an MJCF's bodies and joints equality constraints refer to.

    - ``robot``: the URDF's outer element.
    - ``bodies``, ``sites``: by name, the link of a body; the link on which a site is, and its ``pinocchio.SE3`` there.
    - ``at``: by link, its ``pinocchio.SE3`` in the world at MuJoCo's initial posture.
    - ``initial``: by joint, its coordinate there, rad or m.
    - ``text``: writes numbers.
    """

    values: Values
    robot: Element
    bodies: Mapping[str, str]
    sites: Mapping[str, tuple[str, Any]]
    at: Mapping[str, Any]
    initial: Mapping[str, float]
    text: Callable[[Floats], str]


def add_equality(made: EqualityTargets, element: Element) -> None:
    """Write an equality constraint into the URDF, if it is active.

    Raises `RobotError` if it is of a kind that gtpin does not read, or names what is not there.
    """
    given = made.values.attributes(element, MAIN, "equality")
    if given.get("active", "true") != "true":
        return
    if element.tag == "connect":
        _connect(made, given)
    elif element.tag == "joint":
        _tie(made, given)
    else:
        what = f"equality/{element.tag} {given.get('name', '')}".strip() + " is not read"
        raise RobotError(what, file=made.values.source, hint="use connect, or joint")


def _connect(made: EqualityTargets, given: Mapping[str, str]) -> None:
    name = given.get("name", f"connect{len(made.robot.findall('loop_joint')) + 1}")
    if "site1" in given or "site2" in given:
        ends = [made.sites.get(given.get(key, ""), ("", None)) for key in ("site1", "site2")]
        missing = next((given.get(f"site{i + 1}", "") for i, (_, at) in enumerate(ends) if at is None), None)
        points = [(link, None if at is None else at.translation) for link, at in ends]
    else:
        names = given.get("body1", ""), given.get("body2", WORLD)
        missing = next((body for body in names if body not in made.bodies), None)
        if missing is None:
            first, second = (made.bodies[body] for body in names)
            anchor = made.values.numbers(given, "anchor", "", 3)
            # They meet at the initial posture.
            points = [(first, anchor), (second, made.at[second].actInv(made.at[first].act(anchor)))]
    if missing is not None:
        raise RobotError(
            f"connect {name} of unknown {missing!r}", file=made.values.source, hint="name two bodies or sites"
        )
    loop = SubElement(made.robot, "loop_joint", name=name, type="spherical")
    for tag, (link, xyz) in zip(("link1", "link2"), points, strict=True):
        SubElement(loop, tag, link=link, xyz=made.text(np.asarray(xyz)))


def _tie(made: EqualityTargets, given: Mapping[str, str]) -> None:
    """Let a joint follow another by ``<mimic>``; without another one, fix it."""
    joints = {joint.get("name", ""): joint for joint in made.robot.findall("joint")}
    follower, master = given.get("joint1", ""), given.get("joint2")
    poly = np.array([0.0, 1.0, 0.0, 0.0, 0.0])
    own = made.values.numbers(given, "polycoef", "0 1 0 0 0", 1, 5)
    poly[: len(own)] = own
    hint = "give joint1 and joint2, and a polycoef of two numbers and zeros"
    unknown = [name for name in (follower, master) if name is not None and name not in made.initial]
    if unknown:
        what = f"equality/joint of {follower or 'no joint'}: no hinge or slide is called {unknown[0]!r}"
        raise RobotError(what, file=made.values.source, hint=hint)
    joint = joints[follower]
    if joint.find("mimic") is not None or joint.get("type") == "fixed":
        what = f"two equality constraints of joint {follower}"
        raise RobotError(what, file=made.values.source, hint="keep one")
    if master is None:
        _fix(made, joint, made.initial[follower] + poly[0])
        return
    if poly[2:].any():
        raise RobotError(f"equality/joint of {follower} is a curve", file=made.values.source, hint=hint)
    offset = made.initial[follower] + poly[0] - poly[1] * made.initial[master]
    SubElement(joint, "mimic", joint=master, multiplier=repr(float(poly[1])), offset=repr(float(offset)))


def _fix(made: EqualityTargets, joint: Element, coordinate: float) -> None:
    """Make a joint a fixed one, at a coordinate, rad or m."""
    origin, axis = joint.find("origin"), joint.find("axis")
    assert origin is not None
    assert axis is not None
    place, turn, along = (
        np.array([float(word) for word in str(text).split()])
        for text in (origin.get("xyz"), origin.get("rpy"), axis.get("xyz"))
    )
    slides = joint.get("type") == "prismatic"
    step = coordinate * along
    moved = pin.SE3(np.eye(3), step) if slides else pin.SE3(pin.exp3(step), np.zeros(3))
    placed = pin.SE3(pin.rpy.rpyToMatrix(*turn), place) * moved
    joint.set("type", "fixed")
    origin.set("xyz", made.text(placed.translation))
    origin.set("rpy", made.text(pin.rpy.matrixToRpy(placed.rotation)))
    for tag in ("axis", "limit"):
        joint.remove(joint.find(tag))  # type: ignore[arg-type]
