"""Smooth nonparametric terms at every site. Named causes are compared with them, and they localise an unknown cause."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import SmoothTerm
from gtpin.diagnosis.hypotheses.smooth_functions import (
    Functions,
    all_moves,
    along_coordinates,
    aside_coordinates,
    conditions,
    field,
    plane,
)
from gtpin.diagnosis.priors import Priors
from gtpin.effects.basis import Basis, along_track, of_lengths, rods_of
from gtpin.effects.chain_motions import joint_frame, of_joint, of_tips
from gtpin.effects.drives import drive_sizes
from gtpin.effects.sites import links_at
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines, frame_twist
from gtpin.typing import Floats


def smooth_terms(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Every smooth term that these data can show, and its displacements."""
    yield from _of_carts(at, priors)
    if at.robot.rods:
        yield from _of_links(at, priors)
        yield from _of_arm(at, priors)
    else:
        yield from of_joints(at, priors)
        yield from of_moving_links(at, priors)
    yield from _of_platform(at, priors)
    yield from _of_frame(at, priors)


def _of_carts(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    for j, site in enumerate(at.robot.sites):
        carried = any(rod.carrier == j for rod in at.robot.rods) and not at.robot.actuators[j].revolute
        for over, waves, size in along_coordinates(at, j):
            yield (
                SmoothTerm(site, over, "along"),
                along_track(at, site, waves, drive_sizes(at, site, size, priors.smooth_shift)),
            )
        if carried:
            for over, waves, size in aside_coordinates(at, j, priors):
                yield SmoothTerm(site, over, "aside"), _aside(at, site, waves, size, priors)


def _aside(at: Situation, site: str, waves: Floats, size: Floats, priors: Priors) -> Basis:
    """Two shifts across the track and, for a cart with several joints, three rotations about the mean of its joints."""
    frame, turns = joint_frame(at, site), 3 if len(rods_of(at, site)) > 1 else 0
    ways = np.zeros((6, 2 + turns))
    ways[:3, :2], ways[3:, 2:] = frame.across.T, np.eye(3)[:, :turns]
    sizes = [priors.smooth_shift] * 2 + [priors.smooth_turn] * turns
    columns = np.broadcast_to(waves[:, None, :], (len(at), len(sizes), waves.shape[1]))
    return of_joint(at, site, ways, columns, np.outer(sizes, size).ravel())


def _of_links(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    for i, rod in enumerate(at.robot.rods):

        def length(columns: Floats, size: Floats, i: int = i) -> Basis:
            return of_lengths(at, [i], columns[:, None, :], priors.smooth_shift * size)

        load, size = cosines(np.clip(at.load[:, i] / 2.0, -1.5, 1.5), 1, 5, 1.0)
        sign = np.sign(at.force[:, i])[:, None]
        yield SmoothTerm(rod.site, ("load",), "length"), length(np.hstack([load, sign]), np.append(size, 1.0))
        a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
        parts = [cosines(a, 1, 4, 1.0), cosines(b, 1, 4, 1.0), plane(a, b, 5)]
        yield (
            SmoothTerm(rod.site, ("direction",), "length"),
            length(np.hstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])),
        )
        moves = all_moves(at)
        if moves is not None:
            both = np.hstack([moves, moves * a[:, None], moves * b[:, None], moves * load[:, :1]])
            yield SmoothTerm(rod.site, ("approach",), "length"), length(both, np.full(both.shape[1], 0.5))
        for over, waves, size in conditions(at):
            yield SmoothTerm(rod.site, over, "length"), length(waves, size)


def _of_arm(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Changes of the lengths of all rods, with separate coefficients for each rod."""
    n = len(at.robot.rods)
    functions = [*conditions(at), (("position",), *field(at, 2, priors))]
    moves = all_moves(at)
    if moves is not None:
        functions.append((("approach",), moves, np.full(moves.shape[1], 0.5)))
    for over, waves, size in functions:
        columns = np.einsum("nm,ij->nimj", waves, np.eye(n)).reshape(len(at), n, -1)
        yield (
            SmoothTerm("arm", over, "length"),
            of_lengths(at, list(range(n)), columns, priors.smooth_shift * np.repeat(size, n)),
        )


def _of_platform(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Motions of the target and tool on the platform, TCP frame."""
    functions = [*conditions(at), (("position",), *field(at, 2, priors))]
    moves = all_moves(at)
    if moves is not None:
        functions.append((("approach",), moves, np.full(moves.shape[1], 0.5)))
    for over, waves, size in functions:
        twist = np.zeros((len(at), 6, 6, waves.shape[1]))
        twist[:, :3, :3] = at.poses.R[:, :, :, None] * waves[:, None, None, :]
        twist[:, 3:, 3:] = at.poses.R[:, :, :, None] * waves[:, None, None, :]
        sigma = np.concatenate([np.full(3, priors.smooth_shift), np.full(3, priors.smooth_turn)])[:, None] * size
        yield SmoothTerm("platform", over, "twist"), Basis(sigma.ravel(), twist=twist.reshape(len(at), 6, -1))


def _of_frame(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    freedoms, size6 = frame_twist(at)
    for over, waves, size in conditions(at):
        columns = np.concatenate([freedoms * wave[:, None, None] for wave in waves.T], axis=2)
        yield SmoothTerm("frame", over, "twist"), Basis(np.concatenate([size6 * s for s in size]), twist=columns)
    waves, size = field(at, 3, priors)
    twist = np.zeros((len(at), 6, 3, waves.shape[1]))
    twist[:, :3] = np.eye(3)[None, :, :, None] * waves[:, None, None, :]
    sigma = np.tile(priors.smooth_shift * size, 3)
    yield SmoothTerm("frame", ("position",), "shift"), Basis(sigma, twist=twist.reshape(len(at), 6, -1))


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
