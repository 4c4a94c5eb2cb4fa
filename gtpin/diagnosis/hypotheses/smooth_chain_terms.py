"""Smooth nonparametric terms of a robot without rods: shifts and tilts of joint axes, motions of links' tips."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import SmoothTerm
from gtpin.diagnosis.hypotheses.smooth_functions import Functions, all_moves, aside_coordinates, conditions, field
from gtpin.diagnosis.priors import Priors
from gtpin.effects.basis import Basis
from gtpin.effects.chain_motions import joint_frame, of_joint, of_tips
from gtpin.effects.sites import links_at
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.typing import Floats


def of_joints(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Smooth shifts and tilts of every joint's axis: all motions of its placement frame except the joint's own motion."""
    for j, site in enumerate(at.robot.sites):
        frame = joint_frame(at, site)
        ways = np.zeros((6, 5))
        ways[:3, :2] = ways[3:, 2:4] = frame.across.T
        turning = at.robot.actuators[j].revolute
        ways[: 3 if turning else 0, 4] = frame.axis if turning else 0.0
        if not turning:
            ways[3:, 4] = frame.axis
        last = priors.smooth_shift if turning else priors.smooth_turn
        sizes = [*[priors.smooth_shift] * 2, *[priors.smooth_turn] * 2, last]
        for over, waves, size in aside_coordinates(at, j, priors):
            columns = np.broadcast_to(waves[:, None, :], (len(at), 5, waves.shape[1]))
            yield SmoothTerm(site, over, "aside"), of_joint(at, site, ways, columns, np.outer(sizes, size).ravel())


def of_moving_links(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Smooth shifts and rotations of every link's tip relative to its root, over its load and the measurement conditions.

    Each link by itself, and all links together.
    """
    links = links_at(at.robot, "arm")
    for link in links:
        for over, waves, size in (*_loads(at, link.tip), *_of_all(at)):
            yield SmoothTerm(link.name, over, "tip"), _tips(at, link.name, [waves], size, priors)
    for over, waves, size in (*_of_all(at), (("position",), *field(at, 2, priors))):
        # The same functions at every link, with coefficients of its own.
        count, m = len(links), waves.shape[1]
        own = [np.einsum("nm,k->nkm", waves, np.eye(count)[i]).reshape(len(at), count * m) for i in range(count)]
        yield SmoothTerm("arm", over, "tip"), _tips(at, "arm", own, np.tile(size, count), priors)


def _of_all(at: Situation) -> Functions:
    yield from conditions(at)
    moves = all_moves(at)
    if moves is not None:
        yield ("approach",), moves, np.full(moves.shape[1], 0.5)


def _loads(at: Situation, index: int) -> Functions:
    """Functions of the six components of the load at a link's tip, for those that vary."""
    mean, spread = (values[index] for values in at.references.joints)
    varying = at.joint_loads[:, index].std(axis=0) > 1e-6 * spread
    parts = [
        cosines(np.clip((at.joint_loads[:, index, c] - mean[c]) / spread[c] / 2.0, -1.5, 1.5), 1, 3, 1.0)
        for c in range(6)
        if varying[c]
    ]
    if parts:
        yield ("load",), np.hstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])


def _tips(at: Situation, site: str, waves: list[Floats], size: Floats, priors: Priors) -> Basis:
    """Six motions of the tips of a site's links; ``waves`` has the functions (N, m) of each link."""
    scale = np.array([priors.smooth_shift] * 3 + [priors.smooth_turn] * 3)
    twists = [np.einsum("ij,nm->nijm", np.eye(6), w).reshape(len(at), 6, -1) for w in waves]
    return of_tips(at, site, twists, np.outer(scale, size).ravel())
