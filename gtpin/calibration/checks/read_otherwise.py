"""Usual mistakes in an instrument's table and description, as other ways to read them: other units, signs and orders."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from gtpin.data.instrument_rows import InstrumentRows
from gtpin.data.instrument_tables import EncoderTable, InstrumentTable, PlaneTable, RangeTable, TiltTable, TrackerTable
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
    present = [
        n for n in LENGTHS.get(type(table), ()) if n in rows.columns and np.isfinite(rows.columns[n][mine]).all()
    ]
    parts: list[tuple[str, str | None, str, Change]] = []
    for unit, factor in UNITS:
        parts = []
        if present:
            parts.append((" ".join(present), " ".join(present), "", _scaled_columns(present, factor)))
        parts += [(key, None, key, _scaled_places(key, factor)) for key in PLACES if getattr(table, key, None)]
        if table.targets or isinstance(table.target, tuple):
            key = "targets" if table.targets else "target"
            parts.append((f"the {key}", None, key, _scaled_target(factor)))
        for count in range(1, len(parts) + 1):
            for some in combinations(parts, count):
                names, columns, keys, changes = zip(*some, strict=True)
                verb = "looks" if names in (("range",), ("height",), ("the target",)) else "look"
                looks = f"{' and '.join(names)} {verb} like {unit}"
                yield Otherwise(looks, f"multiply by {factor:g}", _all(changes), columns[0], keys[0])
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
        yield Otherwise("quaternions look like xyzw", hint, _real_part_first, " ".join(ORIENTATION))


def _tilts() -> Iterator[Otherwise]:
    both = ("tilt_x", "tilt_y")
    for unit, factor in (("degrees", np.pi / 180.0), ("mm/m", 1e-3)):
        hint = f"multiply by {factor:.6g}"
        yield Otherwise(f"tilts look like {unit}", hint, _scaled_columns(list(both), factor), " ".join(both))
    for looks, columns, signs in TILTS:
        hint = "tilt_x and tilt_y are along the TCP frame's x and y, positive where these point up"

        def change(
            table: InstrumentTable,
            numbers: Numbers,
            columns: tuple[str, str] = columns,
            signs: tuple[float, float] = signs,
        ) -> tuple[InstrumentTable, Numbers]:
            return table, {name: s * numbers[of] for name, of, s in zip(both, columns, signs, strict=True)}

        yield Otherwise(looks, hint, change, " ".join(both))


def _readings(unit: str) -> Iterator[Otherwise]:
    """Other ways to read an encoder."""
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
    yield Otherwise("the zero is farther off than zero_sigma says", hint, _any_zero, None, "zero_sigma")


def _any_zero(table: InstrumentTable, _: Numbers) -> tuple[InstrumentTable, Numbers]:
    return table.model_copy(update={"zero_sigma": ANY_ZERO}), {}


def _real_part_first(table: InstrumentTable, numbers: Numbers) -> tuple[InstrumentTable, Numbers]:
    return table, dict(zip(("qx", "qy", "qz", "qw"), (numbers[name] for name in ORIENTATION), strict=True))


def _scaled_columns(names: list[str], factor: float) -> Change:
    return lambda table, numbers: (table, {name: numbers[name] * factor for name in names})


def _scaled_places(key: str, factor: float) -> Change:
    def change(table: InstrumentTable, _: Numbers) -> tuple[InstrumentTable, Numbers]:
        places = getattr(table, key)
        new: dict[str, Any] = {}
        for name, at in places.items():
            new[name] = (
                at.model_copy(update={"point": _scaled(at.point, factor)}) if key == "planes" else _scaled(at, factor)
            )
        return table.model_copy(update={key: new}), {}

    return change


def _scaled_target(factor: float) -> Change:
    def change(table: InstrumentTable, _: Numbers) -> tuple[InstrumentTable, Numbers]:
        targets = {name: _scaled(at, factor) for name, at in table.targets.items()}
        one = _scaled(table.target, factor) if isinstance(table.target, tuple) else table.target
        return table.model_copy(update={"targets": targets, "target": one}), {}

    return change


def _scaled(at: tuple[float, ...], factor: float) -> tuple[float, ...]:
    return tuple(factor * v for v in at)


def _all(changes: tuple[Change, ...]) -> Change:
    def change(table: InstrumentTable, numbers: Numbers) -> tuple[InstrumentTable, Numbers]:
        columns: Numbers = {}
        for one in changes:
            table, new = one(table, numbers)
            columns |= new
        return table, columns

    return change
