"""Where a geometry places the parts of a robot: each parameter moves placement frames and anchors.

Frames, their indices and their twists are those of :mod:`~gtpin.robot.placement_frames`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from gtpin.kinematics.rotations import exp, left_jacobian, skew, twist_jacobian
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.geometry import Geometry
from gtpin.robot.placement_frames import frame_of_tcp
from gtpin.typing import Floats, Ints, Mask


@dataclass(frozen=True)
class PlacedParts:
    """Places of the parts: the same at all postures, or one of each of N postures.

    ``placements``: (J, 12) or (N, J, 12) of the joints on their parents, as :class:`~gtpin.kinematics.copies.Copies` has them.
    ``anchors``: (2 L, 3) or (N, 2 L, 3) positions of the loops' anchors in the frames of the
    joints that carry them, m. ``tcp``: (12,) or (N, 12) the TCP on its joint.
    """

    placements: Floats
    anchors: Floats
    tcp: Floats

    def take(self, rows: Ints | Mask) -> PlacedParts:
        """The places at some of the postures."""
        of_all = ((self.placements, 2), (self.anchors, 2), (self.tcp, 1))
        return PlacedParts(*(x if x.ndim == dimensions else x[rows] for x, dimensions in of_all))


def numbers(M: pin.SE3) -> Floats:
    """(12,) a placement as numbers."""
    return np.concatenate([np.asarray(M.rotation).T.ravel(), M.translation])


def rotation(placements: Floats) -> Floats:
    """(..., 3, 3) rotations of placements (..., 12)."""
    return np.swapaxes(placements[..., :9].reshape(*placements.shape[:-1], 3, 3), -1, -2)


def times(placements: Floats, placement: Floats) -> tuple[Floats, Floats]:
    """Rotation (N, 3, 3) and translation (N, 3) of placements (N, 12) times another, (12,) or (N, 12)."""
    R, own = rotation(placements), rotation(placement)
    return R @ own, (R @ placement[..., 9:, None])[..., 0] + placements[:, 9:]


def own_placements(robot: Chain) -> Floats:
    """(J, 12) placements of the joints on their parents in the robot's file. A copy."""
    return np.array([numbers(M) for M in list(robot.model.jointPlacements)[1:]]).reshape(-1, 12)


def placed_by(geometry: Geometry) -> PlacedParts:
    """The places that a geometry gives; see :class:`~gtpin.robot.parameters.Parameter`."""
    robot = geometry.robot
    anchors = np.array([M.translation for _, M in robot.anchors]).reshape(-1, 3)
    tcp = numbers(robot.tcp_placement * pin.exp6(geometry.platform))
    placements, J = own_placements(robot), frame_of_tcp(robot)
    for frame, twist in _total_twists(geometry).items():
        if frame < J:
            placements[frame] = numbers(robot.model.jointPlacements[frame + 1] * pin.exp6(twist))
        elif frame > J:
            axes = robot.anchor_axes[frame - J - 1]
            anchors[frame - J - 1] = exp(axes @ twist[3:]) @ (anchors[frame - J - 1] + axes @ twist[:3])
    return PlacedParts(placements, anchors, tcp)


def _total_twists(geometry: Geometry) -> dict[int, Floats]:
    """By index of a frame, the sum (6,) of its twists by all parameters."""
    found = {frame_of_tcp(geometry.robot): geometry.platform}
    for parameter, deviation in geometry.all_deviations:
        if deviation and parameter.kind != "platform":  # a free target's place counts from the robot's TCP
            for frame, twist in parameter.moves:
                found[frame] = found.get(frame, 0.0) + deviation * twist
    return found


@dataclass(frozen=True)
class Moves:
    """What the parameters of a geometry move, to first order.

    ``frames``: of each frame its index, the columns (parameters) that move it, and their twists (6, c) or (N, 6, c).
    ``scales``: of each scale of a drive the column, and the index of the actuator.
    """

    frames: tuple[tuple[int, Ints, Floats], ...]
    scales: tuple[tuple[int, int], ...]


