"""Other readings of measured poses, each with a usual mistake corrected: units, axes, signs, orders, conventions."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations, permutations, product
from typing import Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.kinematics.rotations import from_quaternions
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
ONE: Final = np.eye(3)
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


@dataclass(frozen=True)
class Rotations(Reading):
    """A way to read rotations: ``R`` (N, 3, 3). ``of_target``: whether only the target's axes on the platform are others."""

    R: Floats
    of_target: bool = False


@cache
def signed_permutations() -> tuple[Floats, ...]:
    """All 48 matrices that swap and reverse axes: first the identity, then its negative, then the reversals of one axis."""
    found = [
        np.eye(3)[list(p)] * np.array(s)[:, None]
        for p in permutations(range(3))
        for s in product((1.0, -1.0), repeat=3)
    ]
    return tuple(sorted(found, key=lambda m: int((m != ONE).sum()) - 3 * int((m == -ONE).all())))


def position_readings(*, turned: bool, alone: bool = False) -> Iterator[Positions]:
    """Ways to read x y z.

    ``turned``: a rotation of the frame is fitted as well. Then, of ways that differ by a rotation, only one is given.
    ``alone``: there are no orientations. Then, of a frame that turns, only the handedness shows.
    """
    for s in signed_permutations():
        looks, hint = _axes_words(s)
        if turned and alone:
            if (s != np.diag(np.diag(s))).any() or s[1, 1] < 0.0 or s[2, 2] < 0.0:
                continue
            if s[0, 0] < 0.0:
                looks = ["the frame looks left-handed (an axis reversed, or two swapped)"]
                hint = ["change the sign of the axis, or swap the two"]
        # The usual mistakes that make a frame left-handed: one axis is reversed, or two are swapped.
        elif turned and s.trace() != 3.0 and (s.trace() != 1.0 or ((s < 0.0).any() and np.abs(s).trace() != 3.0)):
            continue
        for unit, factor in (("", 1.0), *UNITS):
            more, what = ([f"x y z look like {unit}"], [f"multiply x, y and z by {factor:g}"]) if unit else ([], [])
            words = [*looks, *more]
            yield Positions(" and ".join(words), ", ".join([*hint, *what]), len(words), factor * s, s)
    for some in (c for size in (1, 2) for c in combinations(range(3), size)):
        for unit, factor in UNITS[:4]:
            scale = np.eye(3)
            scale[some, some] = factor
            names = " and ".join(AXES[i] for i in some)
            looks_like = f"{names} look{'s' if len(some) == 1 else ''} like {unit} beside metres"
            yield Positions(looks_like, f"multiply {names} by {factor:g}", 1, scale, ONE)


def rotation_readings(rotation: Rotation, axes: Floats = ONE, *, turned: bool) -> Iterator[Rotations]:
    """Ways to read N quaternions, the first as they are, the usual mistakes next, without those of :func:`misread`.

    ``axes``: (3, 3) how the axes of the positions are read. ``turned``: a rotation of the frame is fitted as well. Then ways
    that only rotate the frame are left out.
    """
    as_is, wxyz = rotation.as_matrix(), rotation.as_quat(scalar_first=True)
    yield Rotations("", "", 0, as_is)
    looks, hint = "the orientations look inverted (conjugated)", "change the signs of qx, qy and qz"
    yield Rotations(looks, hint, 1, rotation.inv().as_matrix())
    # (With the scalar first, other orders of the vector part are other axes.)
    for parts in ("xyzw", *("".join(parts) for parts in permutations("wxyz") if parts[0] != "w")):
        read = wxyz[:, [parts.index(part) for part in "wxyz"]]
        hint = "give qw qx qy qz in that order of meaning, scalar first"
        yield Rotations(order_looks(parts), hint, 1, from_quaternions(read))
    handed = np.linalg.det(axes) * axes
    for vector in signed_permutations()[2:]:
        with_axes = bool((vector == handed).all()) and not (axes == ONE).all()
        looks = f"qx qy qz look {'to be so too' if with_axes else 'to be along other axes'}"
        hint = f"write {_assigned(vector, VECTOR)}"
        read = np.hstack([wxyz[:, :1], wxyz[:, 1:] @ vector.T])
        yield Rotations(looks, hint, 0 if with_axes else 1, from_quaternions(read))
    for s in signed_permutations()[1:]:
        if np.linalg.det(s) < 0.0:
            continue
        if not turned:
            same = bool((s == axes).all())
            looks, hint = "the orientations look turned with the axes", "turn the orientations as the positions"
            if not same:
                looks = "the orientations look to be in a frame of other axes than the base's"
                hint = f"turn them by {_turn(s)}, on the left"
            yield Rotations(looks, hint, 0 if same else 1, s @ as_is)
        looks = "the target's axes look to be others than the TCP's"
        yield Rotations(looks, f"turn the orientations by {_turn(s)}, on the right", 1, as_is @ s, of_target=True)


