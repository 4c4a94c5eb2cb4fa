"""Rotations that were written in one convention and read in another: Euler angles, rotation vectors."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations
from typing import Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.typing import Floats

Sequence = Literal["xyz", "zyx", "yxz", "xzy", "yzx", "zxy", "XYZ", "ZYX", "zyz", "ZYZ", "zxz", "ZXZ"]
Convention = Sequence | Literal["rotation vector"]

VECTOR: Final = "rotation vector"
BY_AXIS: tuple[Convention, ...] = (VECTOR, "xyz", "zyx", "yxz", "xzy", "yzx", "zxy")
"""Conventions in which the three numbers belong to x, y and z. An Euler sequence is the order of the rotations about fixed
axes; about moving axes the reverse order gives the same rotation."""
BY_ORDER: tuple[Sequence, ...] = ("xyz", "zyx", "XYZ", "ZYX", "zyz", "ZYZ", "zxz", "ZXZ")
"""Conventions in which three angles stand in the order of the rotations: lower case about fixed axes, upper case about moving
ones (SciPy's names)."""


@dataclass(frozen=True)
class Misread:
    """A mistake: three numbers of one convention of rotations that were converted by another one.

    Parameters
    ----------
    meant, taken
        The convention of the numbers, and the one by which they were converted.
    by_axis
        True: each number was used as the angle about its own axis. False: the numbers were used in their order.
    """

    meant: Convention
    taken: Convention
    by_axis: bool

    @property
    def mistakes(self) -> int:
        """Number of mistakes that it assumes."""
        return 1

    @property
    def looks(self) -> str:
        """What the orientations look like."""
        return (
            f"the orientations look like {self._described(self.meant)} that were read as {self._described(self.taken)}"
        )

    @property
    def hint(self) -> str:
        """What to do about it."""
        return f"compute qw qx qy qz again, from {self._described(self.meant)}"

    def read(self, rotation: Rotation) -> Floats:
        """(N, 3, 3) rotations by the convention ``meant``, from those that were converted by ``taken``."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of gimbal lock: any of the answers will do
            numbers = rotation.as_rotvec() if self.taken == VECTOR else rotation.as_euler(self.taken)
        if self.by_axis and self.taken != VECTOR:
            numbers = numbers[:, [self.taken.index(axis) for axis in "xyz"]]
        if self.meant == VECTOR:
            return np.asarray(Rotation.from_rotvec(numbers.copy()).as_matrix())
        if self.by_axis:
            numbers = numbers[:, ["xyz".index(axis) for axis in self.meant]]
        return _from_euler(self.meant, numbers)

    def _described(self, convention: Convention) -> str:
        if convention == VECTOR:
            return "rotation vectors"
        if self.by_axis:
            return f"Euler angles {convention} about fixed axes ({convention[::-1].upper()} about moving axes)"
        return f"Euler angles {convention} about {'fixed' if convention.islower() else 'moving'} axes"


def _from_euler(sequence: Sequence, angles: Floats) -> Floats:
    """(N, 3, 3) rotations by angles (N, 3) in their order; a third of the time of SciPy's, and all mistakes are tried often."""
    one, two, three = (_about("xyz".index(axis), angles[:, i]) for i, axis in enumerate(sequence.lower()))
    return np.asarray(three @ two @ one if sequence.islower() else one @ two @ three)


def _about(axis: int, angle: Floats) -> Floats:
    """(N, 3, 3) rotations about a base axis."""
    found = np.zeros((len(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    found[:, axis, axis] = 1.0
    found[:, i, i] = found[:, j, j] = np.cos(angle)
    found[:, j, i] = np.sin(angle)
    found[:, i, j] = -found[:, j, i]
    return found


def misread() -> Iterator[Misread]:
    """All mistakes between two different conventions."""
    for meant, taken in permutations(BY_AXIS, 2):
        yield Misread(meant, taken, True)
    for meant, taken in permutations(BY_ORDER, 2):
        if meant.lower() == taken.lower() and len(set(meant)) == 3:
            continue  # each number keeps its axis: one of the mistakes by axis
        yield Misread(meant, taken, False)
