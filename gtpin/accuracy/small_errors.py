"""A small error of one part of a robot at a time, as a twist of one of its frames: what it moves, and the poses after it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gtpin.errors import ConvergenceError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.motion import FrameMotion
from gtpin.kinematics.poses import Poses
from gtpin.robot.chain import Chain
from gtpin.robot.placement_frames import frame_of_anchor, frame_of_joint, frame_of_tcp, shift
from gtpin.typing import Floats

PARAMETERS = ("L", "Px", "Py", "Pz", "Cx", "Cy", "Cz", "vx", "vy", "vz")
"""Small errors of a rod (Dressler et al. 2010, Table III): of its length L; of its joint P on the platform, TCP frame; of its
joint C on the carrier at command 0 and of the direction v of its track, base frame."""
COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
"""Components of a placement (of a joint on its parent, of the TCP on its body): translation, m, and rotation, rad, own axes."""


@dataclass(frozen=True)
class SmallError:
    """A small error of one part at N poses.

    ``parameter``, ``link``: its name (``L``, ``Px``, ``rx``), and the name of the part. ``rod``: index of the rod; None for
    other parts. ``frame``, ``twist``: the frame that moves, and (N, 6) its twist per unit of the parameter, own axes.
    ``grown``, ``moved``: change of the rod's length, and (N, 3) of the vector from its joint on the carrier to that on the
    platform, base frame, per unit at a fixed pose.
    """

    parameter: str
    link: str
    frame: int
    twist: Floats
    rod: int | None = None
    grown: float = 0.0
    moved: Floats | None = None

    def rate(self, motion: FrameMotion) -> Floats:
        """(N, 6) motion of the TCP per unit of the parameter, base frame."""
        return np.asarray(motion.by_twist(self.frame, self.twist[:, :, None])[:, :6, 0])

    def after(self, kinematics: Kinematics, q: Floats, poses: Poses, step: float) -> Poses:
        """Poses (N) after an error of a size, m or rad, in the same assembly mode.

        Raises `ConvergenceError` where the loops open.
        """
        found = kinematics.displaced(q, poses, q, {self.frame: step * self.twist})
        if not found.reached.all():
            what = f"a step of {step:g} opens the loops at row {np.flatnonzero(~found.reached)[0]}"
            raise ConvergenceError(what, hint="leave out commands near a singularity")
        return found


def small_errors(kinematics: Kinematics, q: Floats, motion: FrameMotion) -> Iterator[SmallError]:
    """Errors of the length, the joints and the track of each rod; of a robot without rods, of its joints, TCP and anchors."""
    robot = kinematics.robot
    if robot.rod_sites:
        for parameter in PARAMETERS:
            for i in range(len(robot.rod_sites)):
                error = of_rod(robot, q, motion, parameter, i)
                if error is not None:
                    yield error
        return
    places = [(f"{robot.model.names[j]}", frame_of_joint(j), 6) for j in robot.moving_joints]
    places.append(("platform", frame_of_tcp(robot), 6))
    loops = [(loop.name, anchor.link) for loop in robot.description.loops for anchor in (loop.anchor1, loop.anchor2)]
    places += [(f"{loop}.{link}", frame_of_anchor(robot, a), 3) for a, (loop, link) in enumerate(loops)]
    for link, frame, count in places:
        for c in range(count):
            yield SmallError(COMPONENTS[c], link, frame, np.tile(np.eye(6)[c], (len(q), 1)))


def of_rod(robot: Chain, q: Floats, motion: FrameMotion, parameter: str, i: int) -> SmallError | None:
    """An error of a parameter of a rod at commands q (N, n); None for a direction where the rod's carrier has no track.

    C = C0 + q (v + dv): as in the paper, a step dv of the direction is added without normalisation. For a carrier that turns,
    the parameter C is the joint's position at command 0.
    """
    rod, still = robot.rod(i), np.zeros((len(q), 3))
    if parameter == "L":
        along = robot.anchor_axes[rod.tip].T @ rod.along
        return SmallError("L", rod.name, frame_of_anchor(robot, rod.tip), _each(shift(along), q), i, 1.0, still)
    axis = np.eye(3)["xyz".index(parameter[1])]
    if parameter[0] == "P":
        frame = frame_of_joint(rod.joint_id)
        own = robot.model.jointPlacements[rod.joint_id].rotation.T @ robot.tcp_placement.rotation @ axis
        moved = motion.frame(frame_of_tcp(robot))[0] @ axis
        return SmallError(parameter, rod.name, frame, _each(shift(np.asarray(own)), q), i, 0.0, moved)
    frame = frame_of_anchor(robot, rod.seat)
    if parameter[0] == "C":
        moved = np.tile(axis, (len(q), 1))
        if rod.carrier is not None and robot.actuators[rod.carrier].revolute:  # the carrier has turned since command 0
            at_zero = (
                robot.model.jointPlacements[robot.actuators[rod.carrier].joint_id].rotation
                @ robot.anchor_axes[rod.seat]
            )
            moved = motion.frame(frame)[0] @ np.asarray(at_zero.T @ axis)
    elif rod.carrier is None or robot.actuators[rod.carrier].revolute:
        return None
    else:
        moved = q[:, rod.carrier, None] * axis
    local = np.einsum("nji,nj->ni", motion.frame(frame)[0], moved)
    return SmallError(parameter, rod.name, frame, np.hstack([local, still]), i, 0.0, -moved)


def _each(twist: Floats, q: Floats) -> Floats:
    return np.tile(twist, (len(q), 1))
