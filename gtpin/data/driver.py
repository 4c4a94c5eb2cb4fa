"""A recorded column that moves the machine: what ``[[driver]]`` in dataset.toml says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

Motion = Literal["x", "y", "z", "rx", "ry", "rz", "q"]
MOTIONS: tuple[str, ...] = get_args(Motion)


@dataclass(frozen=True)
class Driver:
    """A recorded column (a tilt sensor, a motor current, a thermistor) that may act at a site.

    Parameters
    ----------
    column
        The covariate's name.
    site
        A link, a joint, ``platform`` or ``frame``.
    motion
        What it moves: ``x y z`` (m) or ``rx ry rz`` (rad) in the site's frame, or the coordinate ``q`` of a joint.
    size
        Typical motion over the column's range, m or rad.

    Examples
    --------
    >>> from gtpin.data import Driver
    >>> Driver("tilt_x", "column", "rx", 1e-3).motion
    'rx'
    """

    column: str
    site: str
    motion: Motion
    size: float
