"""Numbers that no sensor of a machine reads, and numbers of dataset.toml that no machine and no instrument has."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gtpin.data.dataset import Dataset
from gtpin.data.files import warn_of
from gtpin.data.names import POSITION
from gtpin.errors import DatasetError
from gtpin.typing import Floats, Mask

MOST = 0.1
"""Share of the rows that may lack a reading before the column is refused; assumed."""
_OVERFLOW = (-999.0, -9999.0, -99999.0, 9999.0, 99999.0, 65535.0, 32767.0, -32768.0, 2147483647.0, 4294967295.0)
FASTEST = 20.0
"""Speed, m/s or rad/s, above which no actuator of a robot moves. Assumed."""
ROOM = (-40.0, 90.0)
"""A temperature column looks like kelvin where its median less 273.15 is in this range, degC. Assumed."""
WARM, MILD, USUAL = 45.0, (10.0, 40.0), 25.0
"""A temperature column looks like degrees Fahrenheit where its median is above `WARM`, is in the range `MILD`, degC, when it is
converted from Fahrenheit, and is more than `USUAL`, K, above the reference temperature. Assumed."""
SIGMA = (1e-10, 1.0)
"""Smallest and largest sigma of an instrument, m or rad. Assumed."""
TOLERANCE = (1e-10, 10.0)
"""Smallest and largest tolerance, m, rad or m/m. Assumed."""
STATION = 1e4
"""Farthest coordinate of an instrument, m, that can measure a robot; assumed."""
FARTHEST = 1e12
"""Median absolute value of a coordinate, m, above which no wrong unit explains it: 1e12 nm are 1 km. Assumed."""
TEMPERATURE = (-60.0, 150.0)
"""Lowest and highest reference temperature of a machine, degC. Assumed."""
FAHRENHEIT = (59.0, 86.0)
"""A reference temperature that is 15 to 30 degC when it is read in degrees Fahrenheit."""
Bound = tuple[str, float, tuple[float, float], str]
"""A key, its value, the limits of the value, and a hint."""


@dataclass(frozen=True)
class Kind:
    """What a column measures.

    - ``names``: its columns.
    - ``what``: what it is and its unit, for messages.
    - ``lowest``, ``highest``: limits of the values of any machine. Assumed.
    - ``marks``: values that loggers write where they have no reading. They count as marks where no other value is near
      them.
    - ``apart``: smallest distance of a mark from all other values, in the column's unit. It must also be at least ``spans``
      times the range of the other values.
    """

    names: re.Pattern[str]
    what: str
    lowest: float
    highest: float
    marks: tuple[float, ...]
    apart: float
    spans: float = 1.0


KINDS = (
    # 85 degC is a DS18B20's value at power-up, -127 degC is its library's error; 0 and -273.15 are 0 counts and 0 K.
    Kind(re.compile("temp.*"), "a temperature in degC", -60.0, 150.0, (0.0, 85.0, 127.0, -127.0, *_OVERFLOW), 5.0),
    Kind(re.compile("speed[0-9]+"), "a speed in m/s or rad/s", -FASTEST, FASTEST, _OVERFLOW, 10.0),
    Kind(re.compile("payload"), "a payload in kg", 0.0, 1e5, (65535.0, 32767.0, 9999.0, 99999.0), 1e3),
    Kind(re.compile("f[xyz]"), "a force in N", -1e6, 1e6, _OVERFLOW, 500.0),
    Kind(re.compile("time"), "a time in s", -1e20, 1e20, (0.0, -1.0, *_OVERFLOW), 60.0, 10.0),
    Kind(re.compile(".*"), "a number that can be counted with", -1e100, 1e100, (), np.inf),
)
"""Kinds of columns; the first one whose pattern matches a column's name applies."""


def sane_rows(dataset: Dataset) -> Mask:
    """(N,) the rows without an impossible value.

    Raises `DatasetError` if a temperature looks like kelvin or Fahrenheit, or a speed like mm/s; if more than a tenth of a
    column is impossible. Warns: names the poses that are set aside.
    """
    good = np.ones(len(dataset), dtype=bool)
    for name, column in dataset.covariates.items():
        if name == "session":
            continue
        kind = next(kind for kind in KINDS if kind.names.fullmatch(name))
        values = np.asarray(column, dtype=float)
        _check_units(dataset, name, values)
        lacking = _lacking(values, kind)
        if lacking.mean() > MOST:
            first = int(np.argmax(lacking))
            hint = f"{lacking.sum()} of {len(values)} rows are like that: give them as {kind.what}, or leave the column out"
            file, line = dataset.place(first)
            what = f"{values[first]:.6g} can't be {kind.what}"
            raise DatasetError(what, file=file, row=line, column=name, hint=hint)
        if lacking.any():
            shown = ", ".join(f"{value:g}" for value in np.unique(values[lacking])[:3])
            poses = ", ".join(dataset.names_of(lacking))
            warn_of(dataset.file, f"set aside, for {name} of {shown} is no reading: poses {poses}")
            good &= ~lacking
    return good


