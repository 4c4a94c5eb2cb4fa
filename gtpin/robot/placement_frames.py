"""The frames of a robot that geometry and effects displace, and how they are counted.

The *frames* of a robot with J joints and L loops are the placement frames of its joints (a joint's frame on its parent, before
its own motion), the TCP on the body that carries it, and the 2 L anchors of its loops. Joint j of Pinocchio has the index
j - 1, the TCP the index J, anchor a the index J + 1 + a. A *twist* of a frame is a small motion in its own axes: position, m,
then rotation vector, rad. The axes of an anchor are those of its link.
"""

from __future__ import annotations

import numpy as np

from gtpin.robot.constrained_model import ConstrainedModel
from gtpin.typing import Floats


def frame_of_joint(joint_id: int) -> int:
    """The index of a joint's placement frame."""
    return joint_id - 1


def frame_of_tcp(robot: ConstrainedModel) -> int:
    """The index of the TCP."""
    return int(robot.model.njoints) - 1


def frame_of_anchor(robot: ConstrainedModel, anchor: int) -> int:
    """The index of an anchor's frame."""
    return int(robot.model.njoints) + anchor


def shift(translation: Floats) -> Floats:
    """(6,) the twist of a translation (3,), m."""
    return np.concatenate([translation, np.zeros(3)])


def turned(rotation: Floats) -> Floats:
    """(6,) the twist of a rotation vector (3,), rad."""
    return np.concatenate([np.zeros(3), rotation])
