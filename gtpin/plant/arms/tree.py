"""Kinematics of a tree of joints, for many poses at once: the product of its placements and motions, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.plant.arms.urdf import Frame, Joint
from gtpin.plant.poses import Poses
from gtpin.plant.rotations import cross_matrix, exp

Floats = npt.NDArray[np.float64]


def moved(R: Floats, p: Floats, twist: Floats) -> tuple[Floats, Floats]:
    """A placement times the exponential of a twist (6,): translation, m, then rotation vector, rad, own frame."""
    v, w = twist[:3], twist[3:]
    angle, K = float(np.linalg.norm(w)), cross_matrix(w)
    second, third = 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
    if angle > 1e-2:
        second, third = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return R @ exp(w), p + R @ (v + second * K @ v + third * K @ (K @ v))


@dataclass(frozen=True, eq=False)
class Bending:
    """What effects do inside a tree of J joints at N poses: each field may be None where nothing is off.

    Parameters
    ----------
    axis
        (N, J, 6) shift, m, and rotation vector, rad, of each joint's axis, in the joint's frame as it stands on its parent.
    tip
        (N, J, 6) the same of all that sits on each joint's body: shift of the places, and turn about them, in the body's
        frame.
    """

    axis: Floats | None = None
    tip: Floats | None = None


@dataclass(frozen=True, eq=False)
class Placed:
    """Bodies at N poses, base frame.

    Parameters
    ----------
    R, p
        (N, J, 3, 3) rotations and (N, J, 3) places, m, of their joints' frames, which move with them.
    seats
        (N, J, 3, 3) rotations of the joints' frames as they stand on their parents, before the joints' own motions.
    """

    R: Floats
    p: Floats
    seats: Floats

    def at(self, frame: Frame, tip: Floats | None = None) -> Poses:
        """Poses of a frame on a body; ``tip`` as in :class:`Bending`."""
        count = len(self.R)
        if frame.joint < 0:
            return Poses(np.tile(frame.p, (count, 1)), np.tile(frame.R, (count, 1, 1)))
        R, p = self.R[:, frame.joint], self.p[:, frame.joint]
        local_p, local_R = _on_tip(frame.p, frame.R, frame.joint, tip)
        return Poses(p + np.einsum("nij,...j->ni" if local_p.ndim == 1 else "nij,nj->ni", R, local_p), R @ local_R)


def _on_tip(p: Floats, R: Floats, joint: int, tip: Floats | None) -> tuple[Floats, Floats]:
    if tip is None or joint < 0:
        return p, R
    return p + tip[:, joint, :3], exp(tip[:, joint, 3:]) @ R


def placed(joints: tuple[Joint, ...], x: Floats, bending: Bending | None = None) -> Placed:
    """Where the bodies of a tree are at joint coordinates x (N, J), m and rad."""
    bending = bending or Bending()
    count, number = x.shape
    R, p, seats = np.empty((count, number, 3, 3)), np.empty((count, number, 3)), np.empty((count, number, 3, 3))
    base_R, base_p = np.eye(3)[None], np.zeros((1, 3))
    for j, joint in enumerate(joints):
        on_R, on_p = (base_R, base_p) if joint.parent < 0 else (R[:, joint.parent], p[:, joint.parent])
        at, turn = _on_tip(joint.p, joint.R, joint.parent, bending.tip)
        here_R, here_p = on_R @ turn, on_p + (on_R @ np.broadcast_to(at, (count, 3))[..., None])[..., 0]
        if bending.axis is not None:
            here_p = here_p + (here_R @ bending.axis[:, j, :3, None])[..., 0]
            here_R = here_R @ exp(bending.axis[:, j, 3:])
        seats[:, j] = here_R
        motion = x[:, j, None] * joint.axis
        R[:, j] = here_R if joint.slides else here_R @ exp(motion)
        p[:, j] = here_p + (here_R @ motion[..., None])[..., 0] if joint.slides else here_p
    return Placed(R, p, seats)
