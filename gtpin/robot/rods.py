"""The rods: what closes the loops between the platform and what the actuators move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from gtpin.errors import RobotError
from gtpin.robot.constrained_model import ConstrainedModel
from gtpin.robot.description import Loop, RodElement
from gtpin.robot.resting import joint_jacobian
from gtpin.typing import Floats

ALIGNED = 1e-9
"""Largest distance, m, at which joints count as meeting in one point, or a rod's actuator as in line with the rod."""


@dataclass(frozen=True)
class Rod:
    """A link between a joint on the platform and a joint on its carrier, both spherical.

    Its closure is \\|T + R P - C(q)\\| = L(q) (Dressler et al. 2010, eq. 5).

    - ``name``: the site without the word ``link``: ``2a`` of ``link2a``.
    - ``site``, ``link``: the site's name and the URDF link.
    - ``loop``: index of its loop among the robot's constraints.
    - ``joint_id``: the Pinocchio joint that connects the rod to the platform.
    - ``P``: (3,) position of the rod's joint on the platform, TCP frame, m.
    - ``C``: (3,) position of the carrier joint with all commands zero, base frame, m.
    - ``L``: length of the rod with all commands zero, m.
    - ``along``: (3,) unit vector from the joint on the platform to the rod's end, in the frame of the joint that carries
      this end.
    - ``carrier``: index of the actuator that moves the carrier joint, or None where this joint is fixed to the base.
    - ``extension``: index of the actuator that changes the rod's length, or None.
    - ``rod_end``: 0 or 1: index of the loop's anchor that is on the rod.
    - ``moment``: first moment of its mass about the joint on the platform, kg m; ``sliding``: the part of the mass that
      slides as the length changes, kg.
    """

    name: str
    site: str
    link: str
    loop: int
    joint_id: int
    P: Floats
    C: Floats
    L: float
    along: Floats
    carrier: int | None
    extension: int | None
    rod_end: int
    moment: float
    sliding: float

    @property
    def driver(self) -> int | None:
        """Index of the actuator that moves the carrier joint or changes the length; None where none does."""
        return self.extension if self.carrier is None else self.carrier

    @property
    def tip(self) -> int:
        """Index, among all anchors of the robot's loops, of the anchor on the rod."""
        return 2 * self.loop + self.rod_end

    @property
    def seat(self) -> int:
        """Index, among all anchors of the robot's loops, of the anchor on the carrier."""
        return 2 * self.loop + 1 - self.rod_end


def rods(robot: ConstrainedModel) -> tuple[Rod, ...]:
    """The rods that the URDF names, in document order; none where it names none.

    Raises `RobotError` if a rod does not hang on the platform by a universal joint and end at a loop on the base or on the
    link of one actuator.
    """
    loops = {loop.name: (index, loop) for index, loop in enumerate(robot.description.loops)}
    found = []
    pin.computeJointJacobians(robot.model, robot.data, robot.with_commands(robot.neutral, np.zeros(robot.n_actuators)))
    for element in robot.description.rods:
        if element.loop not in loops:
            raise _error(robot, element, f"its loop {element.loop} does not exist")
        found.append(_rod(robot, element, *loops[element.loop]))
    if found and len(found) != len(robot.constraints):
        raise robot.description.error(f"{len(robot.constraints)} loops but {len(found)} rods", "name every rod")
    for what, named in (("loop", {rod.loop for rod in found}), ("site", {rod.name for rod in found})):
        if len(named) != len(found):
            raise robot.description.error(f"two rods have the same {what}", "name each once")
    return tuple(found)


def _rod(robot: ConstrainedModel, element: RodElement, index: int, loop: Loop) -> Rod:
    model, placements = robot.model, robot.data.oMi
    names = (loop.anchor1.link, loop.anchor2.link)
    if element.link not in names:
        raise _error(robot, element, f"its loop {loop.name} does not touch it")
    rod_end = names.index(element.link)
    tip_joint, tip = robot.anchors[2 * index + rod_end]
    carrier_joint, seat = robot.anchors[2 * index + 1 - rod_end]
    chain = [joint for joint in model.supports[tip_joint] if joint not in set(model.supports[robot.tcp_joint])]
    if robot.tcp_joint not in model.supports[tip_joint] or not chain:
        raise _error(robot, element, "it does not hang on the platform")
    tcp = placements[robot.tcp_joint] * robot.tcp_placement
    root = placements[chain[0]].translation
    driven = {actuator.joint_id: number for number, actuator in enumerate(robot.actuators)}
    extension = None
    end = (placements[tip_joint] * tip).translation
    # The rod's parts relative to its joint on the platform: from placements alone, the same at any posture.
    parts = [pin.SE3.Identity()]
    for joint in chain[1:]:
        parts.append(parts[-1] * model.jointPlacements[joint])
    local = parts[-1] * tip
    L = float(np.linalg.norm(local.translation))
    along = tip.rotation @ local.rotation.T @ local.translation / L
    for joint in chain:
        if joint in driven:
            column = joint_jacobian(model, robot.data, joint)[:, model.idx_vs[joint]]
            if extension is not None or np.linalg.norm(column[:3] * L - (end - root)) > ALIGNED * max(1.0, L):
                raise _error(robot, element, f"its actuator {model.names[joint]} does not change its length")
            extension = driven[joint]
        elif extension is not None or np.linalg.norm(placements[joint].translation - root) > ALIGNED:
            raise _error(robot, element, "its joints on the platform do not meet in one point")
    carriers = [joint for joint in model.supports[carrier_joint] if joint != 0]
    if len(carriers) > 1 or any(joint not in driven for joint in carriers):
        raise _error(robot, element, "its carrier is moved by something else than one actuator")
    if carriers and extension is not None:
        raise _error(robot, element, "one actuator moves its carrier and another changes its length")
    name = element.site.removeprefix("link")
    masses = [model.inertias[joint].mass for joint in chain]
    levers = [at.act(model.inertias[j].lever) @ local.translation / L for j, at in zip(chain, parts, strict=True)]
    slides = np.inf if extension is None else robot.actuators[extension].joint_id
    return Rod(
        name=name if name else element.site,
        site=element.site,
        link=element.link,
        loop=index,
        joint_id=int(chain[0]),
        P=tcp.actInv(root),
        C=(placements[carrier_joint] * seat).translation,
        L=L,
        along=np.asarray(along),
        carrier=driven[carriers[0]] if carriers else None,
        extension=extension,
        rod_end=rod_end,
        moment=float(np.dot(masses, levers)),
        sliding=sum(mass for joint, mass in zip(chain, masses, strict=True) if joint >= slides),
    )


def _error(robot: ConstrainedModel, element: RodElement, what: str) -> RobotError:
    hint = "let it hang on the platform by a universal joint and end at a loop on the base or on one actuator's link"
    return robot.description.error(f"rod {element.link}: {what}", hint)
