"""Usual mistakes in an instrument's table and description, as other ways to read them: other units, signs and orders."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
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
Columns = dict[str, tuple[str, float]]
"""By a column's name, the column that is read in its place, and the factor by which its numbers are multiplied."""


@dataclass(frozen=True)
class Otherwise:
    """Another way to read an instrument.

    - ``looks``, ``hint``: message texts: what the table looks like, and what the user should do.
    - ``columns``: columns that are read in another way; else the description is wrong.
    - ``said``: other values of keys of the description, the first of which is the wrong one.
    """

    looks: str
    hint: str
    columns: Columns = field(default_factory=dict)
    said: Mapping[str, Any] = field(default_factory=dict)


def ways(rows: InstrumentRows, index: int, unit_of_reading: str) -> Iterator[Otherwise]:
    """Other ways to read an instrument's table: lengths in other units (columns, places and target, alone and together), signs.

    ``index``: of the instrument. ``unit_of_reading``: unit of the instrument's first component, ``m`` or ``rad``.
    """
    table = rows.tables[index]
    mine = rows.rows_of(index)
    lengths = [name for name in LENGTHS.get(type(table), ()) if name in rows.columns]
    present = [name for name in lengths if np.isfinite(rows.columns[name][mine]).all()]
    keys = {key: key for key in PLACES if getattr(table, key, None)}
    if table.targets or isinstance(table.target, tuple):
        key = "targets" if table.targets else "target"
        keys[key] = f"the {key}"
    for unit, factor in UNITS:
        parts: list[tuple[str, Columns, dict[str, Any]]] = []
        if present:
            parts.append((" ".join(present), _scaled(present, factor), {}))
        parts += [(name, {}, {key: _in_unit(getattr(table, key), factor)}) for key, name in keys.items()]
        for count in range(1, len(parts) + 1):
            for some in combinations(parts, count):
                names = tuple(part[0] for part in some)
                verb = "looks" if names in (("range",), ("height",), ("the target",)) else "look"
                columns = {name: read for _, own, _ in some for name, read in own.items()}
                said = {key: value for *_, own in some for key, value in own.items()}
                yield Otherwise(f"{' and '.join(names)} {verb} like {unit}", f"multiply by {factor:g}", columns, said)
    if "height" in present:
        hint = "height is positive on the side that the normal points to: change its sign, or the normal's"
        yield Otherwise("heights are of the other side of the plane", hint, _scaled(["height"], -1.0))
        hint = "multiply by 1000, if millimetres were converted twice"
        yield Otherwise("heights look a thousand times too small", hint, _scaled(["height"], 1e3))
    if isinstance(table, TiltTable):
        for unit, factor in (("degrees", np.pi / 180.0), ("mm/m", 1e-3)):
            hint = f"multiply by {factor:.6g}"
            yield Otherwise(f"tilts look like {unit}", hint, _scaled(["tilt_x", "tilt_y"], factor))
        hint = "tilt_x and tilt_y are along the TCP frame's x and y, positive where these point up"
        for looks, (x, y), (sign_x, sign_y) in TILTS:
            yield Otherwise(looks, hint, {"tilt_x": (x, sign_x), "tilt_y": (y, sign_y)})
    if isinstance(table, EncoderTable):
        for sign, and_sign in ((1.0, ""), (-1.0, " of the other sign")):
            for name, factor in (("degrees", np.pi / 180.0),) if unit_of_reading == "rad" else UNITS:
                looks, hint = f"readings look like {name}{and_sign}", f"multiply by {sign * factor:.6g}"
                yield Otherwise(looks, hint, _scaled(["reading"], sign * factor))
        hint = "readings grow with the joint's coordinate as the URDF has it: multiply by -1"
        yield Otherwise("readings have the other sign", hint, _scaled(["reading"], -1.0))
        hint = "subtract the offset from the readings, or declare a larger zero_sigma"
        yield Otherwise("the zero is farther off than zero_sigma says", hint, said={"zero_sigma": ANY_ZERO})
    if isinstance(table, TrackerTable) and "qw" in rows.columns:
        hint = "give qw qx qy qz, the real part first"
        read = {name: (of, 1.0) for name, of in zip(ORIENTATION, ("qz", "qw", "qx", "qy"), strict=True)}
        yield Otherwise("quaternions look like xyzw", hint, read)


def _scaled(names: list[str], factor: float) -> Columns:
    return {name: (name, factor) for name in names}


def _in_unit(at: Any, factor: float) -> Any:
    """A point, a plane, or several by their names in another unit; anything else as it is."""
    if isinstance(at, dict):
        return {name: _in_unit(one, factor) for name, one in at.items()}
    if isinstance(at, PlaneOf):
        return at.model_copy(update={"point": _in_unit(at.point, factor)})
    return tuple(factor * v for v in at) if isinstance(at, tuple) else at
