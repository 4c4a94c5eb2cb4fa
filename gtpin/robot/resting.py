"""What moves: the actuators that a caller picks, the loops that they move, and the Pinocchio model of these. The rest is fixed.

Joints that neither commands nor loops move are fixed at neutral, and left out; loops of such joints are removed.

A joint's frame can stand anywhere on its axis. Where two axes are parallel to within a milliradian, the common normal of a
Denavit-Hartenberg table can be hundreds of metres from the machine. A tolerance of the frame's position and rotation would then
be one of a point that no part of the machine has. Such a frame is moved along its axis to the machine; motions, links and the
exported URDF stay what they are.
"""

from __future__ import annotations

import math
import os
import re
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError, listed, warn
from gtpin.robot.description import RobotDescription, parse_xml
from gtpin.robot.tree import Mimic, Tree
from gtpin.robot.urdf_elements import exact_text, own_element
from gtpin.typing import Floats


def with_home(
    description: RobotDescription, q: Sequence[float], near: Mapping[str, tuple[float, ...]]
) -> RobotDescription:
    """The description with these commands, m or rad, as its home; its loops are closed from the coordinates ``near`` of joints.

    Raises `RobotError` if there are not as many as actuators, or one is not finite.
    """
    names = [actuator.joint for actuator in description.actuators] or list(description.tree.moving)
    if len(q) != len(names) or not all(map(math.isfinite, q)):
        hint = f"give {len(names)} finite numbers, of {', '.join(names)}"
        raise RobotError(f"home of {len(q)} numbers for {description.name}", column="home", hint=hint)
    root = parse_xml(description.xml, description.source)
    own = own_element(root)
    for home in own.findall("home"):
        own.remove(home)
    home = SubElement(own, "home")
    for name, values in {**near, **{name: (float(value),) for name, value in zip(names, q, strict=True)}}.items():
        SubElement(home, "joint", name=name, value=exact_text(np.array(values)))
    return _parsed(root, description)


def with_actuators(description: RobotDescription, names: Sequence[str]) -> RobotDescription:
    """The description with these joints as actuators, in this order; without names, with its own.

    The ``<actuator>`` elements of its text are replaced, so that files that are written from it have them too. Actuators that
    stay keep their sites and scales. Joints that these actuators do not move stay at Pinocchio's neutral configuration, and
    loops of such joints are removed.

    Raises `RobotError` if a name is not that of a joint that can be commanded, or comes twice.
    """
    own_names = tuple(actuator.joint for actuator in description.actuators)
    driven = tuple(names) or own_names
    root = parse_xml(description.xml, description.source)
    if driven != own_names:
        _check(description, driven)
        own = own_element(root)
        before = {element.get("joint"): element for element in own.findall("actuator")}
        for element in before.values():
            own.remove(element)
        home = own.find("home")
        if home is not None and description.home is not None:
            q = dict(zip(before, description.home.q, strict=False))
            home.set("q", " ".join(repr(q.get(name, 0.0)) for name in driven))
        for place, name in enumerate(driven):
            own.insert(place, before.get(name, Element("actuator", joint=name)))
    rests = bool(driven and description.loops) and remove_resting_loops(root, driven, description.source)
    return _parsed(root, description) if rests or driven != own_names else description


def _check(description: RobotDescription, names: Sequence[str]) -> None:
    moving, follows = description.tree.moving, {mimic.joint: mimic.master for mimic in description.tree.mimics}
    for number, name in enumerate(names):
        what, hint = "", "name each joint once"
        if name in follows:
            what, hint = f"{name} follows {follows[name]} by <mimic>", f"name {follows[name]} in its place"
        elif name not in moving:
            what = f"{description.name} has no moving joint {name!r}"
            hint = f"moving joints are {listed(moving) or 'none'}"
        elif name in names[:number]:
            what = f"{name} comes twice"
        if what:
            raise RobotError(what, column="actuators", hint=hint)


def _parsed(root: Element, description: RobotDescription) -> RobotDescription:
    return RobotDescription.parse(tostring(root, encoding="unicode"), description.source, description.kind)


def remove_resting_loops(root: Element, driven: Collection[str], source: str) -> bool:
    """Remove from a URDF's outer element the ``<loop_joint>`` elements that no joint named in ``driven`` moves.

    A loop moves where one of its joints is driven, follows a driven joint, or is also in another loop that moves. All other
    loops keep the shape that they have at neutral.

    Returns whether there was one to remove. Raises `RobotError` if a ``<mimic>`` is wrong.
    """
    tree = Tree.of(root, source)
    masters = {joint: joint for joint in tree.moving} | {mimic.joint: mimic.master for mimic in tree.mimics}
    resting = {}
    for loop in root.findall("loop_joint"):
        ends = (loop.find(tag) for tag in ("link1", "link2"))
        one, other = (tree.path("" if end is None else end.get("link", "")) for end in ends)
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
            if plane.get("loop", "").removesuffix(".x").removesuffix(".y") in names:
                own.remove(plane)
    return bool(resting)


