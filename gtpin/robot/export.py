"""Writes a geometry into the URDF of its robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.robot.assembly import home_attributes
from gtpin.robot.chain import Chain
from gtpin.robot.description import parse_xml
from gtpin.robot.geometry import Geometry
from gtpin.robot.urdf_elements import add_joint, exact_text, own_element, set_origin
from gtpin.typing import Floats


def to_urdf(
    geometry: Geometry,
    placements: Floats | None,
    anchors: Floats,
    home: tuple[Floats, Floats],
    targets: Mapping[str, pin.SE3],
) -> str:
    """URDF of a robot with the places of its joints, of its loops' anchors and of its TCP from a geometry.

    Every link keeps its name, shape and inertia. Where the URDF's zero configuration was the home posture, it is so again. A
    URDF can't hold drive scales. The TCP's displacement is written into the fixed joint of its link. Where its link has no
    fixed joint, the TCP gets a new link, which ``<platform>`` names. Where the place of the only measured target was unknown,
    the TCP stays on its link.

    ``geometry``: what to write. ``placements``, ``anchors``: its places, as :class:`~gtpin.kinematics.placed.PlacedParts` has
    them.
    ``home``: the TCP's position (3,), m, and rotation (3, 3) at the home commands, base frame. ``targets``: places on the TCP,
    each of which becomes a link of its name.
    """
    robot = geometry.robot
    root = parse_xml(robot.description.xml, robot.description.source)
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    placed = () if placements is None else enumerate(placements, 1)
    for joint_id, moved in placed:
        own = robot.model.jointPlacements[joint_id]
        placement = pin.SE3(moved[:9].reshape(3, 3).T, moved[9:])
        if placement != own:
            # The URDF's origin is from the parent link's frame to the child link's, Pinocchio's placement from joint to joint.
            element = joints[robot.model.names[joint_id]]
            end = _link_placement(robot, element, "child")
            set_origin(element, _link_placement(robot, element, "parent").inverse() * placement * end)
    loops = {loop.get("name", ""): loop for loop in root.findall("loop_joint")}
    for index, (at, (_, own)) in enumerate(zip(anchors, robot.anchors, strict=True)):
        loop, shift = robot.description.loops[index // 2], robot.anchor_axes[index].T @ (at - own.translation)
        if shift.any() and not loop.point_of:
            anchor = (loop.anchor1, loop.anchor2)[index % 2]
            element = _child(loops[loop.name], f"link{index % 2 + 1}")
            element.set("xyz", exact_text(np.array(anchor.xyz) + shift))
    if placements is not None and robot.constraints:
        _rehome(robot, root, joints, home, geometry.platform)
    _name_what_was_found(robot, root)
    tcp = robot.tcp_frame
    if geometry.target is None and geometry.platform.any():
        tcp = _move_tcp(robot, root, pin.exp6(geometry.platform))
    for name, place in targets.items():
        _add_target(robot, root, tcp, name, place)
    indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _add_target(robot: Chain, root: Element, tcp: str, name: str, place: pin.SE3) -> None:
    """Add a link where a measured target sits, and name the link of the TCP: a reader could take the target for it."""
    while name in robot.links:
        name = f"measured_{name}"
    SubElement(root, "link", {"name": name})
    add_joint(root, f"{name}_mount", "fixed", tcp, name, place)
    own = own_element(root)
    if own.find("platform") is None:
        SubElement(own, "platform", {"link": tcp})


def _move_tcp(robot: Chain, root: Element, moved: pin.SE3) -> str:
    """Move the TCP, and return the name of its link."""
    for joint in root.findall("joint"):
        if joint.get("type") == "fixed" and _child(joint, "child").get("link") == robot.tcp_frame:
            set_origin(joint, _link_placement(robot, joint, "parent").inverse() * robot.tcp_placement * moved)
            return robot.tcp_frame
    name = f"{robot.tcp_frame}_tcp"
    SubElement(root, "link", {"name": name})
    add_joint(root, f"{name}_fixed", "fixed", robot.tcp_frame, name, moved)
    own = own_element(root)
    platform = own.find("platform")
    platform = SubElement(own, "platform") if platform is None else platform
    platform.set("link", name)
    platform.attrib.pop("tcp", None)
    return name


def _name_what_was_found(robot: Chain, root: Element) -> None:
    """Write into the URDF what a reader could not find again, because the geometry has deviations: TCP, planes, assembly."""
    description = robot.description
    planes = {loop.name: n for loop, n in zip(description.loops, robot.planes, strict=True) if len(n)}
    named_tcp = description.tcp or description.platform or description.tree.tip
    tcp = robot.tcp_frame if robot.tcp_frame != named_tcp or description.tcp_guessed else None
    chosen = bool(robot.constraints) and robot.assembly.chosen
    if tcp is None and not planes and not chosen:
        return
    own = own_element(root)
    if tcp is not None:
        for home in own.findall("home"):
            home.set("link", home.get("link") or named_tcp)
        for before in own.findall("platform"):
            own.remove(before)
        own.append(Element("platform", link=tcp))
    if chosen:
        # Of the link that the TCP's joint moves: the TCP itself may be displaced on it.
        bodies = (frame for frame in robot.model.frames if frame.type == pin.FrameType.BODY)
        link = next(frame for frame in bodies if frame.parentJoint == robot.tcp_joint)
        at = home_attributes(robot, robot.assembly.configuration, robot.tcp_joint, link.placement, digits=9)
        for before in own.findall("home"):  # by coordinates of joints, at which the loops are open
            own.remove(before)
        own.append(Element("home", at, link=str(link.name)))
    for name, normals in planes.items():
        if name not in description.planes:
            own.extend(Element("plane", loop=name, normal=exact_text(normal)) for normal in normals)


def _link_placement(robot: Chain, joint: Element, end: Literal["parent", "child"]) -> pin.SE3:
    """Placement of a joint's parent or child link on the Pinocchio joint that carries it."""
    return robot.link(_child(joint, end).get("link", "")).placement


def _rehome(
    robot: Chain, root: Element, joints: dict[str, Element], home: tuple[Floats, Floats], displaced: Floats
) -> None:
    """Write the new home pose. A floating platform whose zero was at the home pose is moved to the new one.

    ``displaced``: (6,) twist of the TCP on its body.
    """
    own = root.find("gtpin")
    element = None if own is None else own.find("home")
    if element is None or robot.description.home is None:
        return
    platform_pose = pin.SE3(home[1], home[0]) * (robot.tcp_placement * pin.exp6(displaced)).inverse()
    pose = platform_pose * robot.home_placement
    element.set("tcp_xyz", exact_text(pose.translation))
    element.set("tcp_rotvec", exact_text(pin.log3(pose.rotation)))
    platform = robot.model.names[robot.tcp_joint]
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.with_commands(robot.neutral, np.zeros(robot.n_actuators)))
    was = pin.SE3(pin.exp3(np.array(robot.description.home.tcp_rotvec)), np.array(robot.description.home.tcp_xyz))
    now = data.oMi[robot.tcp_joint] * robot.home_placement
    if platform in joints and joints[platform].get("type") == "floating" and was.isApprox(now, 1e-6):
        set_origin(joints[platform], platform_pose)


def _child(element: Element, tag: str) -> Element:
    child = element.find(tag)
    if child is None:
        raise RobotError(f"<{element.tag} {element.get('name', '')}> lacks <{tag}>", hint="complete the URDF")
    return child
