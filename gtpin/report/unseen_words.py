"""Unobservable directions of the geometry, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.calibration.observability import Remedy
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

SHOWN = 3
"""Largest number of parameters that a sentence names."""
WHAT = {
    "touches": "touches of a plane whose normal is along {axis}",
    "distances": "distances from one station, by a draw wire or a ball bar,",
    "tilts": "readings of a tilt sensor",
    "positions": "positions, by a camera or a tracker,",
    "poses": "positions and orientations, by a tracker,",
}
"""Measurements in words."""
SCALE = 0.9
"""Smallest absolute cosine between a direction and that in which all lengths grow in proportion, or a single parameter's
direction, for which the sentence names this growth or this parameter alone. Assumed."""


def unseen_words(
    geometry: Geometry, directions: Floats, variance_reduction: Floats, remedies: Sequence[Remedy | None]
) -> tuple[str, ...]:
    """One sentence for each unobservable direction, in their order.

    ``geometry``: the geometry. ``directions``: (p, m) unit vectors in parameter space, in units of the tolerances.
    ``variance_reduction``: (m,) along each. ``remedies``: the measurement that would determine each; None where
    none is known.
    """
    return tuple(
        f"{_sentence(geometry, directions[:, i], float(np.sqrt(1.0 - variance_reduction[i])))} {_remedy(remedy)}"
        for i, remedy in enumerate(remedies)
    )


def grouped(words: Sequence[str], remedies: Sequence[Remedy | None]) -> tuple[str, ...]:
    """The sentences of the directions that a usual measurement would show, and one sentence for all others; ``words``: as
    :func:`unseen_words` gives them."""
    useful = tuple(said for said, remedy in zip(words, remedies, strict=True) if remedy is not None)
    if (others := len(words) - len(useful)) < 2:
        return tuple(words)
    return (
        *useful,
        f"{others} other directions hardly move the platform at these poses: no usual measurement would show them.",
    )


def _remedy(remedy: Remedy | None) -> str:
    if remedy is None:
        return "No usual measurement at these poses would show it: it hardly moves the platform there."
    what = WHAT[remedy.what].format(axis=remedy.axis)
    return f"{remedy.count} {what} would show it."


def _sentence(geometry: Geometry, direction: Floats, sigma: float) -> str:
    """A direction in words; ``sigma`` is its standard deviation in units of the tolerances."""
    order = np.argsort(-np.abs(direction))
    direction = direction * np.sign(direction[order[0]])
    sizes = direction * geometry.tolerance * sigma
    named = [f"{geometry.names[i]} by {_amount(sizes[i], geometry.parameters[i].unit)}" for i in order[:SHOWN]]
    listed = ", ".join(named)
    if _is_growth(geometry, direction):
        return f"The scale of the machine can't be told: all its lengths may grow together ({listed}, ...), 1 sigma."
    if abs(direction[order[0]]) > SCALE:
        return f"{named[0].replace(' by ', ' may be off by ')}, 1 sigma: these readings hardly show it."
    return (
        f"These can't be told apart: they may change together, {listed}, ..., 1 sigma; these readings hardly show it."
    )


def _amount(value: float, unit: str) -> str:
    if unit == "m":
        return f"{1e3 * value:+.2g} mm"
    return f"{1e3 * value:+.2g} mrad" if unit == "rad" else f"{1e6 * value:+.2g} parts in a million"


def _is_growth(geometry: Geometry, direction: Floats) -> bool:
    """Whether in a direction all lengths grow in proportion to their nominal values."""
    growth = np.array([p.nominal if p.unit == "m" else 0.0 for p in geometry.parameters]) / geometry.tolerance
    norm = float(np.linalg.norm(growth))
    return norm > 0.0 and abs(float(direction @ growth)) / norm > SCALE