LINK = "link: "
"""Prefix of links' names for the time of a reduction."""


def moving_model(description: RobotDescription, driven: Sequence[str]) -> Any:
    """Pinocchio's model of what moves: the driven joints, those in loops, and the followers of both.

    The other joints are fixed at their neutral coordinates (followers at their offsets); their links and masses stay.

    Raises `RobotError` if the URDF makes no model; if a driven joint follows another; or if a planar or floating joint is
    neither in a loop nor left out by naming the actuators.
    """
    model = build_model(description.xml, description.source)
    follows = {mimic.joint: mimic for mimic in description.tree.mimics}
    for name in driven:
        if name in follows:
            master = follows[name].master
            raise description.error(f"actuator {name} follows {master} by <mimic>", f"name {master} in its place")
    # The closure of a loop moves the joints that carry only one of its two anchors.
    path, loops = description.tree.path, description.loops
    closing = set[str]().union(*(path(loop.anchor1.link) ^ path(loop.anchor2.link) for loop in loops))
    moving = {name for name in model.names[1:] if name in driven or name in closing}
    moving |= {name for name, mimic in follows.items() if mimic.master in moving}
    resting = [name for name in model.names[1:] if name not in moving]
    free = [name for name in resting if model.nvs[model.getJointId(name)] != 1]
    if free and not description.actuators:
        count = model.nvs[model.getJointId(free[0])]
        hint = "planar and floating joints belong into loops: make it fixed, or name the actuators, so that it rests"
        raise description.error(f"joint {free[0]} has {count} degrees of freedom, which no command moves", hint)
    if resting:
        model = _reduced(model, resting, neutral(model, description))
    bring_near(model, masses_alone=bool(description.rods))  # rods' joints stand at the ends of rods
    return model


def _reduced(model: Any, resting: Sequence[str], posture: Floats) -> Any:
    """The model without the joints named ``resting``.

    Pinocchio looks these joints up among all frames by name. A link may have the name of its joint, so links get other names
    for the time of the reduction.
    """
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name = LINK + frame.name
    reduced = pin.buildReducedModel(model, [int(model.getJointId(name)) for name in resting], posture)
    for frame in reduced.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name = frame.name.removeprefix(LINK)
    return reduced


def neutral(model: Any, description: RobotDescription) -> Floats:
    """(nq,) Pinocchio's neutral configuration, with followers at their coordinates for masters at zero."""
    configuration: Floats = pin.neutral(model)
    for mimic in description.tree.mimics:
        if model.existJointName(mimic.joint):
            joint = model.getJointId(mimic.joint)
            put(configuration, int(model.idx_qs[joint]), mimic.offset, model.nqs[joint] == 2)
    return configuration


def build_model(xml: str, source: str) -> Any:
    """Build the Pinocchio model of a URDF's text.

    Raises `RobotError` if Pinocchio can't make a model of it; with the parser's message.
    """
    with tempfile.TemporaryFile() as kept:  # what C++ writes to standard error, in one message instead of several lines
        saved = os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            model, failure = pin.buildModelFromXML(xml), ""
        except (RuntimeError, ValueError) as error:
            model, failure = None, str(error)
        finally:
            os.dup2(saved, 2)
            os.close(saved)
        kept.seek(0)
        errors = re.findall(r"Error:\s*(.+)", kept.read().decode(errors="replace"))
    # The parser continues after some errors and leaves out what it could not read, for example the mass of a body.
    if model is None or errors:
        reason = errors[0].strip() if errors else failure
        raise RobotError(f"not a valid URDF ({reason})", file=source, hint="mend the URDF")
    return model


@dataclass(frozen=True)
class Follower:
    """A joint whose coordinate is ``multiplier * master + offset``, m or rad.

    ``index_q``, ``index_v``: its first index in a Pinocchio configuration and in a velocity. ``master_v``: the master's index
    in a velocity. ``continuous``: whether Pinocchio keeps its coordinate as cosine and sine.
    """

    index_q: int
    index_v: int
    master_v: int
    multiplier: float
    offset: float
    continuous: bool


def followers(model: Any, mimics: Sequence[Mimic]) -> tuple[Follower, ...]:
    """The followers among the joints of a Pinocchio model."""
    found = []
    for mimic in (mimic for mimic in mimics if model.existJointName(mimic.joint)):
        joint, master = model.getJointId(mimic.joint), model.getJointId(mimic.master)
        indices = int(model.idx_qs[joint]), int(model.idx_vs[joint]), int(model.idx_vs[master])
        found.append(Follower(*indices, mimic.multiplier, mimic.offset, model.nqs[joint] == 2))
    return tuple(found)


