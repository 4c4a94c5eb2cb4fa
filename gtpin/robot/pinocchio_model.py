"""Writes a ``pinocchio.Model`` and its constraint models as a URDF with ``<loop_joint>``, from which a robot is made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.robot.constrained_model import joint_axis, limits
from gtpin.robot.resting import coordinates
from gtpin.robot.urdf_elements import add_inertia, add_joint, exact_text

SUPPORTED = "joints of one degree of freedom (revolute or prismatic) and free flyers are supported"


def urdf_of(model: pin.Model, constraints: Sequence[Any], home: str = "") -> str:
    """The URDF of a model: its joints, inertias, limits and frames, and a ``<loop_joint>`` for each constraint.

    Links have the names of the model's bodies, further frames are links fixed to them. Not supported: spherical, planar,
    helical, composite and mimic joints; constraints other than the coincidence of two points (``RigidConstraintModel`` of type
    ``CONTACT_3D``, ``PointAnchorConstraintModel``) or of two frames (``CONTACT_6D``, ``FrameAnchorConstraintModel``); visual
    and collision geometry, friction, armature and rotor inertias.

    ``home``: the name of one of the model's reference configurations, the posture that chooses the assembly.

    Raises `RobotError` for what is not supported, and where there is no such configuration.
    """
    root = Element("robot", name=model.name or "robot")
    links: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and frame.placement == pin.SE3.Identity():
            links.setdefault(int(frame.parentJoint), frame.name)
    for joint in range(model.njoints):
        links.setdefault(joint, f"{model.names[joint]}_link" if joint else "base")
        link = SubElement(root, "link", name=links[joint])
        if joint:
            add_inertia(link, model.inertias[joint])
            _joint(root, model, joint, links[int(model.parents[joint])], links[joint])
    taken = set(links.values())
    for frame in model.frames:
        if frame.type in (pin.FrameType.BODY, pin.FrameType.OP_FRAME) and frame.name not in taken:
            taken.add(frame.name)
            SubElement(root, "link", name=frame.name)
            add_joint(root, f"{frame.name}_mount", "fixed", links[int(frame.parentJoint)], frame.name, frame.placement)
    for number, constraint in enumerate(constraints):
        kind, one = _closure(constraint, number)
        loop = SubElement(root, "loop_joint", name=f"loop{number + 1}", type=kind)
        for tag, at, placement in (
            ("link1", one.joint1_id, one.joint1_placement),
            ("link2", one.joint2_id, one.joint2_placement),
        ):
            turn = exact_text(pin.rpy.matrixToRpy(placement.rotation))
            SubElement(loop, tag, link=links[int(at)], xyz=exact_text(placement.translation), rpy=turn)
    own = SubElement(root, "gtpin")
    SubElement(own, "gravity", xyz=exact_text(model.gravity.linear))
    if home:
        if home not in model.referenceConfigurations:
            known = ", ".join(one.key() for one in model.referenceConfigurations) or "none"
            raise RobotError(f"the model has no reference configuration {home!r}", hint=f"there are {known}")
        posture = SubElement(own, "home")
        for name, values in coordinates(model, model.referenceConfigurations[home]).items():
            SubElement(posture, "joint", name=name, value=exact_text(values))
    return tostring(root, encoding="unicode")


def _joint(root: Element, model: pin.Model, joint: int, parent: str, child: str) -> None:
    kind = model.joints[joint].shortname()
    if kind == "JointModelFreeFlyer":
        add_joint(root, model.names[joint], "floating", parent, child, model.jointPlacements[joint])
        return
    twist = joint_axis(model, joint) if model.nvs[joint] == 1 else np.ones(6)
    if twist[:3].any() and twist[3:].any():
        raise RobotError(f"joint {model.names[joint]} is a {kind}, which is not supported", hint=SUPPORTED)
    low, high = limits(model, joint)
    limited = max(-low, high) < 1e300  # Pinocchio's default is the largest float
    turns = bool(twist[3:].any())
    own = "revolute" if turns and limited else "continuous" if turns else "prismatic"
    element = add_joint(root, model.names[joint], own, parent, child, model.jointPlacements[joint])
    SubElement(element, "axis", xyz=exact_text(twist[3:] if turns else twist[:3]))
    if own != "continuous":  # an empty range is none
        ends = {"lower": repr(low), "upper": repr(high)} if limited else {"lower": "0", "upper": "0"}
        SubElement(element, "limit", {**ends, "effort": "0", "velocity": "0"})


def _closure(constraint: Any, number: int) -> tuple[str, Any]:
    """The type of the loop that a constraint closes, and the constraint with its joints and placements."""
    one = constraint.extract() if isinstance(constraint, pin.ConstraintModel) else constraint
    kind, offset = None, np.zeros(6)
    if isinstance(one, pin.RigidConstraintModel):
        kind = {pin.ContactType.CONTACT_3D: "spherical", pin.ContactType.CONTACT_6D: "fixed"}.get(one.type)
        offset = pin.log6(one.desired_contact_placement).vector
    elif isinstance(one, pin.PointAnchorConstraintModel | pin.FrameAnchorConstraintModel):
        kind = "spherical" if isinstance(one, pin.PointAnchorConstraintModel) else "fixed"
        offset = one.desired_constraint_offset
    if kind is None or np.any(offset):
        what = f"constraint {number + 1} is a {type(one).__name__}{' with an offset' if kind else ''}, which is not supported"
        raise RobotError(what, hint="a constraint makes two points or two frames coincide: CONTACT_3D or CONTACT_6D")
    return kind, one
