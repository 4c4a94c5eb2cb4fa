"""Smooth nonparametric terms at every site: what any named cause is compared with, and what localises an unknown one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from gtpin.diagnosis.hypotheses.hypothesis import SmoothTerm
from gtpin.diagnosis.priors import Priors
from gtpin.effects.basis import Basis, along_track, of_lengths, rods_of
from gtpin.effects.frames import frame_twist
from gtpin.effects.sessions import session_columns
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.robot.parameters import rotation_axes

Floats = npt.NDArray[np.float64]
Functions = Iterator[tuple[tuple[str, ...], Floats, Floats]]
"""Coordinates, functions (N, m) of them, and the functions' sizes (m,)."""

CONDITIONS = ("time", "temp_frame", "temp_link", "payload")


def smooth_terms(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Every smooth term that these data can show, and its displacements."""
    yield from _of_carts(at, priors)
    yield from _of_links(at, priors)
    yield from _of_arm(at, priors)
    yield from _of_platform(at, priors)
    yield from _of_frame(at, priors)


def _of_carts(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    for j, site in enumerate(at.robot.sites):
        carried = any(rod.carrier == j for rod in at.robot.rods) and not at.robot.actuators[j].revolute
        for over, waves, size in _along_coordinates(at, j):
            yield SmoothTerm(site, over, "along"), along_track(at, site, waves, priors.smooth_shift * size)
        if carried:
            for over, waves, size in _aside_coordinates(at, j, priors):
                yield SmoothTerm(site, over, "aside"), _aside(at, site, waves, size, priors)


def _along_coordinates(at: Situation, j: int) -> Functions:
    """Over what a cart may move along its track."""
    yield (f"q{j + 1}",), *cosines(at.travel[:, j], 1, 12, 1.0)
    for k in range(at.robot.n_actuators):
        if k != j:
            yield (f"q{j + 1}", f"q{k + 1}"), *_plane(at.travel[:, j], at.travel[:, k], 5)
    yield from _conditions(at)
    yield from _load(at, j, 4)
    yield from _moves(at, j, 3)


def _aside_coordinates(at: Situation, j: int, priors: Priors) -> Functions:
    """Over what a cart may stray across its track and turn."""
    yield (f"q{j + 1}",), *cosines(at.travel[:, j], 1, 8, 1.0)
    for over, waves, size in _conditions(at):
        if over == ("session",):
            yield over, waves, size
        else:
            yield over, *_changing(waves[:, :4], size[:4], at.travel[:, j], priors)
    yield from _load(at, j, 3)
    yield from _moves(at, j, 2)


def _load(at: Situation, j: int, orders: int) -> Functions:
    rods = rods_of(at, at.robot.sites[j])
    if rods:
        yield ("load",), *cosines(np.clip(at.load[:, rods].mean(axis=1) / 2.0, -1.5, 1.5), 1, orders, 1.0)


def _moves(at: Situation, j: int, orders: int) -> Functions:
    """Direction of approach and speed, and both changing along the track."""
    bends = [np.ones(len(at)), *(np.cos(np.pi / 2.0 * o * (at.travel[:, j] + 1.0)) for o in range(1, orders + 1))]
    for word in ("approach", "speed"):
        if at.varies(f"{word}{j + 1}"):
            x = _scaled(at.covariate(f"{word}{j + 1}"))
            shapes = [x] if word == "approach" else [x, np.abs(x), x * np.abs(x)]
            columns = [shape * bend for shape in shapes for bend in bends]
            yield (f"{word}{j + 1}",), np.stack(columns, axis=1), np.full(len(columns), 0.5)


def _scaled(values: Floats) -> Floats:
    return np.asarray(values / max(float(np.abs(values).max()), 1e-12))


def _conditions(at: Situation) -> Functions:
    for name in CONDITIONS:
        if at.varies(name):
            values = at.covariate(name)
            middle, half = (values.max() + values.min()) / 2.0, np.ptp(values) / 2.0
            yield (name,), *cosines((values - middle) / half, 1, 7 if name == "time" else 3, 1.0)
    if at.varies("session"):
        sessions = session_columns(at)
        yield ("session",), sessions, np.ones(sessions.shape[1])


def _changing(waves: Floats, size: Floats, x: Floats, priors: Priors) -> tuple[Floats, Floats]:
    """Functions, and the same changing linearly with a coordinate (N,)."""
    return np.hstack([waves, waves * x[:, None]]), np.concatenate([size, priors.smooth_change * size])


def _plane(a: Floats, b: Floats, orders: int) -> tuple[Floats, Floats]:
    """Functions of two coordinates together, and of the second alone."""
    columns, sizes = [], []
    for m in range(orders):
        for n in range(1, orders + 1 - m):
            columns.append(np.cos(np.pi / 2.0 * m * (a + 1.0)) * np.cos(np.pi / 2.0 * n * (b + 1.0)))
            sizes.append(1.0 / (m + n))
    return np.stack(columns, axis=1), np.array(sizes) / np.linalg.norm(sizes) * 2.0


def _aside(at: Situation, site: str, waves: Floats, size: Floats, priors: Priors) -> Basis:
    """Two shifts across the track and three turns about the mean of the joints."""
    rods = rods_of(at, site)
    lever = at.carrier_joints[:, rods] - at.carrier_joints[:, rods].mean(axis=1, keepdims=True)
    axis = at.robot.actuators[at.robot.sites.index(site)].axis
    ways = [np.broadcast_to(across, lever.shape) for across in rotation_axes(axis)[:2]]
    sizes = [priors.smooth_shift, priors.smooth_shift]
    if len(rods) > 1:
        ways += [np.cross(turn, lever) for turn in np.eye(3)]
        sizes += [priors.smooth_turn] * 3
    moved = np.einsum("nkiw,nm->nkiwm", np.stack(ways, axis=3), waves).reshape(*lever.shape, -1)
    seat = np.zeros((len(at), len(at.robot.rods), 3, moved.shape[3]))
    seat[:, rods] = moved
    return Basis(np.outer(sizes, size).ravel(), carrier_joints=seat)


def _of_links(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    for i, rod in enumerate(at.robot.rods):

        def length(columns: Floats, size: Floats, i: int = i) -> Basis:
            return of_lengths(at, [i], columns[:, None, :], priors.smooth_shift * size)

        load, size = cosines(np.clip(at.load[:, i] / 2.0, -1.5, 1.5), 1, 5, 1.0)
        sign = np.sign(at.force[:, i])[:, None]
        yield SmoothTerm(rod.site, ("load",), "length"), length(np.hstack([load, sign]), np.append(size, 1.0))
        a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
        parts = [cosines(a, 1, 4, 1.0), cosines(b, 1, 4, 1.0), _plane(a, b, 5)]
        yield (
            SmoothTerm(rod.site, ("direction",), "length"),
            length(np.hstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])),
        )
        moves = _all_moves(at)
        if moves is not None:
            both = np.hstack([moves, moves * a[:, None], moves * b[:, None], moves * load[:, :1]])
            yield SmoothTerm(rod.site, ("approach",), "length"), length(both, np.full(both.shape[1], 0.5))
        for over, waves, size in _conditions(at):
            yield SmoothTerm(rod.site, over, "length"), length(waves, size)


def _all_moves(at: Situation) -> Floats | None:
    """(N, m) direction of approach and speed of every actuator, as far as they vary."""
    names = [f"{word}{k + 1}" for word in ("approach", "speed") for k in range(at.robot.n_actuators)]
    columns = [_scaled(at.covariate(name)) for name in names if at.varies(name)]
    return np.stack(columns, axis=1) if columns else None


def _of_arm(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """All links, each by itself."""
    n = len(at.robot.rods)
    functions = [*_conditions(at), (("position",), *_field(at, 2, priors))]
    moves = _all_moves(at)
    if moves is not None:
        functions.append((("approach",), moves, np.full(moves.shape[1], 0.5)))
    for over, waves, size in functions:
        columns = np.einsum("nm,ij->nimj", waves, np.eye(n)).reshape(len(at), n, -1)
        yield (
            SmoothTerm("arm", over, "length"),
            of_lengths(at, list(range(n)), columns, priors.smooth_shift * np.repeat(size, n)),
        )


def _of_platform(at: Situation, priors: Priors) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Motions of the target and tool on the plate, TCP frame."""
    functions = [*_conditions(at), (("position",), *_field(at, 2, priors))]
    moves = _all_moves(at)
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
    for over, waves, size in _conditions(at):
        columns = np.concatenate([freedoms * wave[:, None, None] for wave in waves.T], axis=2)
        yield SmoothTerm("frame", over, "twist"), Basis(np.concatenate([size6 * s for s in size]), twist=columns)
    waves, size = _field(at, 3, priors)
    twist = np.zeros((len(at), 6, 3, waves.shape[1]))
    twist[:, :3] = np.eye(3)[None, :, :, None] * waves[:, None, None, :]
    sigma = np.tile(priors.smooth_shift * size, 3)
    yield SmoothTerm("frame", ("position",), "shift"), Basis(sigma, twist=twist.reshape(len(at), 6, -1))


def _field(at: Situation, orders: int, priors: Priors) -> tuple[Floats, Floats]:
    """Smooth functions (N, m) of the TCP's position."""
    T = at.poses.T
    reach = priors.smooth_reach * max(float(np.ptp(T, axis=0).max()) / 2.0, 1e-9)
    x = np.clip((T - at.kinematics.home.T[0]) / reach, -1.5, 1.5)
    columns, sizes = [], []
    for a in range(orders + 1):
        for b in range(orders + 1 - a):
            for c in range(orders + 1 - a - b):
                if a + b + c:
                    angle = np.cos(np.pi / 2.0 * a * (x[:, 0] + 1.0)) * np.cos(np.pi / 2.0 * b * (x[:, 1] + 1.0))
                    columns.append(angle * np.cos(np.pi / 2.0 * c * (x[:, 2] + 1.0)))
                    sizes.append(1.0 / (a + b + c))
    return np.stack(columns, axis=1), np.array(sizes) / np.linalg.norm(sizes) * 2.0