def moves_of(geometry: Geometry, placed: PlacedParts) -> Moves:
    """The motions by the parameters of a geometry, at its values and ``placed`` by it."""
    robot, totals = geometry.robot, _total_twists(geometry)
    found: dict[int, list[tuple[int, Floats]]] = {}
    for column, parameter in enumerate(geometry.parameters):
        for frame, twist in parameter.moves:
            found.setdefault(frame, []).append((column, twist))
    frames = []
    for frame, own in found.items():
        total, twists = totals.get(frame, np.zeros(6)), np.stack([twist for _, twist in own], axis=1)
        anchor = frame - frame_of_tcp(robot) - 1
        if anchor < 0:
            moved = twist_jacobian(total) @ twists
        else:
            axes, w = robot.anchor_axes[anchor], robot.anchor_axes[anchor] @ total[3:]
            shifts = exp(w) @ axes @ twists[:3] - skew(placed.anchors[anchor]) @ left_jacobian(w) @ axes @ twists[3:]
            moved = np.concatenate([axes.T @ shifts, np.zeros_like(shifts)])
        frames.append((frame, np.array([column for column, _ in own]), moved))
    return Moves(tuple(frames), tuple((c, p.drive) for c, p in enumerate(geometry.parameters) if p.drive is not None))


def twisted(robot: Chain, placed: PlacedParts, twists: Mapping[int, Floats]) -> PlacedParts:
    """The places at N postures after finite twists (N, 6) of some frames: a placement times the exponential of its twist."""
    if not twists:
        return placed
    n, J = len(next(iter(twists.values()))), frame_of_tcp(robot)
    found = placed
    joints = {f: twist for f, twist in twists.items() if f < J}
    if joints:
        moved = np.array(np.broadcast_to(placed.placements, (n, J, 12)))
        for f, twist in joints.items():
            moved[:, f] = _after(moved[:, f], twist)
        found = replace(found, placements=moved)
    if J in twists:
        found = replace(found, tcp=_after(np.array(np.broadcast_to(placed.tcp, (n, 12))), twists[J]))
    anchors = {f - J - 1: twist for f, twist in twists.items() if f > J}
    if anchors:
        at = np.array(np.broadcast_to(placed.anchors, (n, *placed.anchors.shape[-2:])))
        for a, twist in anchors.items():
            at[:, a] += twist[:, :3] @ robot.anchor_axes[a].T
        found = replace(found, anchors=at)
    return found


def _after(placements: Floats, twist: Floats) -> Floats:
    """(N, 12) placements times the exponentials of twists (N, 6)."""
    R, w = rotation(placements), twist[:, 3:]
    found = np.empty_like(placements)
    found[:, :9] = np.swapaxes(R @ exp(w), 1, 2).reshape(-1, 9)
    found[:, 9:] = placements[:, 9:] + np.einsum("nij,njk,nk->ni", R, left_jacobian(w), twist[:, :3])
    return found


def joints_on_carrier(geometry: Geometry, actuator: int) -> Iterator[tuple[int, list[int]]]:
    """Parameters that move rods' joints on an actuator's carrier: the index of each, and the rods whose joints it moves."""
    robot, carried = geometry.robot, list(geometry.robot.rods_on(actuator))
    for j, p in enumerate(geometry.parameters):
        if p.kind in ("cart_joint", "arm_joint"):
            # Of one rod, or of all rods of the carrier, which has the actuator's name.
            whole = p.part == robot.actuators[actuator].site
            if own := carried if whole else [i for i in carried if robot.rod(i).name == p.part]:
                yield j, own


def carrier_rates(geometry: Geometry) -> Floats:
    """(k, 3) motion of each rod's joint on its carrier per unit of its actuator's command, all commands zero, base frame."""
    robot, placed = geometry.robot, placed_by(geometry)
    own = placed.placements
    rates = np.zeros((len(robot.rod_seats), 3))
    for i, (seat, carrier) in enumerate(zip(robot.rod_seats, robot.rod_carriers, strict=True)):
        if carrier is not None:
            actuator = robot.actuators[carrier]
            R, axis = rotation(own[actuator.joint_id - 1]), joint_axis(robot.model, actuator.joint_id)
            rates[i] = R @ (axis[:3] + np.cross(axis[3:], placed.anchors[seat])) * geometry.scale[carrier]
    return rates
