"""Numbers of dataset.toml that are well formed, but that no machine and no instrument has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtpin.data.dataset import Dataset
from gtpin.data.names import POSITION
from gtpin.errors import DatasetError, warn

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


def check_extremes(dataset: Dataset) -> None:
    """Check the numbers that dataset.toml gives, and that the commands differ.

    Raises
    ------
    DatasetError
        For a sigma, a tolerance, a station or a reference temperature that can't be, for positions beyond any unit, and
        where all commands are the same.

    Warns
    -----
    GtpinWarning
        Of a reference temperature that could be in degrees Fahrenheit.
    """
    file = None if dataset.path is None else dataset.path / "dataset.toml"
    for key, value, (least, most), hint in (*_bounded(dataset), *_of_readings(dataset)):
        if not least <= value <= most:
            raise DatasetError(
                f"{value:.6g} can't be", file=file, column=key, hint=f"{hint}, from {least:g} to {most:g}"
            )
    if FAHRENHEIT[0] <= (reference := dataset.conditions.reference_temperature) <= FAHRENHEIT[1]:
        text = f"reference_temperature is taken as {reference:g} degC; where it is in degrees Fahrenheit, convert it"
        warn(f"{file}: {text}" if file else text)
    for name, size in zip(POSITION, np.median(np.abs(dataset.position), axis=0), strict=True):
        if size > FARTHEST:
            what, hint = f"half of the positions are {size:.2g} m away or farther", "give metres"
            raise DatasetError(what, file=dataset.file, column=name, hint=hint)
    if len(dataset) > 1 and not np.ptp(dataset.q, axis=0).any():
        hint = "calibration needs poses all over the workspace"
        raise DatasetError("all poses have the same commands", file=dataset.place(0)[0], column="q1", hint=hint)


Bound = tuple[str, float, tuple[float, float], str]
"""A key, its value, the limits of the value, and a hint."""


def _of_readings(dataset: Dataset) -> Iterator[Bound]:
    """The bounds for the instruments of schema 2."""
    for i, table in enumerate(() if dataset.readings is None else dataset.readings.tables):
        for name in ("sigma", "position_sigma", "orientation_sigma"):
            sigma = getattr(table, name, None)
            if sigma is not None:
                looks = " (it looks like micrometres or microradians)" if sigma > SIGMA[1] else ""
                yield f"instrument.{i}.{name}", sigma, SIGMA, f"1 sigma in m or rad{looks}"


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