def order_looks(parts: str) -> str:
    """What quaternions look like whose four columns have the content ``parts``, such as ``xyzw``, and not ``wxyz``."""
    part = next(part for part, there in zip("wxyz", parts, strict=True) if part != there)
    return (
        f"the measured orientation looks like {parts} quaternions, as if {part} were under q{'wxyz'[parts.index(part)]}"
    )


def misread(rotation: Rotation) -> Iterator[Rotations]:
    """All mistakes between two conventions: three numbers of the one were converted by the other."""
    pairs: list[tuple[Convention, Convention, bool]] = [(*pair, True) for pair in permutations(BY_AXIS, 2)]
    for one, two in permutations(BY_ORDER, 2):
        if one.lower() != two.lower() or len(set(one)) < 3:  # else each number keeps its axis
            pairs.append((one, two, False))
    for meant, taken, by_axis in pairs:
        numbers, read = _described(meant, by_axis), _described(taken, by_axis)
        looks = f"the orientations look like {numbers} that were read as {read}"
        R = reread(rotation, taken, meant, by_axis=by_axis).as_matrix()
        yield Rotations(looks, f"compute qw qx qy qz again, from {numbers}", 1, R)


def reread(rotation: Rotation, taken: Convention, meant: Convention, *, by_axis: bool) -> Rotation:
    """The rotations that the numbers of N rotations by the convention ``taken`` describe by the convention ``meant``.

    ``by_axis``: True: each number is the angle about its own axis. False: the numbers are used in their order.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of gimbal lock: any of the answers will do
        numbers = rotation.as_rotvec() if taken == ROTATION_VECTOR else rotation.as_euler(taken)
    if by_axis:
        own, wanted = ("xyz" if c == ROTATION_VECTOR else c for c in (taken, meant))
        numbers = numbers[:, [own.index(axis) for axis in wanted]]
    return Rotation.from_rotvec(numbers) if meant == ROTATION_VECTOR else Rotation.from_euler(meant, numbers)


def _described(convention: Convention, by_axis: bool) -> str:
    if convention == ROTATION_VECTOR:
        return "rotation vectors"
    if by_axis:
        return f"Euler angles {convention} about fixed axes ({convention[::-1].upper()} about moving axes)"
    return f"Euler angles {convention} about {'fixed' if convention.islower() else 'moving'} axes"


def _axes_words(s: Floats) -> tuple[list[str], list[str]]:
    if (s == ONE).all():
        return [], []
    if (np.abs(s) == ONE).all():
        names = [name for name, sign in zip(AXES, np.diag(s), strict=True) if sign < 0.0]
        listed = ", ".join(names)
        return [f"{listed} look{'s' if len(names) == 1 else ''} reversed"], [f"change the sign of {listed}"]
    if s.trace() == 1.0 and s.sum() == 3.0:
        a, b = (AXES[i] for i in range(3) if s[i, i] == 0.0)
        return [f"{a} and {b} look swapped"], [f"write {_assigned(s, AXES)}"]
    return ["x y z look to be along other axes"], [f"write {_assigned(s, AXES)}"]


def _assigned(s: Floats, names: tuple[str, ...]) -> str:
    """Which column, with which sign, belongs under each name."""
    columns = (f"{'-' if row.min() < 0.0 else ''}{names[int(np.argmax(np.abs(row)))]}" for row in s)
    return f"({', '.join(f'{name} = {column}' for name, column in zip(names, columns, strict=True))})"


def _turn(s: Floats) -> str:
    vector = Rotation.from_matrix(s).as_rotvec(degrees=True)
    return f"the rotation vector ({', '.join(f'{v:.0f}' for v in vector + 0.0)}) degrees"
