"""Where a geometry places the parts of a robot: every parameter is a motion of placement frames and anchors.

The *frames* of a robot with J joints and L loops are the placement frames of its joints (a joint's frame on its parent, before
its own motion), the TCP on the body that carries it, and the 2 L anchors of its loops. Joint j of Pinocchio has the index
j - 1, the TCP the index J, anchor a the index J + 1 + a. A *twist* of a frame is a small motion in its own axes: position, m,
then rotation vector, rad; of an anchor, whose own axes are those of its link, the rotation moves nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from gtpin.kinematics.rotations import exp, left_jacobian, skew, twist_jacobian
from gtpin.robot.chain import Chain
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.geometry import Geometry
from gtpin.robot.parameters import Parameter, rotation_axes
from gtpin.typing import Floats, Ints, Mask


@dataclass(frozen=True)
class PlacedParts:
    """Places of the parts: the same at all postures, or one of each of N postures.

    ``placements``: (J, 12) or (N, J, 12) of the joints on their parents, as :class:`~gtpin.kinematics.copies.Copies` has them;
    None: those of the robot's file. ``anchors``: (2 L, 3) or (N, 2 L, 3) positions of the loops' anchors in the frames of the
    joints that carry them, m. ``tcp``: (12,) or (N, 12) the TCP on its joint.
    """

    placements: Floats | None
    anchors: Floats
    tcp: Floats

    def take(self, rows: Ints | Mask) -> PlacedParts:
        """The places at some of the postures."""
        placements, anchors, tcp = self.placements, self.anchors, self.tcp
        return PlacedParts(
            placements if placements is None or placements.ndim == 2 else placements[rows],
            anchors if anchors.ndim == 2 else anchors[rows],
            tcp if tcp.ndim == 1 else tcp[rows],
        )


def numbers(M: pin.SE3) -> Floats:
    """(12,) a placement as numbers."""
    return np.concatenate([np.asarray(M.rotation).T.ravel(), M.translation])


def rotation(placements: Floats) -> Floats:
    """(..., 3, 3) rotations of placements (..., 12)."""
    return np.swapaxes(placements[..., :9].reshape(*placements.shape[:-1], 3, 3), -1, -2)


def frame_of_joint(joint_id: int) -> int:
    """The index of a joint's placement frame."""
    return joint_id - 1


def frame_of_tcp(robot: Chain) -> int:
    """The index of the TCP."""
    return int(robot.model.njoints) - 1


def frame_of_anchor(robot: Chain, anchor: int) -> int:
    """The index of an anchor's frame."""
    return int(robot.model.njoints) + anchor


def own_placements(robot: Chain) -> Floats:
    """(J, 12) placements of the joints on their parents in the robot's file. A copy."""
    if "placements" not in robot.memo:
        robot.memo["placements"] = np.array([numbers(M) for M in list(robot.model.jointPlacements)[1:]]).reshape(-1, 12)
    found: Floats = robot.memo["placements"].copy()
    return found


def placed_by(geometry: Geometry) -> PlacedParts:
    """The places that a geometry gives.

    A placement is multiplied from the right by the exponential of its deviation. A rod's length moves its anchor along it; its
    joint on the platform moves its first joint; its joint on the carrier moves the other anchor, in the base frame's axes. A
    track's direction turns the placement of the carrier's joint, while the anchors on the carrier stay where they are with all
    commands zero.
    """
    robot = geometry.robot
    anchors = np.array([M.translation for _, M in robot.anchors]).reshape(-1, 3)
    tcp = numbers(robot.tcp_placement * pin.exp6(geometry.platform))
    if not geometry.deviation.any():
        return PlacedParts(None, anchors, tcp)
    placements = own_placements(robot)
    for j, twist in enumerate(geometry.deviations("placement", "joint", (robot.model.njoints, 6))[1:]):
        if twist.any():
            placements[j] = numbers(robot.model.jointPlacements[j + 1] * pin.exp6(twist))
    anchors += np.einsum("aij,aj->ai", robot.anchor_axes, geometry.anchors)
    if robot.rods:
        _place_rods(geometry, placements, anchors)
    return PlacedParts(placements, anchors, tcp)


