"""Deviations of a machine and of its measurement, caused by effects. They are small, and are added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.typing import Floats


@dataclass(frozen=True)
class Deviation:
    """Changes at N visits of a machine with n drives, and k rods or J joints. Arrays for what it does not have are empty."""

    # (N, n) motions of carts along their tracks, m, of arms and joints about their axes, rad, or changes of legs'
    # lengths, m
    travel: Floats
    # `shift`, `turn`: (N, n, 3) on rods: shifts of the carts, m, and their rotation vectors about the mean of their
    # joints, rad, base frame
    shift: Floats
    turn: Floats
    length: Floats  # (N, k) changes of the rods' lengths, m
    joint: Floats  # (N, k, 3) shifts of the joints on the platform, TCP frame, m
    # (N, n, 6) change of the commanded joints' axes: shift, m, and rotation vector, rad, in the joint's frame
    axis: Floats
    # (N, n, 6) change of the ends of the links that these joints move: shift, m, and rotation vector, rad, link's
    # frame
    tip: Floats
    seat: Floats  # (N, J, 6) as ``axis``, of all joints, including passive ones
    target: Floats  # (N, 3) shift of the target from its place on the tool, TCP frame (without rods: target's frame), m
    # (N, 6) motion of everything that the instrument measures, about its station: translation, m, and rotation vector,
    # rad, base frame
    frame: Floats
    scale: Floats  # (N,) relative change of the distances that the instrument reads from its station

    @staticmethod
    def none(visits: int, drives: int, rods: int = 0, joints: int = 0) -> Deviation:
        """Zeros."""
        carts, links = (drives, 0) if rods else (0, drives)
        return Deviation(
            travel=np.zeros((visits, drives)),
            shift=np.zeros((visits, carts, 3)),
            turn=np.zeros((visits, carts, 3)),
            length=np.zeros((visits, rods)),
            joint=np.zeros((visits, rods, 3)),
            axis=np.zeros((visits, links, 6)),
            tip=np.zeros((visits, links, 6)),
            seat=np.zeros((visits, joints, 6)),
            target=np.zeros((visits, 3)),
            frame=np.zeros((visits, 6)),
            scale=np.zeros(visits),
        )

    def __add__(self, other: Deviation) -> Deviation:
        return Deviation(**{name: value + getattr(other, name) for name, value in vars(self).items()})

    def __mul__(self, factor: float) -> Deviation:
        return Deviation(**{name: value * factor for name, value in vars(self).items()})
