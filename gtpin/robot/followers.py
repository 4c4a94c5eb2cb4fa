"""Joints that follow others by ``<mimic>``: their coordinates and derivatives.

Pinocchio has mimic joints of its own (``buildModelFromXML(..., mimic=True)``), which share their master's coordinate, but
``computeJointKinematicRegressor`` refuses models that have them. So gtpin's models have a coordinate for each joint, and this
module ties those of followers to their masters'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gtpin.robot.tree import Mimic
from gtpin.typing import Floats


@dataclass(frozen=True)
class Follower:
    """A joint whose coordinate is ``multiplier * master + offset``, m or rad.

    ``index_q``, ``index_v``: its first index in a Pinocchio configuration and in a velocity. ``master_v``: the master's index
    in a velocity. ``continuous``: whether Pinocchio keeps its coordinate as cosine and sine.
    """

    index_q: int
    index_v: int
    master_v: int
    multiplier: float
    offset: float
    continuous: bool

    def put(self, configuration: Floats, master: float) -> None:
        """Write its coordinate, from that of its master, into a Pinocchio configuration (nq,)."""
        put(configuration, self.index_q, self.multiplier * master + self.offset, self.continuous)


def followers(model: Any, mimics: Sequence[Mimic]) -> tuple[Follower, ...]:
    """The followers among the joints of a Pinocchio model."""
    found = []
    for mimic in mimics:
        if model.existJointName(mimic.joint):
            joint, master = model.getJointId(mimic.joint), model.getJointId(mimic.master)
            found.append(
                Follower(
                    int(model.idx_qs[joint]),
                    int(model.idx_vs[joint]),
                    int(model.idx_vs[master]),
                    mimic.multiplier,
                    mimic.offset,
                    model.nqs[joint] == 2,
                )
            )
    return tuple(found)


def put(configuration: Floats, index: int, value: float, continuous: bool) -> None:
    """Write a joint's coordinate into a Pinocchio configuration (nq,); of a continuous joint it has the cosine and sine."""
    if continuous:
        configuration[index : index + 2] = np.cos(value), np.sin(value)
    else:
        configuration[index] = value


def folded(derivative: Floats, followers: Sequence[Follower]) -> Floats:
    """A derivative (..., nv) by Pinocchio velocities: each follower's column times its multiplier is added to its master's."""
    if not followers:
        return derivative
    total = derivative.copy()
    for follower in followers:
        total[..., follower.master_v] += follower.multiplier * derivative[..., follower.index_v]
    return total
