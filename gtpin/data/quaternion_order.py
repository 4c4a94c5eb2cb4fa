"""The order of the numbers of measured quaternions, found by comparison with the nominal orientations of the robot."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from gtpin.typing import Floats

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_AS_NAMED = "wxyz"
_OFF = 0.05
"""Median angle, rad, up to which quaternions are used as they are. Assumed."""
_FAR_BETTER = 4.0
"""Factor by which the median angle of another order must be smaller than that of ``wxyz``. Assumed."""
_AGREES = np.deg2rad(20.0)
"""Median angle, rad, within which an order of the columns agrees with the robot. Assumed."""
_ALIKE = 0.01
"""Orders whose median angles, rad, differ by less can't be distinguished. Assumed."""


def misplaced_order(quaternion: Floats, predicted: Floats, free: tuple[Floats, Floats] | None) -> str | None:
    """The actual content of the columns qw, qx, qy and qz, such as ``xyzw``; None where it is ``wxyz``, or no order fits.

    ``quaternion``: (N, 4) unit quaternions as measured. ``predicted``: (N, 3, 3) rotations of the nominal model, base
    frame. ``free``: for a free frame: (N, 3) measured and predicted positions, m, from which the frame's rotation is found;
    else None.
    """
    from scipy.spatial.transform import Rotation

    expected = Rotation.from_matrix(predicted)
    if free is not None:
        turned = _turn(*free)
        if turned is None:
            return None
        expected = turned * expected
    wanted = expected.as_quat(scalar_first=True)
    return order_that_fits(lambda order: _off(quaternion, wanted, order))


def order_that_fits(off: Callable[[str], float]) -> str | None:
    """The order of w, x, y and z that fits far better than ``wxyz``; None where ``wxyz`` fits, or where no order does so.

    ``off``: function that gives, for an order of the columns, how far measured poses are from expected ones: the median
    angle between orientations, rad, to which a median distance may be added, converted to an angle.
    """
    as_named = off(_AS_NAMED)
    if as_named <= _OFF:
        return None
    orders = ["xyzw", *("".join(order) for order in permutations(_AS_NAMED))]  # the usual one is first, and wins a tie
    found = np.array([off(order) for order in orders])
    if found.min() > min(_AGREES, as_named / _FAR_BETTER):
        return None
    return orders[int(np.argmax(found <= found.min() + _ALIKE))]


def in_order(quaternion: Floats, order: str) -> Floats:
    """(N, 4) quaternions wxyz, from columns that have the content ``order``, such as ``xyzw``."""
    return quaternion[:, [order.index(part) for part in _AS_NAMED]]


def first_misplaced(order: str) -> str:
    """Text for a message: the first of w, x, y, z that is not in its own column, and its column."""
    part = next(part for part, there in zip(_AS_NAMED, order, strict=True) if part != there)
    return f"{part} were under q{_AS_NAMED[order.index(part)]}"


def _off(quaternion: Floats, wanted: Floats, order: str) -> float:
    """Median angle, rad, between wanted quaternions wxyz and measured ones whose columns have the content ``order``."""
    read = in_order(quaternion, order)
    # Medians, so that gross errors in a few rows decide nothing.
    return float(np.median(2.0 * np.arccos(np.minimum(np.abs((read * wanted).sum(axis=1)), 1.0))))


def _turn(measured: Floats, predicted: Floats) -> Rotation | None:
    """Rotation that takes predicted positions to measured ones; None where they do not determine it, as on one line."""
    from scipy.spatial.transform import Rotation

    a, b = predicted - np.median(predicted, axis=0), measured - np.median(measured, axis=0)
    near = np.linalg.norm(b, axis=1) <= 10.0 * np.median(np.linalg.norm(b, axis=1))  # without gross errors
    if near.sum() < 3 or np.linalg.svd(a[near], compute_uv=False)[1] < 0.01:
        return None
    return Rotation.align_vectors(b[near], a[near])[0]
