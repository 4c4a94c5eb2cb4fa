"""Displacements of joints and links of a robot without rods: where they are, and what bends them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.effects.basis import Basis
from gtpin.effects.effect import Floats
from gtpin.effects.sites import links_at
from gtpin.effects.situation import Situation
from gtpin.kinematics.bodies import index_of
from gtpin.kinematics.rotations import skew
from gtpin.robot.chain import joint_axis
from gtpin.robot.moving_links import MovingLink
from gtpin.robot.parameters import rotation_axes


@dataclass(frozen=True)
class JointFrame:
    """The placement frame of a counted joint, to which its motions are referred.

    Parameters
    ----------
    index
        As in :class:`~gtpin.kinematics.bodies.Bodies`.
    axis
        (3,) unit vector along which the joint slides or about which it turns, in that frame.
    across
        (2, 3) the unit vectors a and b across it: see :func:`~gtpin.robot.parameters.rotation_axes`.
    """

    index: int
    axis: Floats
    across: Floats


def joint_frame(at: Situation, site: str) -> JointFrame:
    """The placement frame of the joint at a site."""
    actuator = at.robot.actuators[at.robot.sites.index(site)]
    twist = joint_axis(at.robot.model, actuator.joint_id)
    axis = twist[3:] if actuator.revolute else twist[:3]
    return JointFrame(index_of(actuator.joint_id), axis, rotation_axes(axis)[:2])


def of_joint(at: Situation, site: str, ways: Floats, columns: Floats, sigma: Floats) -> Basis:
    """Motions of a joint's placement frame: ways (6, w) in its axes, times columns (N, w, c); w c coefficients."""
    frame = joint_frame(at, site)
    twist = np.einsum("iw,nwc->niwc", ways, columns).reshape(len(at), 6, -1)
    return Basis(sigma, placements=((frame.index, twist),))


def of_tips(at: Situation, site: str, twists: list[Floats], sigma: Floats) -> Basis:
    """Motions (N, 6, m) of the tips of a site's links relative to their roots, in each tip's axes."""
    found = zip(links_at(at.robot, site), twists, strict=True)
    return Basis(sigma, placements=tuple((link.tip, twist) for link, twist in found))


def reach(at: Situation, link: MovingLink) -> Floats:
    """(3,) from a link's own joint to its tip, in the tip's axes, m."""
    robot = at.kinematics.geometry.robot
    last = link.tip == robot.model.njoints - 1
    placement = robot.tcp_placement if last else robot.model.jointPlacements[link.tip + 1]
    return np.asarray(placement.rotation.T @ placement.translation)


OWN_WEIGHT = 3.0 / 8.0
"""Share of a uniform beam's weight that bends it as much at its tip as the whole does along it: (w l^4 / 8) / (w l l^3 / 3)."""


def tip_loads(at: Situation, link: MovingLink) -> Floats:
    """(N, 6) what hangs on a link's tip, in the tip's axes, N and N m: what is beyond it, and its part of the link's weight."""
    model = at.robot.model
    weight = OWN_WEIGHT * float(model.inertias[link.joint_id].mass) * model.gravity.linear
    loads = at.joint_loads[:, link.tip].copy()
    loads[:, :3] += weight @ at.bodies.R[:, link.tip]
    return loads


def bending(length: Floats, loads: Floats) -> Floats:
    """(N, 6) motion of a beam's tip for a bending flexibility 1 / (E I) of 1 / (N m^2), fixed at its root.

    Euler-Bernoulli, for a beam along u of length l with a force F and moment M at its tip, across u:
    shift = F l^3 / 3 + (M x u) l^2 / 2, turn = (u x F) l^2 / 2 + M l.

    Parameters
    ----------
    length
        (3,) l u, in the tip's axes, m.
    loads
        (N, 6) force, N, and moment, N m, at the tip.
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
    """(N, 6) motion of a beam's tip for a torsional flexibility 1 / (G J) of 1 / (N m^2): turn = (M . u) u l."""
    size = float(np.linalg.norm(length))
    moved = np.zeros_like(loads)
    if size > 0.0:
        u = length / size
        moved[:, 3:] = np.outer(loads[:, 3:] @ u, u) * size
    return moved
