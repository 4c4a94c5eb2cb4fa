"""Deviations of a machine and of its measurement, caused by effects. They are small, and are added."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from gtpin.typing import Floats


class Additive:
    """A dataclass of arrays that are added and scaled one by one."""

    def __add__(self, other: Self) -> Self:
        return type(self)(**{name: value + getattr(other, name) for name, value in vars(self).items()})

    def __mul__(self, factor: float) -> Self:
        return type(self)(**{name: value * factor for name, value in vars(self).items()})


@dataclass(frozen=True)
class Deviation(Additive):
    """Changes at N visits of a machine with n carts and k rods.

    Parameters
    ----------
    travel
        (N, n) motions of the carts along their tracks, m, of arms about their axes, rad, or changes of the legs' lengths, m.
    shift
        (N, n, 3) shifts of the carts, base frame, m.
    turn
        (N, n, 3) rotation vectors of the carts about the mean of their joints, base frame, rad.
    length
        (N, k) changes of the rods' lengths, m.
    joint
        (N, k, 3) shifts of the joints on the platform, TCP frame, m.
    target
        (N, 3) shift of the target from the TCP, TCP frame, m.
    frame
        (N, 6) motion of everything that the instrument measures, about its station: translation, m, and rotation vector, rad,
        base frame.
    scale
        (N,) relative change of the distances that the instrument reads from its station.
    """

    travel: Floats
    shift: Floats
    turn: Floats
    length: Floats
    joint: Floats
    target: Floats
    frame: Floats
    scale: Floats

    @staticmethod
    def none(visits: int, carts: int, rods: int) -> Deviation:
        """Zeros."""
        return Deviation(
            travel=np.zeros((visits, carts)),
            shift=np.zeros((visits, carts, 3)),
            turn=np.zeros((visits, carts, 3)),
            length=np.zeros((visits, rods)),
            joint=np.zeros((visits, rods, 3)),
            target=np.zeros((visits, 3)),
            frame=np.zeros((visits, 6)),
            scale=np.zeros(visits),
        )
