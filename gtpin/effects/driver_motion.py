"""Motions of a site in its own frame, as a ``[[driver]]`` table of a dataset names them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from gtpin.data.description import MOTIONS
from gtpin.effects.basis import Basis, along_track
from gtpin.effects.chain_motions import joint_frame, of_joint
from gtpin.effects.sites import joints, links, sliding_carts
from gtpin.effects.situation import Situation
from gtpin.kinematics.rotations import frame_motions
from gtpin.robot.moving_links import moving_links
from gtpin.robot.robot import Robot
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class InstrumentAxes:
    """The instrument's pose in the base frame: its origin (3,), m, and its axes as the columns of a (3, 3) matrix."""

    origin: Floats = field(default_factory=lambda: np.zeros(3))
    axes: Floats = field(default_factory=lambda: np.eye(3))


def refusal(robot: Robot, site: str, motion: str) -> str | None:
    """Why a site can't make a motion (``x`` ... ``rz``, ``q``), as a sentence; None where it can."""
    if site in ("platform", "frame"):
        return f"{site} is no joint, so it has no q" if motion == "q" else None
    if site in robot.sites:
        if motion == "q" or site in (*joints(robot), *sliding_carts(robot)):
            return None
        return f"{site} slides no carrier along a track, so that it has its q only"
    if links(robot):
        return f"{site} is no site that a column can move: of this robot its actuators, platform and frame are"
    if motion == "q":
        return f"{site} is no actuator of this dataset, so it has no q"
    return None if _placement(robot, site) is not None else f"nothing that a column can move is at {site}"


def moved(
    at: Situation, site: str, motions: Sequence[str], columns: Floats, sigma: Floats, instrument: InstrumentAxes
) -> Basis:
    """Displacements of a site by w motions with c columns each: ``columns`` is (N, w, c), m or rad; ``sigma`` (w c,) sizes.

    ``q`` is along or about the joint's own axis. The other motions are along and about the axes of a frame: for a joint its
    placement frame; for a moving link the frame of its tip; for a link that is fixed to the base its own frame; for a cart the
    base frame's axes through the mean of the cart's joints; for the platform the TCP frame; for ``frame`` (the measured poses)
    the instrument's frame.
    """
    robot = at.robot
    if all(motion == "q" for motion in motions):
        return along_track(at, site, columns.reshape(len(at), -1), sigma)
    ways = np.zeros((6, len(motions)))
    for w, motion in enumerate(motions):
        if motion != "q":
            ways[MOTIONS.index(motion), w] = 1.0
        else:
            turning = robot.actuators[robot.sites.index(site)].revolute
            ways[3 if turning else 0 : 6 if turning else 3, w] = joint_frame(at, site).axis
    if site in robot.sites:
        return of_joint(at, site, ways, columns, sigma)
    twist = np.einsum("iw,nwc->niwc", ways, columns).reshape(len(at), 6, -1)
    if site == "platform":
        R = at.poses.R
        return Basis(sigma, twist=np.concatenate([R @ twist[:, :3], R @ twist[:, 3:]], axis=1))
    if site == "frame":
        turned = np.concatenate([instrument.axes @ twist[:, :3], instrument.axes @ twist[:, 3:]], axis=1)
        return Basis(sigma, twist=frame_motions(at.poses.T - instrument.origin) @ turned)
    found = _placement(robot, site)
    assert found is not None
    return Basis(sigma, placements=tuple((index, action @ twist) for index, action in found))


def _placement(robot: Robot, site: str) -> tuple[tuple[int, Floats], ...] | None:
    """Placement frames that move with a link, each with the (6, 6) matrix that transforms a twist of the site's frame to it.

    None where no placement frame moves with it.
    """
    model = robot.model
    frame = next((f for f in model.frames if f.name == site and f.type == pin.FrameType.BODY), None)
    if frame is None:
        return None
    if frame.parentJoint:
        tips = [link.tip for link in moving_links(robot) if link.joint_id == frame.parentJoint]
        return tuple((tip, np.eye(6)) for tip in tips) or None
    first = [j for j in range(1, model.njoints) if model.parents[j] == 0]
    return tuple((j - 1, np.asarray(model.jointPlacements[j].actInv(frame.placement).action)) for j in first) or None