def _place_rods(geometry: Geometry, placements: Floats, anchors: Floats) -> None:
    robot, count = geometry.robot, len(geometry.robot.rods)
    length = geometry.deviations("length", "rod", (count, 1))[:, 0]
    P, C = (geometry.deviations(kind, "rod", (count, 3)) for kind in ("platform_joint", "carrier_joint"))
    R_tcp, carriers = np.asarray(robot.tcp_placement.rotation), _carriers(geometry)
    for i, rod in enumerate(robot.rods):
        carrier = carriers[rod.carrier]
        placements[rod.joint_id - 1, 9:] += R_tcp @ P[i]
        anchors[rod.tip] += length[i] * rod.along
        anchors[rod.seat] = carrier.turned.T @ (carrier.R @ anchors[rod.seat] + C[i])
        if rod.carrier is not None:
            placements[robot.actuators[rod.carrier].joint_id - 1, :9] = carrier.turned.T.ravel()


@dataclass(frozen=True)
class _Carrier:
    """The direction of what carries joints of rods. ``R``: (3, 3) nominal rotation to the base frame of the joint that carries
    the anchors, all commands zero. ``vector``: (3,) rotation of the track or axis, base frame, rad. ``turned``: (3, 3) rotation
    of the joint after it."""

    R: Floats
    vector: Floats
    turned: Floats


def _carriers(geometry: Geometry) -> dict[int | None, _Carrier]:
    """The carriers by the index of their actuator; None: the base."""
    robot = geometry.robot
    angles = geometry.deviations("direction", "actuator", (robot.n_actuators, 3))
    found: dict[int | None, _Carrier] = {None: _Carrier(np.eye(3), np.zeros(3), np.eye(3))}
    for a in {rod.carrier for rod in robot.rods if rod.carrier is not None}:
        R = np.asarray(robot.model.jointPlacements[robot.actuators[a].joint_id].rotation)
        vector = angles[a] @ rotation_axes(robot.actuators[a].axis)
        found[a] = _Carrier(R, vector, exp(vector) @ R if vector.any() else R)
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
    deviations = geometry.deviations("placement", "joint", (geometry.robot.model.njoints, 6))
    carriers, scales = _carriers(geometry), []
    found: dict[int, list[tuple[int, Floats]]] = {}
    for column, p in enumerate(geometry.parameters):
        if p.kind == "scale":
            scales.append((column, p.owner))
            continue
        for frame, twist in _moved(geometry, p, deviations, carriers, placed.anchors):
            found.setdefault(frame, []).append((column, twist))
    frames = [(f, np.array([c for c, _ in own]), np.stack([t for _, t in own], axis=1)) for f, own in found.items()]
    return Moves(tuple(frames), tuple(scales))


def _moved(
    geometry: Geometry, p: Parameter, deviations: Floats, carriers: Mapping[int | None, _Carrier], anchors: Floats
) -> list[tuple[int, Floats]]:
    """Frames that one parameter moves, and their twists (6,)."""
    robot = geometry.robot
    if p.kind == "placement":
        return [(frame_of_joint(p.owner), twist_jacobian(deviations[p.owner])[:, p.component])]
    if p.kind == "platform":
        return [(frame_of_tcp(robot), twist_jacobian(geometry.platform)[:, p.component])]
    if p.kind == "anchor":
        moved = [a for a, leading in enumerate(robot.leading_anchors) if leading == p.owner]
        return [(frame_of_anchor(robot, a), np.eye(6)[p.component]) for a in moved]
    if p.kind == "direction":
        return _turned(robot, p, carriers[p.owner], anchors)
    rod = robot.rods[p.owner]
    if p.kind == "platform_joint":
        R = np.asarray(robot.model.jointPlacements[rod.joint_id].rotation.T @ robot.tcp_placement.rotation)
        return [(frame_of_joint(rod.joint_id), shift(R[:, p.component]))]
    if p.kind == "length":
        return [(frame_of_anchor(robot, rod.tip), shift(robot.anchor_axes[rod.tip].T @ rod.along))]
    turned = robot.anchor_axes[rod.seat].T @ carriers[rod.carrier].turned.T
    return [(frame_of_anchor(robot, rod.seat), shift(turned[:, p.component]))]


