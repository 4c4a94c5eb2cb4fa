"""Usual mistakes in an instrument's table and description, as other ways to read them: other units, signs and orders."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from gtpin.data.instrument_rows import InstrumentRows
from gtpin.data.instrument_tables import (
    EncoderTable,
    InstrumentTable,
    PlaneOf,
    PlaneTable,
    RangeTable,
    TiltTable,
    TrackerTable,
)
from gtpin.data.names import ORIENTATION
from gtpin.typing import Floats

Numbers = dict[str, Floats]
Change = Callable[[InstrumentTable, Numbers], tuple[InstrumentTable, Numbers]]

UNITS = (("millimetres", 1e-3), ("centimetres", 1e-2), ("inches", 0.0254), ("micrometres", 1e-6))
LENGTHS: dict[type[InstrumentTable], tuple[str, ...]] = {
    TrackerTable: ("x", "y", "z"),
    RangeTable: ("range",),
    PlaneTable: ("height",),
}
"""Columns of lengths."""
ANY_ZERO = 1e3
"""Prior sigma of an encoder's zero, rad or m, with which the zero is practically free."""
PLACES = ("stations", "planes", "sockets")
"""Keys of dataset.toml that have points of the base frame."""
TILTS: tuple[tuple[str, tuple[str, str], tuple[float, float]], ...] = (
    ("tilt_x has the other sign", ("tilt_x", "tilt_y"), (-1.0, 1.0)),
    ("tilt_y has the other sign", ("tilt_x", "tilt_y"), (1.0, -1.0)),
    ("tilts have the other sign", ("tilt_x", "tilt_y"), (-1.0, -1.0)),
    ("tilt_x and tilt_y are swapped", ("tilt_y", "tilt_x"), (1.0, 1.0)),
    ("the sensor is mounted a quarter turn about its z", ("tilt_y", "tilt_x"), (-1.0, 1.0)),
    ("the sensor is mounted a quarter turn about its z", ("tilt_y", "tilt_x"), (1.0, -1.0)),
)
"""Message text, the columns that are read as tilt_x and tilt_y, and their signs."""


@dataclass(frozen=True)
class Otherwise:
    """Another way to read an instrument.

    ``looks``, ``hint``: message texts: what the table looks like, and what the user should do. ``change``: function that
    gives the description and the columns, read in this way. ``column``, ``key``: the columns of the table that are wrong,
    or the key of dataset.toml.
    """

    looks: str
    hint: str
    change: Change
    column: str | None
    key: str = ""


def ways(rows: InstrumentRows, index: int, unit_of_reading: str) -> Iterator[Otherwise]:
    """Other ways to read an instrument's table: lengths in other units (columns, places and target, alone and together), signs.

    ``index``: of the instrument. ``unit_of_reading``: unit of the instrument's first component, ``m`` or ``rad``.
    """
    table = rows.tables[index]
    mine = rows.rows_of(index)
    lengths = [name for name in LENGTHS.get(type(table), ()) if name in rows.columns]
    present = [name for name in lengths if np.isfinite(rows.columns[name][mine]).all()]
    for unit, factor in UNITS:
        parts: list[tuple[str, str | None, str, Change]] = []
        if present:
            parts.append((" ".join(present), " ".join(present), "", _scaled_columns(present, factor)))
        keys = {key: key for key in PLACES if getattr(table, key, None)}
        if table.targets or isinstance(table.target, tuple):
            key = "targets" if table.targets else "target"
            keys[key] = f"the {key}"
        for key, name in keys.items():
            parts.append((name, None, key, _with(**{key: _scaled(getattr(table, key), factor)})))
        for count in range(1, len(parts) + 1):
            for some in combinations(parts, count):
                names = tuple(part[0] for part in some)
                verb = "looks" if names in (("range",), ("height",), ("the target",)) else "look"
                looks = f"{' and '.join(names)} {verb} like {unit}"
                changes = tuple(part[3] for part in some)
                yield Otherwise(looks, f"multiply by {factor:g}", _all(changes), *some[0][1:3])
    if "height" in present:
        hint = "height is positive on the side that the normal points to: change its sign, or the normal's"
        looks = "heights are of the other side of the plane"
        yield Otherwise(looks, hint, _scaled_columns(["height"], -1.0), "height")
    if isinstance(table, TiltTable):
        yield from _tilts()
    if isinstance(table, EncoderTable):
        yield from _readings(unit_of_reading)
    if isinstance(table, TrackerTable) and "qw" in rows.columns:
        hint = "give qw qx qy qz, the real part first"
        change = _renamed(("qx", "qy", "qz", "qw"), ORIENTATION)
        yield Otherwise("quaternions look like xyzw", hint, change, " ".join(ORIENTATION))


def _tilts() -> Iterator[Otherwise]:
    both = ("tilt_x", "tilt_y")
    for unit, factor in (("degrees", np.pi / 180.0), ("mm/m", 1e-3)):
        hint = f"multiply by {factor:.6g}"
        yield Otherwise(f"tilts look like {unit}", hint, _scaled_columns(list(both), factor), " ".join(both))
    hint = "tilt_x and tilt_y are along the TCP frame's x and y, positive where these point up"
    for looks, columns, signs in TILTS:
        yield Otherwise(looks, hint, _renamed(both, columns, signs), " ".join(both))


def _readings(unit: str) -> Iterator[Otherwise]:
    units = (("degrees", np.pi / 180.0),) if unit == "rad" else UNITS
    for sign, and_sign in ((1.0, ""), (-1.0, " of the other sign")):
        for name, factor in units:
            hint = f"multiply by {sign * factor:.6g}"
            yield Otherwise(
                f"readings look like {name}{and_sign}", hint, _scaled_columns(["reading"], sign * factor), "reading"
            )
    hint = "readings grow with the joint's coordinate as the URDF has it: multiply by -1"
    yield Otherwise("readings have the other sign", hint, _scaled_columns(["reading"], -1.0), "reading")
    hint = "subtract the offset from the readings, or declare a larger zero_sigma"
    yield Otherwise(
        "the zero is farther off than zero_sigma says", hint, _with(zero_sigma=ANY_ZERO), None, "zero_sigma"
    )


def _renamed(names: Sequence[str], columns: Sequence[str], signs: Sequence[float] = (1.0,) * 4) -> Change:
    """Columns in the place of others, with signs."""
    read = list(zip(names, columns, signs, strict=False))
    return lambda table, numbers: (table, {name: sign * numbers[of] for name, of, sign in read})


def _scaled_columns(names: Sequence[str], factor: float) -> Change:
    return _renamed(names, names, [factor] * len(names))


def _with(**keys: Any) -> Change:
    """Other keys of dataset.toml."""
    return lambda table, _: (table.model_copy(update=keys), {})


def _scaled(at: Any, factor: float) -> Any:
    """A point, a plane, or several by their names in another unit; anything else as it is."""
    if isinstance(at, dict):
        return {name: _scaled(one, factor) for name, one in at.items()}
    if isinstance(at, PlaneOf):
        return at.model_copy(update={"point": _scaled(at.point, factor)})
    return tuple(factor * v for v in at) if isinstance(at, tuple) else at


def _all(changes: tuple[Change, ...]) -> Change:
    def change(table: InstrumentTable, numbers: Numbers) -> tuple[InstrumentTable, Numbers]:
        columns: Numbers = {}
        for one in changes:
            table, new = one(table, numbers)
            columns |= new
        return table, columns

    return change
