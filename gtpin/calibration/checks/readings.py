"""The table of other readings of data, each with a usual mistake corrected, and its words: of measured poses (units, axes,
signs, orders, conventions), of commands (signs, units, orders, couplings, zeros), and of instruments' tables."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, combinations, permutations, product
from typing import Any, Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.data.instrument_rows import InstrumentRows
from gtpin.data.instrument_tables import EncoderTable, PlaneOf, PlaneTable, RangeTable, TiltTable, TrackerTable
from gtpin.data.names import ORIENTATION, command_names
from gtpin.kinematics.rotations import from_quaternions
from gtpin.robot.parameters import TOLERANCE
from gtpin.typing import Floats, Mask

UNITS = (
    ("millimetres", 1e-3),
    ("centimetres", 1e-2),
    ("inches", 0.0254),
    ("feet", 0.3048),
    ("micrometres", 1e-6),
    ("yards", 0.9144),
)
"""Units, other than metres, in which lengths are written, and the length of each in metres."""
DEGREES = (("degrees", np.pi / 180.0),)
AXES = ("x", "y", "z")
ONE: Final = np.eye(3)
Euler = Literal["xyz", "zyx", "yxz", "xzy", "yzx", "zxy", "XYZ", "ZYX", "zyz", "ZYZ", "zxz", "ZXZ"]
Convention = Euler | Literal["rotation vector"]
ROTATION_VECTOR: Final = "rotation vector"
BY_AXIS: tuple[Convention, ...] = (ROTATION_VECTOR, "xyz", "zyx", "yxz", "xzy", "yzx", "zxy")
"""Conventions in which the three numbers belong to x, y and z. An Euler sequence is the order of the rotations about fixed
axes; about moving axes the reverse order gives the same rotation."""
BY_ORDER: tuple[Euler, ...] = ("xyz", "zyx", "XYZ", "ZYX", "zyz", "ZYZ", "zxz", "ZXZ")
"""Conventions in which three angles stand in the order of the rotations: lower case about fixed axes, upper case about moving
ones (SciPy's names)."""


@dataclass(frozen=True)
class Reading:
    """A way to read columns: as they are, or with a mistake corrected.

    ``looks``, ``hint``: texts for a message: what the columns look like, and what the user should do; empty where nothing is
    changed. ``mistakes``: number of mistakes that it assumes. ``columns``: those that have the mistake.
    """

    looks: str
    hint: str
    mistakes: int = 1
    columns: str = ""


def either(readings: Sequence[Reading]) -> tuple[str, str]:
    """What the columns look like and the hints, where each of some readings is possible; of many the first ones are named."""
    different = (list(dict.fromkeys(words)) for words in zip(*((r.looks, r.hint) for r in readings), strict=True))
    # Of a delta, four are usual: three swaps and a frame.
    looks, hint = ("; or ".join([*words[:4], *["something alike"] * (len(words) > 4)]) for words in different)
    return looks, hint


@cache
def signed_permutations() -> tuple[Floats, ...]:
    """All 48 matrices that swap and reverse axes: first the identity, then its negative, then the reversals of one axis."""
    ways = product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    found = [np.eye(3)[list(order)] * np.array(signs)[:, None] for order, signs in ways]
    return tuple(sorted(found, key=lambda m: int((m != ONE).sum()) - 3 * int((m == -ONE).all())))


def position_readings(*, turned: bool, alone: bool = False) -> Iterator[tuple[Reading, Floats]]:
    """Ways to read x y z, each with the matrix (3, 3) that gives the position, m; its signs are the axes' signed permutation.

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
            words = [*looks, *[f"x y z look like {unit}"][: len(unit)]]
            hints = [*hint, *[f"multiply x, y and z by {factor:g}"][: len(unit)]]
            yield Reading(" and ".join(words), ", ".join(hints), len(words), "x y z" if words else ""), factor * s
    for some in (c for size in (1, 2) for c in combinations(range(3), size)):
        for unit, factor in UNITS[:4]:
            scale = np.eye(3)
            scale[some, some] = factor
            names = " and ".join(AXES[i] for i in some)
            looks_like = f"{names} look{'s' if len(some) == 1 else ''} like {unit} beside metres"
            yield Reading(looks_like, f"multiply {names} by {factor:g}", columns="x y z"), scale


def rotation_readings(
    rotation: Rotation, axes: Floats = ONE, *, turned: bool, fixed_target: bool = True
) -> Iterator[tuple[Reading, Floats]]:
    """Ways to read N quaternions, with the rotations (N, 3, 3): as they are, then usual mistakes, but for :func:`misread`.

    ``axes``: (3, 3) how the axes of the positions are read. ``turned``: a rotation of the frame is fitted as well. Then ways
    that only rotate the frame are left out. ``fixed_target``: whether other axes of the target count as a mistake.
    """
    as_is, wxyz = rotation.as_matrix(), rotation.as_quat(scalar_first=True)
    yield Reading("", "", 0), as_is
    looks, hint = "the orientations look inverted (conjugated)", "change the signs of qx, qy and qz"
    yield Reading(looks, hint), rotation.inv().as_matrix()
    # (With the scalar first, other orders of the vector part are other axes.)
    for parts in ("xyzw", *("".join(parts) for parts in permutations("wxyz") if parts[0] != "w")):
        read = wxyz[:, [parts.index(part) for part in "wxyz"]]
        hint = "give qw qx qy qz in that order of meaning, scalar first"
        yield Reading(order_looks(parts), hint), from_quaternions(read)
    handed = np.linalg.det(axes) * axes
    for vector in signed_permutations()[2:]:
        with_axes = bool((vector == handed).all()) and not (axes == ONE).all()
        looks = f"qx qy qz look {'to be so too' if with_axes else 'to be along other axes'}"
        read = from_quaternions(np.hstack([wxyz[:, :1], wxyz[:, 1:] @ vector.T]))
        yield Reading(looks, f"write {_assigned(vector, ORIENTATION[1:])}", int(not with_axes)), read
    for s in signed_permutations()[1:]:
        if np.linalg.det(s) < 0.0:
            continue
        if not turned:
            same = bool((s == axes).all())
            looks, hint = "the orientations look turned with the axes", "turn the orientations as the positions"
            if not same:
                looks = "the orientations look to be in a frame of other axes than the base's"
                hint = f"turn them by {_turn(s)}, on the left"
            yield Reading(looks, hint, int(not same)), s @ as_is
        if fixed_target:
            looks = "the target's axes look to be others than the TCP's"
            yield Reading(looks, f"turn the orientations by {_turn(s)}, on the right"), as_is @ s


def order_looks(parts: str) -> str:
    """What quaternions look like whose four columns have the content ``parts``, such as ``xyzw``, and not ``wxyz``."""
    part = next(part for part, there in zip("wxyz", parts, strict=True) if part != there)
    under = "wxyz"[parts.index(part)]
    return f"the measured orientation looks like {parts} quaternions, as if {part} were under q{under}"


def misread(rotation: Rotation) -> Iterator[tuple[Reading, Floats]]:
    """All mistakes between two conventions: three numbers of the one were converted by the other. As `rotation_readings`."""
    pairs: list[tuple[Convention, Convention, bool]] = [(*pair, True) for pair in permutations(BY_AXIS, 2)]
    for one, two in permutations(BY_ORDER, 2):
        if one.lower() != two.lower() or len(set(one)) < 3:  # else each number keeps its axis
            pairs.append((one, two, False))
    for meant, taken, by_axis in pairs:
        numbers, read = _described(meant, by_axis), _described(taken, by_axis)
        looks = f"the orientations look like {numbers} that were read as {read}"
        R = reread(rotation, taken, meant, by_axis=by_axis).as_matrix()
        yield Reading(looks, f"compute qw qx qy qz again, from {numbers}"), R


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
    words = f"Euler angles {convention} about {'fixed' if convention.islower() else 'moving'} axes"
    return f"{words} ({convention[::-1].upper()} about moving axes)" if by_axis else words


def _axes_words(s: Floats) -> tuple[list[str], list[str]]:
    if (s == ONE).all():
        return [], []
    if (np.abs(s) == ONE).all():
        listed = ", ".join(name for name, sign in zip(AXES, np.diag(s), strict=True) if sign < 0.0)
        return [f"{listed} look{'s' if len(listed) == 1 else ''} reversed"], [f"change the sign of {listed}"]
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


@dataclass(frozen=True)
class CommandReading:
    """A way to read commands: ``matrix @ q``, plus a fitted zero for each of the columns with the indices ``zeros``.

    ``looks``, ``hints``: the mistakes in ``matrix``, each as the two texts of a message.
    """

    looks: tuple[str, ...]
    hints: tuple[str, ...]
    matrix: Floats
    zeros: tuple[int, ...] = ()

    @property
    def mistakes(self) -> int:
        """Number of mistakes that it assumes."""
        return len(self.looks) + len(self.zeros)

    def words(self, z: Floats, revolute: Mask) -> Reading:
        """What the commands look like and what the user should do, with zeros z (n,), m or rad."""
        looks, hints = list(self.looks), list(self.hints)
        for j in self.zeros:
            turned = f", {np.degrees(z[j]):+.4g} degrees" if revolute[j] else ""
            looks.append(f"q{j + 1} looks shifted by {z[j]:+.3g} (the drive's zero{turned})")
            # A convention differs by whole quarters of a turn: what is beyond is the zero, which a calibration finds.
            degrees_off = 90.0 * np.round(z[j] / (np.pi / 2.0)) if revolute[j] else 0.0
            whole = degrees_off != 0.0 and abs(z[j] - np.radians(degrees_off)) < TOLERANCE["zero"]
            off = np.radians(degrees_off) if whole else z[j]
            hints.append(f"add {off:.6g} to q{j + 1}" + (f" ({degrees_off:+.0f} degrees)" if whole else ""))
        other = (self.matrix != np.eye(len(z))).any(axis=1)
        other[list(self.zeros)] = True
        columns = " ".join(name for name, own in zip(command_names(len(z)), other, strict=True) if own)
        return Reading(", and ".join(looks), ", then ".join(hints), self.mistakes, columns)


def one_mistake(revolute: Mask) -> Iterator[CommandReading]:
    """Readings with one mistake: one column or all with the other sign or in another unit; two columns swapped; all columns in
    reverse order, or shifted by one; a joint counted from the one before it; a zero.

    ``revolute``: (n,) whether an actuator turns.
    """
    count, one = len(revolute), np.eye(len(revolute))
    names = command_names(count)
    for some in [*([i] for i in range(count)), *([list(range(count))] if count > 1 else [])]:
        columns, look = " ".join(names[i] for i in some), "looks" if len(some) == 1 else "look"
        turning = DEGREES if revolute[some].all() else ()
        for unit, factor in (("reversed", -1.0), *(turning if revolute[some].any() else UNITS)):
            scale = np.ones(count)
            scale[some] = factor
            hint = f"change the sign of {columns}" if factor < 0.0 else f"multiply {columns} by {factor:.6g}"
            looks = f"{columns} {look} {'like ' if factor > 0.0 else ''}{unit}"
            yield CommandReading((looks,), (hint,), np.diag(scale))
    for i, j in combinations(range(count), 2):
        order = np.arange(count)
        order[[i, j]] = j, i
        looks = f"{names[i]} and {names[j]} look swapped"
        yield CommandReading((looks,), ("swap them",), one[order])
    if count > 3:  # of three, the first and the last are swapped
        yield CommandReading(("q1 .. qn look to be in reverse order",), ("reverse them",), one[::-1])
    for by in (1, -1) if count > 2 else ():
        order = np.roll(range(count), by)
        hint = f"write ({', '.join(f'{names[i]} = {names[j]}' for i, j in enumerate(order))})"
        yield CommandReading((f"{' '.join(names)} look shifted by one",), (hint,), one[order])
    for j in range(1, count):
        if revolute[j - 1 : j + 1].all():
            yield from (_of_two(count, (j - 1, j), (1, 1), coupling, ()) for coupling in (1, -1))
    yield from (CommandReading((), (), one, (j,)) for j in range(count))


def several_mistakes(revolute: Mask) -> Iterator[CommandReading]:
    """Readings with several mistakes in two columns: signs, zeros and, of neighbouring joints that turn, a coupling."""
    count = len(revolute)
    for pair in combinations(range(count), 2):
        coupled = pair[1] == pair[0] + 1 and revolute[list(pair)].all()
        subsets = chain.from_iterable(combinations(pair, k) for k in range(3))
        for zeros, *signs, coupling in product(subsets, (1, -1), (1, -1), (0, 1, -1) if coupled else (0,)):
            reading = _of_two(count, pair, (signs[0], signs[1]), coupling, zeros)
            if reading.mistakes > 1:
                yield reading


def _of_two(
    count: int, pair: tuple[int, int], signs: tuple[int, int], coupling: int, zeros: tuple[int, ...]
) -> CommandReading:
    """The reading with two columns of some signs, and the first one, as it stands, added to or taken from the second one."""
    matrix, names, looks, hints = np.eye(count), command_names(count), list[str](), list[str]()
    for j, sign in zip(pair, signs, strict=True):
        matrix[j, j] = sign
        if sign < 0:
            looks.append(f"{names[j]} looks reversed")
            hints.append(f"change the sign of {names[j]}")
    if coupling:
        matrix[pair[1], pair[0]] = coupling
        one, two = (names[j] for j in pair)
        total = f"{'-' * (signs[1] < 0)}{two} {'+' if coupling > 0 else '-'} {one}"
        look = f"{two} looks counted from a fixed direction (as the horizontal) and not from the link before it"
        looks.append(f"{look}: the joint turns by {total}")
        hints = [*hints[: signs[0] < 0], f"write {total} under {two}"]
        if signs[0] < 0:
            hints[0], hints[-1] = f"{hints[-1]} ({one} as it is now)", hints[0]
    return CommandReading(tuple(looks), tuple(hints), matrix, zeros)


LENGTHS = {TrackerTable: ("x", "y", "z"), RangeTable: ("range",), PlaneTable: ("height",)}
"""Columns of lengths."""
TILTS = (
    ("tilt_x has the other sign", ("tilt_x", -1.0), ("tilt_y", 1.0)),
    ("tilt_y has the other sign", ("tilt_x", 1.0), ("tilt_y", -1.0)),
    ("tilts have the other sign", ("tilt_x", -1.0), ("tilt_y", -1.0)),
    ("tilt_x and tilt_y are swapped", ("tilt_y", 1.0), ("tilt_x", 1.0)),
    ("the sensor is mounted a quarter turn about its z", ("tilt_y", -1.0), ("tilt_x", 1.0)),
    ("the sensor is mounted a quarter turn about its z", ("tilt_y", 1.0), ("tilt_x", -1.0)),
)
"""Message text, and what is read as tilt_x and as tilt_y: a column and its sign."""
Columns = dict[str, tuple[str, float]]
"""By a column's name, the column that is read in its place, and the factor by which its numbers are multiplied."""


def table_readings(rows: InstrumentRows, index: int, unit_of_reading: str) -> Iterator[tuple[Reading, InstrumentRows]]:
    """Other ways to read an instrument's table: lengths in other units (columns, places and target, alone and together), signs.

    ``index``: of the instrument. ``unit_of_reading``: unit of the instrument's first component, ``m`` or ``rad``. Each comes
    with the rows that are read so; its ``columns`` is the key of dataset.toml where only the description is another one.
    """
    table, mine = rows.tables[index], rows.rows_of(index)

    def read(
        looks: str, hint: str, own: Columns, said: Mapping[str, Any] | None = None
    ) -> tuple[Reading, InstrumentRows]:
        columns = dict(rows.columns)
        for name, (of, factor) in own.items():
            columns[name] = np.array(rows.columns[name], dtype=float)
            columns[name][mine] = factor * np.array(rows.columns[of][mine], dtype=float)
        tables = (*rows.tables[:index], table.model_copy(update=dict(said or {})), *rows.tables[index + 1 :])
        where = " ".join(own) or f"instrument.{index}.{next(iter(said or {}))}"
        return Reading(looks, hint, columns=where), replace(rows, tables=tables, columns=columns)

    lengths = [name for name in LENGTHS.get(type(table), ()) if name in rows.columns]
    present = [name for name in lengths if np.isfinite(rows.columns[name][mine]).all()]
    keys = {key: key for key in ("stations", "planes", "sockets") if getattr(table, key, None)}
    if table.targets or isinstance(table.target, tuple):
        key = "targets" if table.targets else "target"
        keys[key] = f"the {key}"
    for unit, factor in UNITS:
        parts: list[tuple[str, Columns, dict[str, Any]]] = []
        if present:
            parts.append((" ".join(present), _scaled(present, factor), {}))
        parts += [(name, {}, {key: _in_unit(getattr(table, key), factor)}) for key, name in keys.items()]
        for some in chain.from_iterable(combinations(parts, count) for count in range(1, len(parts) + 1)):
            names = tuple(part[0] for part in some)
            verb = "looks" if names in (("range",), ("height",), ("the target",)) else "look"
            own = {name: way for _, columns, _ in some for name, way in columns.items()}
            said = {key: value for *_, keys in some for key, value in keys.items()}
            yield read(f"{' and '.join(names)} {verb} like {unit}", f"multiply by {factor:g}", own, said)
    if "height" in present:
        hint = "height is positive on the side that the normal points to: change its sign, or the normal's"
        yield read("heights are of the other side of the plane", hint, _scaled(["height"], -1.0))
        hint = "multiply by 1000, if millimetres were converted twice"
        yield read("heights look a thousand times too small", hint, _scaled(["height"], 1e3))
    if isinstance(table, TiltTable):
        for unit, factor in (*DEGREES, ("mm/m", 1e-3)):
            yield read(f"tilts look like {unit}", f"multiply by {factor:.6g}", _scaled(["tilt_x", "tilt_y"], factor))
        whose = f"the frame of {table.link}" if table.link else "the TCP frame"
        hint = f"tilt_x and tilt_y are along x and y of {whose}, positive where these point up"
        yield from (read(looks, hint, {"tilt_x": x, "tilt_y": y}) for looks, x, y in TILTS)
    if isinstance(table, EncoderTable):
        units = DEGREES if unit_of_reading == "rad" else UNITS
        for (sign, and_sign), (name, factor) in product(((1.0, ""), (-1.0, " of the other sign")), units):
            hint, own = f"multiply by {sign * factor:.6g}", _scaled(["reading"], sign * factor)
            yield read(f"readings look like {name}{and_sign}", hint, own)
        hint = "readings grow with the joint's coordinate as the URDF has it: multiply by -1"
        yield read("readings have the other sign", hint, _scaled(["reading"], -1.0))
        hint = "subtract the offset from the readings, or declare a larger zero_sigma"
        yield read("the zero is farther off than zero_sigma says", hint, {}, {"zero_sigma": 1e3})
    if isinstance(table, TrackerTable) and "qw" in rows.columns:
        own = {name: (of, 1.0) for name, of in zip(ORIENTATION, ("qz", "qw", "qx", "qy"), strict=True)}
        yield read("quaternions look like xyzw", "give qw qx qy qz, the real part first", own)


def _scaled(names: Sequence[str], factor: float) -> Columns:
    return {name: (name, factor) for name in names}


def _in_unit(at: Any, factor: float) -> Any:
    """A point, a plane, or several by their names in another unit; anything else as it is."""
    if isinstance(at, dict):
        return {name: _in_unit(one, factor) for name, one in at.items()}
    if isinstance(at, PlaneOf):
        return at.model_copy(update={"point": _in_unit(at.point, factor)})
    return tuple(factor * v for v in at) if isinstance(at, tuple) else at
