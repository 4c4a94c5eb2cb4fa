"""Displacements of joints, carts and links: their frames, and the deformation of links under load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from gtpin.effects.displacement import Displacement, of_lengths, rods_of
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links_at
from gtpin.kinematics.rotations import skew
from gtpin.robot.chain import SHORTEST, Chain, MovingLink, on_link
from gtpin.robot.constrained_model import joint_axis
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.placement_frames import frame_of_joint, frame_of_tcp, shift
from gtpin.typing import Floats


@dataclass(frozen=True)
class JointFrame:
    """The frame of what an actuator carries, in which its error motions are expressed.

    Of a joint this is its placement frame; of one that does not carry the TCP itself, that of the first joint that does and
    follows it (``<mimic>``). Of a cart it has the base frame's axes, and the mean of the cart's joints as origin.

    ``index``: index of the placement frame that moves: see :mod:`~gtpin.robot.placement_frames`. ``axis``: (3,) unit vector of
    the actuator's axis, in the frame's axes: the actuator slides along it or turns about it. ``across``: (2, 3) unit vectors a
    and b perpendicular to the axis: see :func:`~gtpin.robot.parameters.rotation_axes`. ``on_cart``: indices of the rods whose
    joints are on the cart; none of a joint.
    """

    index: int
    axis: Floats
    across: Floats
    on_cart: tuple[int, ...] = ()

    @property
    def turns(self) -> bool:
        """Whether a rotation of the frame moves anything: not of a cart with a single joint."""
        return len(self.on_cart) != 1


def joint_frame(at: OperatingPoints, site: str) -> JointFrame:
    """The frame of what the actuator at a site carries, and its axis in it."""
    number = at.robot.sites.index(site)
    actuator, rods = at.robot.actuators[number], at.robot.rods_on(number)
    joint_id = at.robot.carriers(number)[0][0]
    axis = np.asarray(actuator.axis) if rods else own_axis(at.robot, joint_id)
    return JointFrame(frame_of_joint(joint_id), axis, rotation_axes(axis)[:2], rods)


def own_axis(robot: Chain, joint_id: int) -> Floats:
    """(3,) unit vector along or about which a joint moves, in its placement frame."""
    twist = joint_axis(robot.model, joint_id)
    return np.asarray(twist[3:] if twist[3:].any() else twist[:3])


def of_joint(at: OperatingPoints, site: str, ways: Floats, columns: Floats, sigma: Floats) -> Displacement:
    """Basis of motions of what an actuator carries, with w c coefficients: w directions of motion times c functions each.

    ways (6, w) are unit twists in the axes of its frame. columns (N, w, c) are their amplitudes, m or rad. sigma (w c,) are
    the typical sizes of the coefficients.
    """
    return of_body(at, site, np.einsum("iw,nwc->niwc", ways, columns).reshape(len(at), 6, -1), sigma)


def of_body(at: OperatingPoints, site: str, twist: Floats, sigma: Floats) -> Displacement:
    """Basis of twists (N, 6, m), m and rad, of what an actuator carries, in its :class:`JointFrame`."""
    frame = joint_frame(at, site)
    if not frame.on_cart:
        return Displacement(sigma, placements=((frame.index, twist),))
    R, T = at.bodies.frame(frame.index)
    away = (T - _middle(at, frame))[:, :, None]
    shift = twist[:, :3] + np.cross(twist[:, 3:], away, axisa=1, axisb=1, axisc=1)
    back = np.swapaxes(R, 1, 2)
    return Displacement(sigma, placements=((frame.index, np.concatenate([back @ shift, back @ twist[:, 3:]], axis=1)),))


def _middle(at: OperatingPoints, frame: JointFrame) -> Floats:
    """(N, 3) the mean of the joints on a cart, base frame, m."""
    return np.asarray(at.carrier_joints[:, frame.on_cart].mean(axis=1))


def of_carried(at: OperatingPoints, site: str, basis: Displacement) -> Floats:
    """(N, 6, m) motion of a cart by a basis in its :class:`JointFrame`: shift, m, and turn, rad."""
    frame, moved = joint_frame(at, site), np.zeros((len(at), 6, len(basis)))
    R, T = at.bodies.frame(frame.index)
    away = (_middle(at, frame) - T)[:, :, None]
    for index, twist in basis.placements:
        if index == frame.index:
            shift, turn = R @ twist[:, :3], R @ twist[:, 3:]
            shift = shift + np.cross(turn, away, axisa=1, axisb=1, axisc=1)
            moved += np.concatenate([shift, turn], axis=1)
    return moved


def cart_load(at: OperatingPoints, site: str) -> tuple[Floats, Floats]:
    """(N, 3) force, N, of the rods on a cart and (N, 3) their moment, N m, about the mean of its joints, base frame."""
    frame = joint_frame(at, site)
    pull = at.force[:, frame.on_cart, None] * at.along[:, frame.on_cart]
    lever = at.carrier_joints[:, frame.on_cart] - _middle(at, frame)[:, None]
    return pull.sum(axis=1), np.cross(lever, pull).sum(axis=1)


def of_tips(at: OperatingPoints, site: str, twists: list[Floats], sigma: Floats) -> Displacement:
    """Basis of motions (N, 6, m), m and rad, of the tips of a site's links relative to their roots, in the axes of each tip.

    All that a link carries moves with its tip, as a rigid body.
    """
    moved = []
    for link, twist in zip(links_at(at.robot, site), twists, strict=True):
        moved += [
            (end, from_end(at, link.tip, end) @ target_at(at, link.tip).actionInverse @ twist) for end in link.ends
        ]
    return Displacement(sigma, placements=tuple(moved))


def lengthened(at: OperatingPoints, site: str, strain: Floats, sigma: Floats) -> Displacement:
    """Basis of the growth of a site's k links: strains (N, k, m), relative to their length, of rods and of other links.

    A rod changes its length. Another link grows in proportion from its own joint: all that it carries moves away from there.
    """
    if rods := rods_of(at, site):
        return of_lengths(at, rods, strain * at.length[:, rods, None], sigma)
    moved = []
    for i, link in enumerate(links_at(at.robot, site)):
        for end in link.ends:
            way = target_at(at, end).actionInverse @ shift(from_root(at.robot, end))
            moved.append((end, way[:, None] * strain[:, None, i]))
    return Displacement(sigma, placements=tuple(moved))


def from_end(at: OperatingPoints, first: int, end: int) -> Floats:
    """(6, 6) matrix that transforms a twist of the frame that ``FrameMotion`` has at one end of a link to that at another."""
    return np.asarray(_placed(at, end).actInv(_placed(at, first)).action)


def _placed(at: OperatingPoints, end: int) -> pin.SE3:
    """Placement, on a link, of the frame that ``FrameMotion`` has at an end of it."""
    return on_link(at.robot, end) * target_at(at, end)


def target_at(at: OperatingPoints, end: int) -> pin.SE3:
    """Placement, in the frame at the end of a link, of the frame that ``FrameMotion`` has there: loads and motions refer to it.

    It is the identity except for the TCP: the link ends at the URDF's TCP, and the target can be at another point.
    """
    robot = at.robot
    return robot.tcp_placement.actInv(at.kinematics.tcp) if end == frame_of_tcp(robot) else pin.SE3.Identity()


def from_root(robot: Chain, end: int) -> Floats:
    """(3,) vector from a link's own joint to an end of it (a joint, the URDF's TCP, an anchor), in the end's axes, m."""
    placement = on_link(robot, end)
    return np.asarray(placement.rotation.T @ placement.translation)


