"""Smooth free motions at every site: what any named cause has to beat, and what tells where an unknown one sits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from gtpin.effects.basis import Basis, along_track, of_lengths, rods_of
from gtpin.effects.frames import frame_twist
from gtpin.effects.sessions import session_columns
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines
from gtpin.robot.parameters import rotation_axes

Floats = npt.NDArray[np.float64]

SHIFT, TURN = 4e-5, 4e-5
"""Sizes of free motions, m and rad."""
CONDITIONS = ("time", "temp_frame", "temp_link", "payload")


def rivals(at: Situation) -> Iterator[tuple[str, str, Basis]]:
    """Site, coordinates and displacements of every free motion that these data can show."""
    yield from _of_carts(at)
    yield from _of_links(at)
    yield from _of_platform(at)
    yield from _of_frame(at)


def _of_carts(at: Situation) -> Iterator[tuple[str, str, Basis]]:
    for j, site in enumerate(at.robot.sites):
        across = bool(rods_of(at, site)) and not at.robot.actuators[j].revolute
        for coordinates, waves, size in _over_actuator(at, j):
            yield site, coordinates, along_track(at, site, waves, SHIFT * size)
            if across and coordinates in (f"q{j + 1}", "time", "load"):
                yield site, f"{coordinates} across", _across(at, site, waves, SHIFT * size)


def _over_actuator(at: Situation, j: int) -> Iterator[tuple[str, Floats, Floats]]:
    """Coordinates, functions (N, m) and sizes (m,) over which a cart may move freely."""
    yield f"q{j + 1}", *cosines(at.travel[:, j], 1, 12, 1.0)
    for k in range(at.robot.n_actuators):
        if k != j:
            yield f"q{j + 1},q{k + 1}", *_plane(at.travel[:, j], at.travel[:, k], 5)
    yield from _over_conditions(at)
    rods = rods_of(at, at.robot.sites[j])
    if rods:
        yield "load", *cosines(np.clip(at.load[:, rods].mean(axis=1) / 2.0, -1.5, 1.5), 1, 4, 1.0)
    for word in ("approach", "speed"):
        name = f"{word}{j + 1}"
        if at.varies(name):
            values = at.covariate(name)
            x = values / max(float(np.abs(values).max()), 1e-12)
            bends = [np.ones(len(at)), *(np.cos(np.pi / 2.0 * o * (at.travel[:, j] + 1.0)) for o in (1, 2, 3))]
            columns = [x * bend for bend in bends] + ([np.abs(x) * bend for bend in bends] if word == "speed" else [])
            yield name, np.stack(columns, axis=1), np.full(len(columns), 0.5)


def _over_conditions(at: Situation) -> Iterator[tuple[str, Floats, Floats]]:
    for name in CONDITIONS:
        if at.varies(name):
            values = at.covariate(name)
            middle, half = (values.max() + values.min()) / 2.0, np.ptp(values) / 2.0
            yield name, *cosines((values - middle) / half, 1, 5 if name == "time" else 3, 1.0)
    if at.varies("session"):
        sessions = session_columns(at)
        yield "session", sessions, np.ones(sessions.shape[1])


def _plane(a: Floats, b: Floats, orders: int) -> tuple[Floats, Floats]:
    """Functions of two coordinates together that are functions of neither alone."""
    columns, sizes = [], []
    for m in range(1, orders):
        for n in range(1, orders + 1 - m):
            columns.append(np.cos(np.pi / 2.0 * m * (a + 1.0)) * np.cos(np.pi / 2.0 * n * (b + 1.0)))
            sizes.append(1.0 / (m + n))
    return np.stack(columns, axis=1), np.array(sizes) / np.linalg.norm(sizes) * 2.0


def _across(at: Situation, site: str, waves: Floats, sigma: Floats) -> Basis:
    axes = rotation_axes(at.robot.actuators[at.robot.sites.index(site)].axis)[:2]
    m = waves.shape[1]
    seat = np.zeros((len(at), len(at.robot.rods), 3, 2 * m))
    for a, axis in enumerate(axes):
        for i in rods_of(at, site):
            seat[:, i, :, a * m : (a + 1) * m] = axis[None, :, None] * waves[:, None, :]
    return Basis(np.tile(sigma, 2), seat=seat)


def _of_links(at: Situation) -> Iterator[tuple[str, str, Basis]]:
    n = len(at.robot.rods)
    everything = list(range(n))
    for coordinates, waves, size in _over_conditions(at):
        columns = np.einsum("nm,ij->nimj", waves, np.eye(n)).reshape(len(at), n, -1)
        yield "arm", coordinates, of_lengths(at, everything, columns, SHIFT * np.repeat(size, n))
    for i, rod in enumerate(at.robot.rods):
        load, size = cosines(np.clip(at.load[:, i] / 2.0, -1.5, 1.5), 1, 5, 1.0)
        sign = np.sign(at.force[:, i])[:, None]
        columns = np.hstack([load, sign])
        yield rod.site, "load", of_lengths(at, [i], columns[:, None, :], SHIFT * np.append(size, 1.0))
        a, b = (np.clip(at.tilt[:, i, c] / 2.5, -1.5, 1.5) for c in (0, 1))
        both, both_size = _plane(a, b, 5)
        one, one_size = cosines(a, 1, 4, 1.0)
        two, two_size = cosines(b, 1, 4, 1.0)
        columns = np.hstack([one, two, both])
        sigma = SHIFT * np.concatenate([one_size, two_size, both_size])
        yield rod.site, "direction", of_lengths(at, [i], columns[:, None, :], sigma)


def _of_platform(at: Situation) -> Iterator[tuple[str, str, Basis]]:
    """Motions of the target and tool on the plate, TCP frame."""
    functions = [*_over_conditions(at), ("position", *_field(at, 2))]
    for coordinates, waves, size in functions:
        twist = np.zeros((len(at), 6, 6, waves.shape[1]))
        twist[:, :3, :3] = at.poses.R[:, :, :, None] * waves[:, None, None, :]
        twist[:, 3:, 3:] = at.poses.R[:, :, :, None] * waves[:, None, None, :]
        sigma = np.concatenate([np.full(3, SHIFT), np.full(3, TURN)])[:, None] * size
        yield "platform", coordinates, Basis(sigma.ravel(), twist=twist.reshape(len(at), 6, -1))


def _of_frame(at: Situation) -> Iterator[tuple[str, str, Basis]]:
    freedoms, size6 = frame_twist(at)
    for coordinates, waves, size in _over_conditions(at):
        columns = np.concatenate([freedoms * wave[:, None, None] for wave in waves.T], axis=2)
        yield "frame", coordinates, Basis(np.concatenate([size6 * s for s in size]), twist=columns)
    waves, size = _field(at, 3)
    twist = np.zeros((len(at), 6, 3, waves.shape[1]))
    twist[:, :3] = np.eye(3)[None, :, :, None] * waves[:, None, None, :]
    yield "frame", "position", Basis(np.tile(SHIFT * size, 3), twist=twist.reshape(len(at), 6, -1))


def _field(at: Situation, orders: int) -> tuple[Floats, Floats]:
    """Smooth functions (N, m) of the TCP's position."""
    T = at.poses.T
    x = np.clip((T - at.kinematics.home.T[0]) / 0.8, -1.5, 1.5)
    columns, sizes = [], []
    for a in range(orders + 1):
        for b in range(orders + 1 - a):
            for c in range(orders + 1 - a - b):
                if a + b + c:
                    angle = np.cos(np.pi / 2.0 * a * (x[:, 0] + 1.0)) * np.cos(np.pi / 2.0 * b * (x[:, 1] + 1.0))
                    columns.append(angle * np.cos(np.pi / 2.0 * c * (x[:, 2] + 1.0)))
                    sizes.append(1.0 / (a + b + c))
    return np.stack(columns, axis=1), np.array(sizes) / np.linalg.norm(sizes) * 2.0