def shift(translation: Floats) -> Floats:
    """(6,) the twist of a translation (3,), m."""
    return np.concatenate([translation, np.zeros(3)])


def _turned(robot: Chain, p: Parameter, carrier: _Carrier, anchors: Floats) -> list[tuple[int, Floats]]:
    """A direction turns the carrier's joint, and its anchors back about that joint."""
    actuator, turned = robot.actuators[p.owner], carrier.turned
    rate = left_jacobian(carrier.vector) @ rotation_axes(actuator.axis)[p.component]
    found = [(frame_of_joint(actuator.joint_id), np.concatenate([np.zeros(3), turned.T @ rate]))]
    for rod in robot.rods:
        if rod.carrier == p.owner:
            back = -turned.T @ np.cross(rate, turned @ anchors[rod.seat])
            found.append((frame_of_anchor(robot, rod.seat), shift(robot.anchor_axes[rod.seat].T @ back)))
    return found


def twisted(robot: Chain, placed: PlacedParts, twists: Mapping[int, Floats]) -> PlacedParts:
    """The places at N postures after finite twists (N, 6) of some frames: a placement times the exponential of its twist."""
    if not twists:
        return placed
    n, J = len(next(iter(twists.values()))), frame_of_tcp(robot)
    found = placed
    joints = {f: twist for f, twist in twists.items() if f < J}
    if joints:
        own = own_placements(robot) if placed.placements is None else placed.placements
        moved = np.array(np.broadcast_to(own, (n, J, 12)))
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
    found[:, 9:] = placements[:, 9:] + np.einsum("nij,njk,nk->ni", R, _left_jacobians(w), twist[:, :3])
    return found


def _left_jacobians(w: Floats) -> Floats:
    """(N, 3, 3) the integrals of exp(s w) over s from 0 to 1: a series, as the rotations are small or zero."""
    K = skew(w)
    term, total, k = np.broadcast_to(np.eye(3), K.shape), np.broadcast_to(np.eye(3), K.shape), 1
    while term.size and np.abs(term).max() > np.finfo(float).eps:
        term = term @ K / (k + 1)
        total, k = total + term, k + 1
    return np.asarray(total)


def carrier_rates(geometry: Geometry) -> Floats:
    """(k, 3) motion of each rod's joint on its carrier per unit of its actuator's command, all commands zero, base frame."""
    robot, placed = geometry.robot, placed_by(geometry)
    own = own_placements(robot) if placed.placements is None else placed.placements
    rates = np.zeros((len(robot.rods), 3))
    for i, rod in enumerate(robot.rods):
        if rod.carrier is not None:
            actuator = robot.actuators[rod.carrier]
            R, axis = rotation(own[actuator.joint_id - 1]), joint_axis(robot.model, actuator.joint_id)
            moved = axis[:3] + np.cross(axis[3:], placed.anchors[rod.seat])
            rates[i] = R @ moved * geometry.scale[rod.carrier]
    return rates


def longer_rods(robot: Chain) -> tuple[tuple[int, Floats], ...]:
    """Of each rod the frame of the anchor at its end, and (6,) the twist of this frame by a longer rod."""
    ways = ((rod.tip, robot.anchor_axes[rod.tip].T @ rod.along) for rod in robot.rods)
    return tuple((frame_of_anchor(robot, tip), shift(way)) for tip, way in ways)
