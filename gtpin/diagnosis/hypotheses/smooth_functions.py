"""The functions of smooth nonparametric terms: of commands, loads, direction and speed, measurement conditions, position."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtpin.diagnosis.priors import Priors
from gtpin.effects.basis import rods_of
from gtpin.effects.drives import drive_load, smooth_cosines, smooth_orders
from gtpin.effects.joint_compliance import loaded
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import cosines, session_columns
from gtpin.typing import Floats

Functions = Iterator[tuple[tuple[str, ...], Floats, Floats]]
"""Coordinates, functions (N, m) of them, and the functions' sizes (m,)."""

CONDITIONS = ("time", "temp_frame", "temp_link", "payload")


def along_coordinates(at: Situation, j: int) -> Functions:
    """Functions of the coordinates on which the motion of cart j along its track may depend."""
    yield (f"q{j + 1}",), *smooth_cosines(at, j, 12, 1.0)
    for k in range(at.robot.n_actuators):
        if k != j:
            yield (f"q{j + 1}", f"q{k + 1}"), *plane(at.travel[:, j], at.travel[:, k], 5)
    yield from conditions(at)
    yield from _load(at, j, 4)
    yield from _moves(at, j, 3)


def aside_coordinates(at: Situation, j: int, priors: Priors) -> Functions:
    """Functions of the coordinates on which the motion of cart j across its track, and its rotation, may depend."""
    yield (f"q{j + 1}",), *cosines(at.travel[:, j], 1, smooth_orders(at, j, 8), 1.0)
    for over, waves, size in conditions(at):
        if over == ("session",):
            yield over, waves, size
        else:
            yield over, *_changing(waves[:, :4], size[:4], at.travel[:, j], priors)
    yield from _load(at, j, 3)
    yield from _moves(at, j, 2)


def _load(at: Situation, j: int, orders: int) -> Functions:
    site = at.robot.sites[j]
    if rods_of(at, site) or (not at.robot.rods and loaded(at, site)):
        yield ("load",), *cosines(np.clip(drive_load(at, site) / 2.0, -1.5, 1.5), 1, orders, 1.0)


def _moves(at: Situation, j: int, orders: int) -> Functions:
    """Functions of an actuator's direction of approach and of its speed, also multiplied by cosines along its track."""
    bends = [np.ones(len(at)), *(np.cos(np.pi / 2.0 * o * (at.travel[:, j] + 1.0)) for o in range(1, orders + 1))]
    for word in ("approach", "speed"):
        if at.varies(f"{word}{j + 1}"):
            x = _scaled(at.covariate(f"{word}{j + 1}"))
            shapes = [x] if word == "approach" else [x, np.abs(x), x * np.abs(x)]
            columns = [shape * bend for shape in shapes for bend in bends]
            yield (f"{word}{j + 1}",), np.stack(columns, axis=1), np.full(len(columns), 0.5)


def _scaled(values: Floats) -> Floats:
    return np.asarray(values / max(float(np.abs(values).max()), 1e-12))


def conditions(at: Situation) -> Functions:
    """Functions of time, temperatures, payload and sessions, for those that vary."""
    for name in CONDITIONS:
        if at.varies(name):
            values = at.covariate(name)
            middle, half = (values.max() + values.min()) / 2.0, np.ptp(values) / 2.0
            yield (name,), *cosines((values - middle) / half, 1, 7 if name == "time" else 3, 1.0)
    if at.varies("session"):
        sessions = session_columns(at)
        yield ("session",), sessions, np.ones(sessions.shape[1])


def _changing(waves: Floats, size: Floats, x: Floats, priors: Priors) -> tuple[Floats, Floats]:
    """The functions, and the functions multiplied by a coordinate x (N,)."""
    return np.hstack([waves, waves * x[:, None]]), np.concatenate([size, priors.smooth_change * size])


def plane(a: Floats, b: Floats, orders: int) -> tuple[Floats, Floats]:
    """Functions of two coordinates (N,) together, and of the second alone, and their sizes."""
    columns, sizes = [], []
    for m in range(orders):
        for n in range(1, orders + 1 - m):
            columns.append(np.cos(np.pi / 2.0 * m * (a + 1.0)) * np.cos(np.pi / 2.0 * n * (b + 1.0)))
            sizes.append(1.0 / (m + n))
    return np.stack(columns, axis=1), np.array(sizes) / np.linalg.norm(sizes) * 2.0


def all_moves(at: Situation) -> Floats | None:
    """(N, m) direction of approach and speed of every actuator, each over its largest absolute value, for those that vary.

    None where none varies.
    """
    names = [f"{word}{k + 1}" for word in ("approach", "speed") for k in range(at.robot.n_actuators)]
    columns = [_scaled(at.covariate(name)) for name in names if at.varies(name)]
    return np.stack(columns, axis=1) if columns else None


def field(at: Situation, orders: int, priors: Priors) -> tuple[Floats, Floats]:
    """Smooth functions (N, m) of the TCP's position, and their sizes (m,)."""
    T = at.poses.T
    reach = priors.smooth_reach * max(float(np.ptp(T, axis=0).max()) / 2.0, 1e-9)
    middle = at.kinematics.home.T[0] if at.robot.rods else (T.max(axis=0) + T.min(axis=0)) / 2.0
    x = np.clip((T - middle) / reach, -1.5, 1.5)
    columns, sizes = [], []
    for a in range(orders + 1):
        for b in range(orders + 1 - a):
            for c in range(orders + 1 - a - b):
                if a + b + c:
                    angle = np.cos(np.pi / 2.0 * a * (x[:, 0] + 1.0)) * np.cos(np.pi / 2.0 * b * (x[:, 1] + 1.0))
                    columns.append(angle * np.cos(np.pi / 2.0 * c * (x[:, 2] + 1.0)))
                    sizes.append(1.0 / (a + b + c))
    return np.stack(columns, axis=1), np.array(sizes) / np.linalg.norm(sizes) * 2.0
