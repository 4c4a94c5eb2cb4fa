"""The inputs that make the same machine and case again."""

from __future__ import annotations

from dataclasses import dataclass

from gtpin.plant.conditions import Conditions
from gtpin.plant.tracker import Noise


@dataclass(frozen=True)
class Wanted:
    """An effect that a machine shall have: how strong by its energy, or else by its amplitude in typical sizes.

    ``periods`` are an arm's periodic error's lines, periods a turn each; drawn where there are none.
    """

    effect: str
    site: str
    energy: float | None = None
    amplitude: float | None = None
    periods: tuple[float, ...] = ()


@dataclass(frozen=True)
class Recipe:
    """All that a case is made from; same recipe, same bytes.

    Parameters
    ----------
    wanted, seed, robot, poses, held_out, noise, conditions, background
        See :func:`~gtpin.plant.case.make_case`.
    """

    wanted: tuple[Wanted, ...]
    seed: int
    robot: str
    poses: int
    held_out: int
    noise: Noise
    conditions: Conditions
    background: bool = True
