"""Smooth terms that move all carts at once, as a deformation of the whole machine does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import SmoothTerm
from gtpin.diagnosis.priors import Priors
from gtpin.effects.basis import Basis, along_track
from gtpin.effects.drives import drive_sizes
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import wave
from gtpin.typing import Floats

ORDERS = {2: 5, 3: 4}
"""Largest sum of the orders in a product of cosines, by the number of actuators; with other numbers of actuators, 1."""
DECAY = 1.5
"""The typical size of a product of cosines is proportional to (sum of its orders)^-DECAY."""
COMMON = ("field", "scale")
"""``SmoothTerm.motion`` of these terms. They belong to no single site, so that they count in no site's share of the gap."""


def common_motions(at: Situation, priors: Priors, scaled: bool) -> Iterator[tuple[SmoothTerm, Basis]]:
    """Smooth terms that move all carts along their tracks: functions of all commands, and of each cart's own command.

    Parameters
    ----------
    at
        The poses.
    priors
        Sizes of the terms.
    scaled
        Whether a testable effect scales all measured positions; the term ``scale`` is then left out.
    """
    if at.robot.n_actuators < 2:
        return
    yield SmoothTerm("frame", ("position",), "field"), _of_all(at, priors, *_field(at))
    if not scaled:
        yield SmoothTerm("frame", ("position",), "scale"), _of_all(at, priors, np.zeros((len(at), 0)), np.zeros(0))


def _field(at: Situation) -> tuple[Floats, Floats]:
    """Smooth functions (N, m) of all commands, and their sizes."""
    n = at.robot.n_actuators
    most = ORDERS.get(n, 1)
    orders = [row for row in _orders(n, most) if any(row)]
    columns = [np.prod([wave(at.travel[:, k], o) for k, o in enumerate(row) if o], axis=0) for row in orders]
    size = np.array([float(sum(row)) for row in orders]) ** -DECAY
    return np.stack(columns, axis=1), 1.5 * size / np.linalg.norm(size)


def _orders(n: int, most: int) -> Iterator[tuple[int, ...]]:
    """The orders of n cosines with a sum of at most ``most``: few of the (most + 1)^n rows of orders up to ``most``."""
    if n == 0:
        yield ()
        return
    for first in range(most + 1):
        for others in _orders(n - 1, most - first):
            yield (first, *others)


def _of_all(at: Situation, priors: Priors, columns: Floats, size: Floats) -> Basis:
    """Motions of all carts along their tracks: functions (N, m), the same for every cart, its own command and its square.

    Each cart has its own coefficients. ``size`` (m,) is the size of each function.
    """
    total: list[Floats] = []
    sizes: list[Floats] = []
    for j, site in enumerate(at.robot.sites):
        own = at.travel[:, [j]]
        along = along_track(at, site, np.hstack([columns, own, own**2]), np.ones(columns.shape[1] + 2))
        total.append(along.displacement(at))
        sizes.append(drive_sizes(at, site, np.concatenate([size, [1.0, 0.2]]), priors.smooth_shift))
    return Basis(np.concatenate(sizes), twist=np.concatenate(total, axis=2))
