"""A machine with rods as points and lines in space (tracks, carts, rods, platform), for sketches and 3-D views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.model.model import Model
from gtpin.robot.chain import Actuator
from gtpin.typing import Floats


@dataclass(frozen=True)
class Skeleton:
    """A machine with rods at one command, base frame, m.

    Parameters
    ----------
    seats, joints
        (k, 3) the rods' ends on their carriers and on the platform.
    tcp
        (3,) the TCP.
    tracks
        By actuator: (2, 3) end points of the path of its cart (the mean of its joints).
    carts
        By actuator that moves rods' ends: (3,) the middle of its joints.
    anchors
        By actuator that turns: (3,) the point of its axis that is nearest to its joints.
    rods_of
        By actuator: its rods.
    up
        (3,) unit vector against gravity.
    """

    seats: Floats
    joints: Floats
    tcp: Floats
    tracks: dict[str, Floats]
    carts: dict[str, Floats]
    anchors: dict[str, Floats]
    rods_of: dict[str, tuple[int, ...]]
    up: Floats

    @property
    def points(self) -> Floats:
        """(m, 3) all points."""
        ends = [*self.tracks.values(), *(a[None] for a in self.anchors.values())]
        return np.vstack([self.seats, self.joints, self.tcp[None], *ends])

    @property
    def lines(self) -> tuple[Floats, Floats]:
        """(k, 3) the rods' ends on their carriers, and on the platform."""
        return self.seats, self.joints


def skeleton(model: Model, q: Floats | None = None) -> Skeleton | None:
    """The skeleton at a command (n,), by default mid-range; None without rods, or if the pose can't be reached."""
    kinematics, robot = model.kinematics, model.robot
    if not robot.rod_sites:
        return None
    if q is None:
        q = standing(model)
    pose = kinematics.forward(q[None])
    if not pose.reached.all():
        return None
    d, RP = kinematics.rod_vectors(q[None], pose)
    joints = RP[0] + pose.T[0]
    seats = joints - d[0]
    tracks, carts, anchors, rods_of = {}, {}, {}, {}
    for j, actuator in enumerate(robot.actuators):
        carried = [i for i, rod in enumerate(robot.rods) if rod.carrier == j]
        rods_of[actuator.site] = tuple(i for i, rod in enumerate(robot.rods) if j in (rod.carrier, rod.extension))
        if not carried:
            continue
        middle = seats[carried].mean(axis=0)
        carts[actuator.site] = middle
        if actuator.revolute:
            away = middle - actuator.origin
            anchors[actuator.site] = actuator.origin + actuator.axis * float(actuator.axis @ away)
        else:
            tracks[actuator.site] = _track(actuator, float(q[j]), middle)
    gravity = np.asarray(robot.model.gravity.linear, dtype=float)
    up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.array([0.0, 0.0, 1.0])
    return Skeleton(seats, joints, pose.T[0], tracks, carts, anchors, rods_of, up)


def standing(model: Model) -> Floats:
    """(n,) default command of a drawing, m or rad: for a robot with rods mid-range, where it can be reached; else home."""
    kinematics, robot = model.kinematics, model.robot
    if not robot.rod_sites:
        return robot.home_q
    middle = (robot.lower + robot.upper) / 2.0
    if np.isfinite(middle).all() and kinematics.forward(middle[None]).reached.all():
        return np.asarray(middle)
    return robot.home_q


def _track(actuator: Actuator, q: float, middle: Floats) -> Floats:
    """(2, 3) end points of a cart's path, as a straight line."""
    ends = (
        (actuator.lower, actuator.upper) if np.isfinite([actuator.lower, actuator.upper]).all() else (q - 0.5, q + 0.5)
    )
    return np.array([middle + (end - q) * actuator.axis for end in ends])
