"""Usual mistakes in columns: other units, axes, signs and orders, other conventions of rotations."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, permutations, product
from typing import Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.typing import Floats

UNITS = (
    ("millimetres", 1e-3),
    ("centimetres", 1e-2),
    ("inches", 0.0254),
    ("feet", 0.3048),
    ("micrometres", 1e-6),
    ("yards", 0.9144),
)
"""Units, other than metres, in which lengths are written, and the length of each in metres."""
AXES, VECTOR = ("x", "y", "z"), ("qx", "qy", "qz")
Sequence = Literal["xyz", "zyx", "yxz", "xzy", "yzx", "zxy", "XYZ", "ZYX", "zyz", "ZYZ", "zxz", "ZXZ"]
Convention = Sequence | Literal["rotation vector"]
ROTATION_VECTOR: Final = "rotation vector"
BY_AXIS: tuple[Convention, ...] = (ROTATION_VECTOR, "xyz", "zyx", "yxz", "xzy", "yzx", "zxy")
"""Conventions in which the three numbers belong to x, y and z. An Euler sequence is the order of the rotations about fixed
axes; about moving axes the reverse order gives the same rotation."""
BY_ORDER: tuple[Sequence, ...] = ("xyz", "zyx", "XYZ", "ZYX", "zyz", "ZYZ", "zxz", "ZXZ")
"""Conventions in which three angles stand in the order of the rotations: lower case about fixed axes, upper case about moving
ones (SciPy's names)."""


@dataclass(frozen=True)
class Reading:
    """A way to read columns: as they are, or with a mistake corrected.

    ``looks``, ``hint``: texts for a message: what the columns look like, and what the user should do; empty where nothing is
    changed. ``mistakes``: number of mistakes that it assumes.
    """

    looks: str
    hint: str
    mistakes: int


@dataclass(frozen=True)
class Positions(Reading):
    """A way to read x y z: the position is ``matrix @ (x, y, z)``, m; ``axes``: (3, 3) the signed permutation in ``matrix``."""

    matrix: Floats
    axes: Floats

    @property
    def mirrored(self) -> bool:
        """Whether it turns a left-handed frame into a right-handed one."""
        return bool(np.linalg.det(self.axes) < 0.0)

    def words(self, turned: bool) -> tuple[str, str]:
        """``looks`` and ``hint`` where only positions are judged.

        ``turned``: a rotation of the frame is fitted. Then positions do not show which axis is reversed, only that one is.
        """
        if not (turned and self.mirrored):
            return self.looks, self.hint
        looks = self.looks.replace("x looks reversed", "the frame looks left-handed (an axis reversed, or two swapped)")
        return looks, self.hint.replace("change the sign of x", "change the sign of the axis, or swap the two")


@dataclass(frozen=True)
class Orientations(Reading):
    """A way to read a rotation: ``left @ R' @ right``, where R' has the vector part of its quaternion mapped by ``vector``.

    All matrices are signed permutations.
    """

    vector: Floats
    left: Floats
    right: Floats

    @property
    def of_target(self) -> bool:
        """Whether only the target's axes on the platform are others."""
        return bool((self.right != np.eye(3)).any())

    def read(self, rotation: Rotation) -> Floats:
        """(N, 3, 3) rotations without the mistake, from those that were read."""
        wxyz = rotation.as_quat(scalar_first=True)
        wxyz[:, 1:] = wxyz[:, 1:] @ self.vector.T
        return np.asarray(self.left @ Rotation.from_quat(wxyz, scalar_first=True).as_matrix() @ self.right)


def signed_permutations() -> list[Floats]:
    """All 48 matrices that swap and reverse axes: first the identity, then its negative, then the reversals of one axis."""
    found = [
        np.eye(3)[list(p)] * np.array(s)[:, None]
        for p in permutations(range(3))
        for s in product((1.0, -1.0), repeat=3)
    ]
    one = np.eye(3)
    return sorted(found, key=lambda m: int((m != one).sum()) - 3 * int((m == -one).all()))


def position_readings(*, turned: bool) -> Iterator[Positions]:
    """Ways to read x y z.

    ``turned``: a rotation of the frame is fitted as well. Then, of ways that differ by a rotation, only one is given.
    """
    axes = [s for s in signed_permutations() if not turned or _plain(s)]
    for s in axes:
        for unit, factor in (("", 1.0), *UNITS):
            looks, hint = _axes_words(s)
            if unit:
                looks = [*looks, f"x y z look like {unit}"]
                hint = [*hint, f"multiply x, y and z by {factor:g}"]
            yield Positions(" and ".join(looks), ", ".join(hint), len(looks), factor * s, s)
    for some in (c for size in (1, 2) for c in combinations(range(3), size)):
        for unit, factor in UNITS[:4]:
            scale = np.eye(3)
            scale[some, some] = factor
            names = " and ".join(AXES[i] for i in some)
            looks_like = f"{names} look{'s' if len(some) == 1 else ''} like {unit} beside metres"
            yield Positions(looks_like, f"multiply {names} by {factor:g}", 1, scale, np.eye(3))


def orientation_readings(positions: Positions, *, turned: bool) -> Iterator[Orientations]:
    """Ways to read quaternions, given how positions are read.

    ``turned``: a rotation of the frame is fitted as well. Then ways that only rotate the frame are left out.
    """
    one = np.eye(3)
    handed = np.linalg.det(positions.axes) * positions.axes
    for vector in signed_permutations():
        if (vector == one).all():
            yield Orientations("", "", 0, vector, one, one)
            continue
        with_axes = bool((vector == handed).all()) and not (positions.axes == one).all()
        if (vector == -one).all():
            looks, hint = "the orientations look inverted (conjugated)", "change the signs of qx, qy and qz"
        else:
            looks = f"qx qy qz look {'to be so too' if with_axes else 'to be along other axes'}"
            hint = f"write {_assigned(vector, VECTOR)}"
        yield Orientations(looks, hint, 0 if with_axes else 1, vector, one, one)
    for s in signed_permutations():
        if np.linalg.det(s) < 0.0 or (s == one).all():
            continue
        if not turned:
            same = bool((s == positions.axes).all())
            looks, hint = "the orientations look turned with the axes", "turn the orientations as the positions"
            if not same:
                looks = "the orientations look to be in a frame of other axes than the base's"
                hint = f"turn them by {_turn(s)}, on the left"
            yield Orientations(looks, hint, 0 if same else 1, one, s, one)
        looks = "the target's axes look to be others than the TCP's"
        yield Orientations(looks, f"turn the orientations by {_turn(s)}, on the right", 1, one, one, s)


def _plain(s: Floats) -> bool:
    """Whether no axis is changed, one is reversed, or two are swapped: the usual mistakes that make a frame left-handed."""
    return bool(s.trace() == 3.0 or (s.trace() == 1.0 and ((np.abs(s) == s).all() or np.abs(s).trace() == 3.0)))


def _axes_words(s: Floats) -> tuple[list[str], list[str]]:
    if (s == np.eye(3)).all():
        return [], []
    if (np.abs(s) == np.eye(3)).all():
        names = [name for name, sign in zip(AXES, np.diag(s), strict=True) if sign < 0.0]
        listed = ", ".join(names)
        return [f"{listed} look{'s' if len(names) == 1 else ''} reversed"], [f"change the sign of {listed}"]
    fixed = [i for i in range(3) if s[i, i] == 1.0]
    if len(fixed) == 1 and s.sum() == 3.0:
        a, b = (AXES[i] for i in range(3) if i != fixed[0])
        return [f"{a} and {b} look swapped"], [f"write {_assigned(s, AXES)}"]
    return ["x y z look to be along other axes"], [f"write {_assigned(s, AXES)}"]


def _assigned(s: Floats, names: tuple[str, ...]) -> str:
    """Which column, with which sign, belongs under each name."""
    parts = []
    for i, name in enumerate(names):
        j = int(np.argmax(np.abs(s[i])))
        parts.append(f"{name} = {'-' if s[i, j] < 0.0 else ''}{names[j]}")
    return "(" + ", ".join(parts) + ")"


def _turn(s: Floats) -> str:
    vector = Rotation.from_matrix(s).as_rotvec(degrees=True)
    return f"the rotation vector ({', '.join(f'{v:.0f}' for v in vector + 0.0)}) degrees"


@dataclass(frozen=True)
class Misread(Reading):
    """A mistake: three numbers of one convention of rotations that were converted by another one.

    ``meant``, ``taken``: the convention of the numbers, and the one by which they were converted. ``by_axis``: True: each
    number was used as the angle about its own axis. False: the numbers were used in their order.
    """

    meant: Convention
    taken: Convention
    by_axis: bool

    def read(self, rotation: Rotation) -> Floats:
        """(N, 3, 3) rotations by the convention ``meant``, from those that were converted by ``taken``."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of gimbal lock: any of the answers will do
            numbers = rotation.as_rotvec() if self.taken == ROTATION_VECTOR else rotation.as_euler(self.taken)
        if self.by_axis and self.taken != ROTATION_VECTOR:
            numbers = numbers[:, [self.taken.index(axis) for axis in "xyz"]]
        if self.meant == ROTATION_VECTOR:
            return np.asarray(Rotation.from_rotvec(numbers.copy()).as_matrix())
        if self.by_axis:
            numbers = numbers[:, ["xyz".index(axis) for axis in self.meant]]
        return _from_euler(self.meant, numbers)


@dataclass(frozen=True)
class Order(Reading):
    """A mistake: the four columns of quaternions have the content ``order``, such as ``xyzw``, and not ``wxyz``."""

    order: str

    def read(self, rotation: Rotation) -> Floats:
        """(N, 3, 3) rotations without the mistake, from those that were read."""
        found = rotation.as_quat(scalar_first=True)[:, [self.order.index(part) for part in "wxyz"]]
        return np.asarray(Rotation.from_quat(found, scalar_first=True).as_matrix())


def orders() -> Iterator[Order]:
    """Orders of the columns of quaternions in which the scalar is not the first one; the usual one, ``xyzw``, first.

    (Other orders of the vector part are other axes.)
    """
    for parts in ("xyzw", *("".join(parts) for parts in permutations("wxyz") if parts[0] != "w")):
        part = next(part for part, there in zip("wxyz", parts, strict=True) if part != there)
        looks = f"the measured orientation looks like {parts} quaternions, as if {part} were under q{'wxyz'[parts.index(part)]}"
        yield Order(looks, "give qw qx qy qz in that order of meaning, scalar first", 1, parts)


RotationReading = Orientations | Misread | Order
"""A way to read measured rotations."""


def _described(convention: Convention, by_axis: bool) -> str:
    if convention == ROTATION_VECTOR:
        return "rotation vectors"
    if by_axis:
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
    pairs: list[tuple[Convention, Convention, bool]] = [(*pair, True) for pair in permutations(BY_AXIS, 2)]
    for one, two in permutations(BY_ORDER, 2):
        if one.lower() != two.lower() or len(set(one)) < 3:  # else each number keeps its axis
            pairs.append((one, two, False))
    for meant, taken, by_axis in pairs:
        numbers, read = _described(meant, by_axis), _described(taken, by_axis)
        looks = f"the orientations look like {numbers} that were read as {read}"
        yield Misread(looks, f"compute qw qx qy qz again, from {numbers}", 1, meant, taken, by_axis)
