"""The inputs from which the same machine and case are made again."""

from __future__ import annotations

from dataclasses import dataclass

from gtpin.bench.simulator.conditions import Conditions
from gtpin.bench.simulator.tracker import Noise


@dataclass(frozen=True)
class Wanted:
    """An effect that the machine gets, with its energy or, where that is None, its amplitude in typical sizes.

    ``periods``: for a periodic error of an arm, the number of periods a turn of each line; drawn where empty.
    """

    effect: str
    site: str
    energy: float | None = None
    amplitude: float | None = None
    periods: tuple[float, ...] = ()


@dataclass(frozen=True)
class Recipe:
    """Everything that a case is made from. The same recipe gives the same bytes.

    Parameters
    ----------
    wanted, seed, robot, poses, held_out, noise, conditions, background
        See :func:`~gtpin.bench.simulator.case.make_case`.
    """

    wanted: tuple[Wanted, ...]
    seed: int
    robot: str
    poses: int
    held_out: int
    noise: Noise
    conditions: Conditions
    background: bool = True
