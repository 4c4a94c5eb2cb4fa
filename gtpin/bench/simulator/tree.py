"""Forward kinematics of a tree of joints, for many poses at once, as a product of placements and motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator.poses import Poses, cross_matrix, exp
from gtpin.bench.simulator.urdf import Frame, Joint
from gtpin.typing import Floats


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
    """Deviations inside a tree of J joints at N poses; a field is None where there is no such deviation."""

    # (N, J, 6) shift, m, and rotation vector, rad, of each joint's axis, in the joint's frame at coordinate zero
    axis: Floats | None = None
    # (N, J, 6) the same of everything that is fixed to each joint's body: shift, and rotation about the body's end, in
    # the body's frame
    tip: Floats | None = None
    # (J, 3) the bodies' ends, own frames, m; None where everything that a body carries is at its end
    ends: Floats | None = None

    def take(self, rows: npt.NDArray[np.int_]) -> Bending:
        """The deviations at some of the poses."""
        axis, tip = (None if field is None else field[rows] for field in (self.axis, self.tip))
        return Bending(axis, tip, self.ends)

    def on(self, p: Floats, R: Floats, joint: int) -> tuple[Floats, Floats]:
        """Position p (3,) and rotation R (3, 3) of a frame on a joint's body, with the bending; (N, ...) where there is one."""
        if self.tip is None or joint < 0:
            return p, R
        shift, turn = self.tip[:, joint, :3], exp(self.tip[:, joint, 3:])
        if self.ends is not None:
            shift = shift + (turn - np.eye(3)) @ (p - self.ends[joint])
        return p + shift, turn @ R


STRAIGHT = Bending()
"""No deviations."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Bodies at N poses, base frame."""

    # `R`, `p`: (N, J, 3, 3) rotations and (N, J, 3) positions, m, of the joints' frames, which move with the bodies
    R: Floats
    p: Floats
    # (N, J, 3, 3) rotations of the joints' frames before the joints' own motions: as with coordinates of zero
    seats: Floats
    x: Floats  # (N, J) the joints' coordinates, rad or m

    def at(self, frame: Frame, bending: Bending = STRAIGHT) -> Poses:
        """Poses of a frame on a body."""
        count = len(self.R)
        if frame.joint < 0:
            return Poses(np.tile(frame.p, (count, 1)), np.tile(frame.R, (count, 1, 1)))
        R, p = self.R[:, frame.joint], self.p[:, frame.joint]
        local_p, local_R = bending.on(frame.p, frame.R, frame.joint)
        return Poses(p + np.einsum("nij,...j->ni" if local_p.ndim == 1 else "nij,nj->ni", R, local_p), R @ local_R)


def placed(joints: tuple[Joint, ...], x: Floats, bending: Bending = STRAIGHT) -> Placed:
    """The bodies of a tree at joint coordinates x (N, J), m and rad."""
    count, number = x.shape
    R, p, seats = np.empty((count, number, 3, 3)), np.empty((count, number, 3)), np.empty((count, number, 3, 3))
    base_R, base_p = np.eye(3)[None], np.zeros((1, 3))
    for j, joint in enumerate(joints):
        on_R, on_p = (base_R, base_p) if joint.parent < 0 else (R[:, joint.parent], p[:, joint.parent])
        at, turn = bending.on(joint.p, joint.R, joint.parent)
        here_R, here_p = on_R @ turn, on_p + (on_R @ np.broadcast_to(at, (count, 3))[..., None])[..., 0]
        if bending.axis is not None:
            here_p = here_p + (here_R @ bending.axis[:, j, :3, None])[..., 0]
            here_R = here_R @ exp(bending.axis[:, j, 3:])
        seats[:, j] = here_R
        motion = x[:, j, None] * joint.axis
        R[:, j] = here_R if joint.slides else here_R @ exp(motion)
        p[:, j] = here_p + (here_R @ motion[..., None])[..., 0] if joint.slides else here_p
    return Placed(R, p, seats, x)