def coordinates(model: Any, configuration: Floats) -> dict[str, tuple[float, ...]]:
    """The coordinates of each joint in a configuration (nq,), by its name; of a continuous joint its angle."""
    parts = np.split(configuration, list(model.idx_qs)[2:])
    own = {str(name): tuple(part.tolist()) for name, part in zip(list(model.names)[1:], parts, strict=True)}
    return {name: (math.atan2(*at[::-1]),) if len(at) == 2 else at for name, at in own.items()}


def joint_jacobian(model: Any, data: Any, joint_id: int) -> Floats:
    """(6, nv) derivative of a joint's frame (position, then rotation) by Pinocchio velocities, base frame.

    The joint Jacobians in ``data`` must have been computed.
    """
    # For a model with a single coordinate Pinocchio gives the matrix as a vector.
    return np.reshape(pin.getJointJacobian(model, data, joint_id, pin.LOCAL_WORLD_ALIGNED), (6, model.nv))


def put(configurations: Floats, index: int, values: Floats | float, continuous: bool) -> None:
    """Write a joint's coordinate into configurations (..., nq); of a continuous joint these have the cosine and sine."""
    if continuous:
        configurations[..., index], configurations[..., index + 1] = np.cos(values), np.sin(values)
    else:
        configurations[..., index] = values


FAR = 2.0
"""A frame is far out where its distance from the foot (:func:`feet`) is more than this multiple of the machine's size. Two
joints of one link are at most the machine's size apart; the factor keeps ordinary files as they are."""
FAR_MASS = 10.0
"""A centre of mass that is nearer than this, m, is left where it is, however small the machine. Assumed."""


@np.errstate(over="ignore", invalid="ignore")  # a robot of absurd size is refused later
def bring_near(model: Any, *, masses_alone: bool) -> None:
    """Move the frames of joints that are far from the machine along their axes to the foot; changes the model.

    A mass whose centre is as far out stays out of the model. ``masses_alone``: move no frame.

    Warns
    -----
    GtpinWarning
        Of each mass that is left out.
    """
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    foot = feet(model, data)
    lengths = [np.linalg.norm(foot[j] - foot[model.parents[j]]) for j in range(1, model.njoints)]
    ends = [
        np.linalg.norm(data.oMf[i].translation - foot[frame.parentJoint])
        for i, frame in enumerate(model.frames)
        if frame.parentJoint and frame.placement.translation.any()
    ]
    far = FAR * float(np.sum(lengths) + max(ends, default=0.0))
    for j in range(1, model.njoints):
        inertia = model.inertias[j]
        away = float(np.linalg.norm(data.oMi[j].act(inertia.lever) - foot[j]))
        if inertia.mass and away > max(far, FAR_MASS):
            what = f"the centre of mass of what joint {model.names[j]} carries is {away:.3g} m away"
            warn(f"{what}: the mass is left out")
            model.inertias[j] = pin.Inertia.Zero()
        by = data.oMi[j].actInv(foot[j])
        if np.linalg.norm(by) > far and not masses_alone:
            _move(model, j, pin.SE3(np.eye(3), by))


def feet(model: Any, data: Any) -> Floats:
    """(J + 1, 3) of each joint the point of its axis that is nearest to the foot of the joint before it, base frame, m.

    Of the base, it is the origin of the link that carries the first joint; of a joint with several degrees of freedom, its
    frame. It depends on the axes alone, not on where a file puts the frames along them. ``data``: of a configuration, with the
    joints' Jacobians and the placements of frames.
    """
    found = np.zeros((model.njoints, 3))
    for j in range(1, model.njoints):
        at = found[j] = data.oMi[j].translation
        parent = int(model.parents[j])
        carrier = model.frames[model.getFrameId(model.names[j], pin.FrameType.JOINT)].parentFrame
        before = found[parent] if parent else data.oMf[carrier].translation
        if model.nvs[j] == 1:
            twist = joint_jacobian(model, data, j)[:, model.idx_vs[j]]
            along = twist[3:] if twist[3:].any() else twist[:3]
            if along.any():  # a driven joint whose axis has no length is refused later
                found[j] = at + along * (along @ (before - at)) / (along @ along)
    return found


def _move(model: Any, joint: int, by: Any) -> None:
    """Move a joint's frame by a placement in its own axes; everything that it carries stays where it is."""
    back = by.inverse()
    model.jointPlacements[joint] = model.jointPlacements[joint] * by
    model.inertias[joint] = back.act(model.inertias[joint])
    for child in range(1, model.njoints):
        if model.parents[child] == joint:
            model.jointPlacements[child] = back * model.jointPlacements[child]
    for frame in model.frames:
        if frame.parentJoint == joint:
            frame.placement = back * frame.placement