BODY = 2.0
"""Length of such a link over the distance of its centre of mass from the joints. Derived for a uniform beam that ends there."""


def beam(at: OperatingPoints, link: MovingLink) -> Floats:
    """(3,) l u of the beam that bends and twists, in the axes of the link's tip, m: :func:`from_root`.

    A link that turns and whose joints meet in one point has a body all the same. It is a beam along the link's own axis that
    ends in this point, on whose other side the centre of mass is, ``BODY`` times as long as the distance of the centre of mass.
    """
    length, robot = from_root(at.robot, link.tip), at.robot
    twist, lever = joint_axis(robot.model, link.joint_id), np.asarray(robot.model.inertias[link.joint_id].lever)
    if float(np.linalg.norm(length)) >= SHORTEST or not twist[3:].any():
        return length
    towards = -1.0 if float(twist[3:] @ lever) > 0.0 else 1.0
    along = on_link(robot, link.tip).rotation.T @ twist[3:]
    return np.asarray(along) * towards * BODY * float(np.linalg.norm(lever))


OWN_WEIGHT = 3.0 / 8.0
"""Share of a uniform beam's weight w l that, as a point load at the tip, gives the same deflection of the tip as the whole
weight distributed along the length l: (w l^4 / 8) / (w l l^3 / 3)."""


