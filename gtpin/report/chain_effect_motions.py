"""Quantities that an effect displaces on a robot without rods: a joint's coordinate, a joint's axis, a link's tip."""

from __future__ import annotations

import numpy as np

from gtpin.effects.basis import Basis, along_track
from gtpin.effects.chain_motions import beam, joint_frame, tip_to_joint
from gtpin.effects.sites import links_at
from gtpin.effects.situation import Situation
from gtpin.report.motion import Carried, Motion
from gtpin.report.words import travel_words
from gtpin.robot.chain import joint_axis
from gtpin.robot.moving_links import MovingLink
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats


def travel(at: Situation, basis: Basis) -> list[Motion]:
    """The motion of a joint along or about its own axis."""
    if basis.command is None:
        return []
    number, columns = basis.command
    robot = at.robot
    site, actuator = robot.sites[number], robot.actuators[number]
    one = along_track(at, site, np.ones((len(at), 1)), np.ones(1)).displacement(at)[:, :, 0]
    place = "about its axis" if actuator.revolute else "along its axis"
    carried = Carried(f"{site} {place}", actuator.joint_id - 1, joint_axis(robot.model, actuator.joint_id))
    unit = "rad" if actuator.revolute else "m"
    return [Motion(travel_words(robot, site), unit, columns, one, carried=carried)]


def placements(at: Situation, site: str, basis: Basis) -> list[Motion]:
    """Motions of a joint's axis, or of the tips of links; those that move the TCP most are first."""
    found = []
    for index, twists in basis.placements:
        link = None if site in at.robot.sites else _link(at, site, index)
        owner, ways = _ways(at, site, link)
        frame, moved = index, np.broadcast_to(np.eye(6), (len(at), 6, 6))
        if link is not None and link.tip != index:  # a link of a loop: the whole link moves
            frame, moved = link.tip, tip_to_joint(at, link)
        own = np.linalg.solve(moved, twists) if frame != index else twists
        for place, way in ways:
            motion, unit = ("shift", "m") if way[:3].any() else ("turn", "rad")
            tcp = at.bodies.by_twist(index, (moved @ way)[:, :, None])[:, :, 0]
            columns = np.einsum("nim,i->nm", own, way)
            found.append(
                Motion(
                    f"{motion} of {owner} {place}", unit, columns, tcp, carried=Carried(f"{owner} {place}", frame, way)
                )
            )
    return sorted(found, key=lambda motion: -_at_tcp(motion, basis.sigma))


def _at_tcp(motion: Motion, sigma: Floats) -> float:
    return float(np.abs((motion.columns * sigma)[:, None] * motion.tcp[:, :3, None]).max(initial=0.0))


def _link(at: Situation, site: str, index: int) -> MovingLink:
    """The link of a site whose tip has the index; in a robot with loops, whose own placement frame has it."""
    found = links_at(at.robot, site)
    if at.robot.constraints:
        return next(link for link in found if link.joint_id - 1 == index)
    return next(link for link in found if link.tip == index)


def _ways(at: Situation, site: str, link: MovingLink | None) -> tuple[str, list[tuple[str, Floats]]]:
    """Name of the part that is displaced, and six directions, as twists (6,), with their names."""
    if link is None:
        frame = joint_frame(at, site)
        owner, along, (a, b), it = f"the axis of {site}", frame.axis, frame.across, "itself"
    else:
        length = beam(at, link)
        size = float(np.linalg.norm(length))
        along = length / size if size > 0.0 else np.eye(3)[0]
        owner, (a, b), it = f"the tip of {link.name}", rotation_axes(along)[:2], "the link"
    names = (("along", it, along), ("across it, along", "a", a), ("across it, along", "b", b))
    shifts = [(f"{how} {what}", np.concatenate([axis, np.zeros(3)])) for how, what, axis in names]
    turns = [(f"about {what}", np.concatenate([np.zeros(3), axis])) for _, what, axis in names]
    return owner, shifts + turns