def _lacking(values: Floats, kind: Kind) -> Mask:
    """(N,) True for impossible values, and for marks of loggers that are far from all other values."""
    lacking = (values < kind.lowest) | (values > kind.highest)
    marked = np.isin(values, kind.marks) & ~lacking
    others = values[~lacking & ~marked]
    if not marked.any() or not len(others) or marked.mean() > MOST:
        return lacking
    low, high = float(others.min()), float(others.max())
    apart = np.maximum(low - values, values - high)
    return lacking | (marked & (apart > max(kind.apart, kind.spans * (high - low))))


def _check_units(dataset: Dataset, name: str, values: Floats) -> None:
    middle = float(np.median(values))
    if name.startswith("temp"):
        if ROOM[0] <= middle - 273.15 <= ROOM[1]:
            raise _looks(dataset, name, "kelvin", f"subtract 273.15 from {name}")
        reference = dataset.conditions.reference_temperature
        if middle > WARM and MILD[0] <= (middle - 32.0) / 1.8 <= MILD[1] and middle > reference + USUAL:
            hint = (
                f"{name} = ({name} - 32) / 1.8; a machine that is as warm as that has a reference_temperature near it, "
                "under [conditions]"
            )
            raise _looks(dataset, name, "degrees Fahrenheit", hint)
    if re.fullmatch("speed[0-9]+", name):
        moving = np.abs(values[values != 0.0])
        if len(moving) and FASTEST < float(np.median(moving)) <= 1e3 * FASTEST:
            raise _looks(dataset, name, "mm/s or degrees/s", "speeds are in m/s or rad/s")


def _looks(dataset: Dataset, name: str, unit: str, hint: str) -> DatasetError:
    return DatasetError(f"{name} looks like {unit}", file=dataset.file, column=name, hint=hint)


def check_extremes(dataset: Dataset) -> None:
    """Check the numbers that dataset.toml gives, and that the commands differ.

    Raises `DatasetError` for a sigma, a tolerance, a station or a reference temperature that can't be, for positions beyond
    any unit, and where all commands are the same. Warns: of a reference temperature that could be in degrees Fahrenheit.
    """
    file = dataset.toml
    for key, value, (least, most), hint in _bounded(dataset):
        if not least <= value <= most:
            raise DatasetError(
                f"{value:.6g} can't be", file=file, column=key, hint=f"{hint}, from {least:g} to {most:g}"
            )
    if FAHRENHEIT[0] <= (reference := dataset.conditions.reference_temperature) <= FAHRENHEIT[1]:
        text = f"reference_temperature is taken as {reference:g} degC; where it is in degrees Fahrenheit, convert it"
        warn_of(file, text)
    for name, size in zip(POSITION, np.median(np.abs(dataset.position), axis=0), strict=True):
        if size > FARTHEST:
            what, hint = f"half of the positions are {size:.2g} m away or farther", "give metres"
            raise DatasetError(what, file=dataset.file, column=name, hint=hint)
    if len(dataset) > 1 and not np.ptp(dataset.q, axis=0).any():
        hint = "calibration needs poses all over the workspace"
        raise DatasetError("all poses have the same commands", file=dataset.place(0)[0], column="q1", hint=hint)


def _bounded(dataset: Dataset) -> Iterator[Bound]:
    instrument = dataset.instrument
    for name, unit, long in (("position_sigma", "m", "metre"), ("orientation_sigma", "rad", "radian")):
        sigma = getattr(instrument, name)
        if sigma is not None:
            looks = f" (it looks like micro{long}s)" if sigma > SIGMA[1] else ""
            yield f"instrument.{name}", sigma, SIGMA, f"1 sigma per axis in {unit}{looks}"
    for coordinate in instrument.station or ():
        yield "instrument.station", coordinate, (-STATION, STATION), "where the instrument stands, m"
    hint = "the temperature at which the geometry holds, degC (subtract 273.15 from kelvin)"
    yield "conditions.reference_temperature", dataset.conditions.reference_temperature, TEMPERATURE, hint
    for kind, value in dataset.tolerance.items():
        yield f"tolerance.{kind}", value, TOLERANCE, "1 sigma in m, rad or m/m"
    for i, table in enumerate(dataset.readings.tables):
        for name in ("sigma", "position_sigma", "orientation_sigma"):
            sigma = getattr(table, name, None)
            if sigma is not None:
                looks = " (it looks like micrometres or microradians)" if sigma > SIGMA[1] else ""
                yield f"instrument.{i}.{name}", sigma, SIGMA, f"1 sigma in m or rad{looks}"