def load_frame(robot: Chain, link: MovingLink) -> int:
    """Index of the frame with the load (``Loads.joints``) on a link: its tip; its own joint where the tip is an anchor."""
    return link.tip if link.tip <= frame_of_tcp(robot) else frame_of_joint(link.joint_id)


def tip_loads(at: OperatingPoints, link: MovingLink) -> Floats:
    """(N, 6) force, N, and moment, N m, on a link's tip, in the tip's axes.

    They are the load of everything beyond the tip, and ``OWN_WEIGHT`` times the weight of the link itself. In a robot with
    loops, all loads on the link count, also those at other joints and at loops' anchors.
    """
    model = at.robot.model
    weight = OWN_WEIGHT * float(model.inertias[link.joint_id].mass) * model.gravity.linear
    target = target_at(at, link.tip)
    carried = _carried(at, link) if at.robot.constraints else at.joint_loads[:, link.tip]
    loads = carried @ target.dualAction.T
    loads[:, :3] += weight @ at.bodies.frame(link.tip)[0] @ target.rotation.T
    return np.asarray(loads)


def _carried(at: OperatingPoints, link: MovingLink) -> Floats:
    """(N, 6) load on a link without its own weight, N and N m, about the origin and in the axes of the frame at its tip.

    That frame is the one that ``FrameMotion`` has.
    """
    own, inertia = frame_of_joint(link.joint_id), at.robot.model.inertias[link.joint_id]
    (R, T), (R_tip, T_tip) = at.bodies.frame(own), at.bodies.frame(link.tip)
    back = np.swapaxes(R, 1, 2)
    R, T = back @ R_tip, np.einsum("nij,nj->ni", back, T_tip - T)  # of the tip, in the link's own placement frame
    centre = T + R @ _placed(at, link.tip).actInv(np.array(inertia.lever))
    weight = float(inertia.mass) * at.robot.model.gravity.linear @ at.bodies.frame(own)[0]
    loads = at.joint_loads[:, own] - np.concatenate([weight, np.cross(centre, weight)], axis=1)
    force = loads[:, :3]
    return np.concatenate([_turned(R, force), _turned(R, loads[:, 3:] - np.cross(T, force))], axis=1)


def _turned(R: Floats, vectors: Floats) -> Floats:
    """(N, 3) vectors in the axes that are the columns of R (N, 3, 3)."""
    return np.asarray(np.einsum("nij,ni->nj", R, vectors))


def bending(length: Floats, loads: Floats) -> Floats:
    """(N, 6) bending of a beam that is fixed at its root: motion of the tip for a unit flexibility 1 / (E I), 1/(N m^2).

    Euler-Bernoulli beam of length l along the unit vector u, with the components of force F and moment M across u at its tip:
    shift = F l^3 / 3 + (M x u) l^2 / 2, turn = (u x F) l^2 / 2 + M l.

    ``length``: (3,) l u, in the tip's axes, m. ``loads``: (N, 6) force, N, and moment, N m, at the tip.
    """
    size = float(np.linalg.norm(length))
    if size == 0.0:
        return np.zeros_like(loads)
    u = length / size
    flat = np.eye(3) - np.outer(u, u)
    force, moment = loads[:, :3] @ flat, loads[:, 3:] @ flat
    shift = force * size**3 / 3.0 - moment @ skew(u).T * size**2 / 2.0
    turn = force @ skew(u).T * size**2 / 2.0 + moment * size
    return np.concatenate([shift, turn], axis=1)


def torsion(length: Floats, loads: Floats) -> Floats:
    """(N, 6) torsion of a beam: motion of the tip for a unit flexibility 1 / (G J), 1/(N m^2): turn = (M . u) u l."""
    size = float(np.linalg.norm(length))
    moved = np.zeros_like(loads)
    if size > 0.0:
        u = length / size
        moved[:, 3:] = np.outer(loads[:, 3:] @ u, u) * size
    return moved
