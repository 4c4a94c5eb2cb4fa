"""The content of dataset.toml: robot, instrument, conditions, tolerances, drivers."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from gtpin.data.files import read_text, refuse_control
from gtpin.errors import DatasetError

Motion = Literal["x", "y", "z", "rx", "ry", "rz", "q"]
MOTIONS: tuple[str, ...] = get_args(Motion)
DEEPEST = 20
"""Most parts of a dotted key; a dataset.toml has three."""
SCHEMA, SECOND = "gtpin-dataset/1", "gtpin-dataset/2"
"""Of the poses of one tracker, and of several instruments."""
LARGEST = 1e12
"""Largest absolute value, m or rad, of a number in a description or a reading: its fourth power is still finite."""
Finite = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, le=LARGEST, allow_inf_nan=False)]
Tolerance = Annotated[float, Field(ge=1e-10, le=10.0, allow_inf_nan=False)]
SigmaValue = Annotated[float, Field(ge=1e-10, le=1.0, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(ge=-1e4, le=1e4, allow_inf_nan=False)]
Station = Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)]
Point = Annotated[tuple[Finite, Finite, Finite], Field(strict=False)]
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


def hint(text: str) -> Any:
    """What errors about the annotated key say that the user should write."""
    return Field(description=text)


def mistake(key: str, what: str, hint: str) -> ValidationError:
    """The error of keys that do not go together, named at one of them."""
    error = PydanticCustomError("mistake", what, {"hint": hint})
    return ValidationError.from_exception_data("instrument", [{"type": error, "loc": (key,), "input": None}])


@dataclass(frozen=True)
class Driver:
    """A recorded column (a tilt sensor, a motor current, a thermistor) that may act at a site.

    Parameters
    ----------
    column
        The covariate's name.
    site
        A link, a joint, ``platform`` or ``frame``.
    motion
        What it moves: ``x y z`` (m) or ``rx ry rz`` (rad) in the site's frame, or the coordinate ``q`` of a joint.
    size
        Typical motion over the column's range, m or rad.
    sensor
        Name of the sensor that the column is of. Columns of one sensor, such as the two axes of an inclinometer, are one cause.

    Examples
    --------
    >>> from gtpin.data import Driver
    >>> Driver("tilt_x", "column", "rx", 1e-3).motion
    'rx'
    """

    column: str
    site: str
    motion: Motion
    size: float
    sensor: str | None = None


class TomlSection(BaseModel):
    """A part of a dataset.toml: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)


SIZE = "above 0, from 1e-10 to 1 (it is not in micrometres or degrees); leave it out to have the noise estimated"
Frame = Annotated[Literal["robot", "free"], hint('write "robot" or "free"')]
Stations = Annotated[
    Literal["session"] | None, hint('write stations = "session" for a free frame for each value of the column session')
]


def with_free_frames(values: Any) -> Any:
    """The keys of an instrument with ``frame = "free"`` where they have ``stations``; an error for keys that contradict it."""
    if not isinstance(values, Mapping) or values.get("stations") is None:
        return values
    if values.get("frame", "free") != "free":
        raise mistake("frame", "stations have free frames", 'leave frame out, or write frame = "free"')
    if values.get("station") is not None:
        raise mistake("station", "station together with stations", "leave it out: where each station stands is found")
    return {**values, "frame": "free"}


class InstrumentSection(TomlSection):
    """The instrument that measured the poses.

    - `position_sigma`, `orientation_sigma`: standard deviation of its noise per axis, m and rad; None: it is estimated.
    - `frame`: `free` where the pose of the base frame in the instrument's frame is identified; `robot` where both are the same.
    - `target`: `free` where the target's pose on the platform is identified; `tcp` where the target is at the TCP; (3,) where
      it is, TCP frame, m.
    - `station`: the instrument's own position in its frame, m; None where it is not known.
    - `stations`: `session` where the instrument stood elsewhere in each session: a free frame for each value of this column.
    """

    position_sigma: Annotated[SigmaValue | None, hint(f"1 sigma per axis in m, {SIZE}")] = None
    orientation_sigma: Annotated[SigmaValue | None, hint(f"1 sigma per axis in rad, {SIZE}")] = None
    frame: Frame = "robot"
    target: Annotated[
        Point | Literal["tcp", "free"],
        hint('write target = [x, y, z], m, TCP frame, or "free", or leave it out where the target is the TCP'),
    ] = "tcp"
    station: Annotated[Station | None, hint("station = [x, y, z], three finite numbers in m, up to 10 km")] = None
    stations: Stations = None
    _free_frames = model_validator(mode="before")(with_free_frames)

    @property
    def reads(self) -> bool:
        """Whether what it measured are readings, and no poses of the TCP in one frame: of several stations, or of a target."""
        return self.stations is not None or isinstance(self.target, tuple)


class Conditions(TomlSection):
    """The reference temperature, degC: the nominal geometry is valid at it, and thermal effects are zero."""

    reference_temperature: Annotated[
        float,
        Field(ge=-60.0, le=150.0, allow_inf_nan=False),
        hint("the temperature at which the geometry holds, degC, from -60 to 150 (subtract 273.15 from kelvin)"),
    ] = 20.0


class DriverTable(TomlSection):
    """One `[[driver]]`: see :class:`~gtpin.data.description.Driver`."""

    column: Annotated[Text, hint('write column = "NAME", a covariate of poses.csv')]
    site: Annotated[Text, hint('write site = "NAME": a link, a joint, platform or frame')]
    motion: Annotated[Motion, hint(f"write motion = one of {', '.join(MOTIONS)}")]
    size: Annotated[Positive, hint("write size = the typical motion over the column's range, m or rad, above 0")]
    sensor: Annotated[Text | None, hint('write sensor = "NAME", the same for all columns of a sensor')] = None


class Description(TomlSection):
    """The whole of dataset.toml.

    `tcp` is the link whose pose is measured; None: the robot's own TCP. `actuators` are the joints that q1 .. qn command;
    empty: the robot's own. `home` are the commands of the home posture, or the name of a keyframe; empty: the robot's own.
    `tolerance` has standard deviations by kind of parameter, m, rad or m/m.
    """

    schema_: Literal["gtpin-dataset/1"] = Field(
        alias="schema", description=f'write schema = "{SCHEMA}", or "{SECOND}" for several instruments'
    )
    robot: Annotated[Text, hint('write robot = "NAME" (gtpin robots lists them), or a path to a URDF or MJCF file')]
    tcp: Annotated[Text | None, hint('write tcp = "LINK"')] = None
    actuators: Annotated[tuple[Text, ...], Field(strict=False), hint('write actuators = ["JOINT", "JOINT", ...]')] = ()
    home: Annotated[
        Annotated[tuple[Finite, ...], Field(strict=False)] | Text,
        hint("write home = [...], a command for each of q1 .. qn, or the name of a keyframe of an MJCF"),
    ] = ()
    instrument: InstrumentSection = InstrumentSection()
    conditions: Conditions = Conditions()
    tolerance: Annotated[
        dict[Text, Tolerance], hint("a tolerance is 1 sigma in m, rad or m/m, above 0, from 1e-10 to 10")
    ] = {}
    driver: Annotated[tuple[DriverTable, ...], Field(strict=False), hint("each driver is a table [[driver]]")] = ()

    @property
    def drivers(self) -> tuple[Driver, ...]:
        """The drivers that are tested as causes."""
        return tuple(Driver(**table.model_dump()) for table in self.driver)


_SECTIONS: dict[str, type[TomlSection]] = {
    "instrument": InstrumentSection,
    "conditions": Conditions,
    "driver": DriverTable,
}


def describe(values: Mapping[str, object], file: Path | None = None) -> Description:
    """Check the content of a dataset.toml; raises `DatasetError` with the invalid key."""
    try:
        return Description.model_validate(values)
    except ValidationError as error:
        raise explained(file, error) from None


def read_toml(file: Path) -> dict[str, Any]:
    """Read a TOML file; raises `DatasetError` if it is not TOML, not UTF-8, or has control characters in names."""
    text = read_text(file)
    for number, row in enumerate(text.splitlines(), 1):
        if row.partition("=")[0].count(".") > DEEPEST:
            raise DatasetError(f"a key of more than {DEEPEST} parts", file=file, row=number, hint="delete the line")
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        line = re.search(r"at line (\d+)", str(error))
        what = f"not TOML: {re.sub(r' *[(]at .*[)]$', '', str(error))}"
        raise DatasetError(what, file=file, row=int(line[1]) if line else None, hint="correct the line") from None
    except (RecursionError, ValueError) as error:
        # tomllib gives up on brackets nested a thousand deep and on impossible dates or endless integers.
        raise DatasetError(f"not TOML that can be read ({str(error)[:80]})", file=file) from None
    refuse_control(content, file)
    return content


def write_description(file: Path, description: Description, instruments: Sequence[Mapping[str, Any]] = ()) -> None:
    """Write a dataset.toml that reads back as the same; unknown values are omitted.

    ``instruments``: the ``[[instrument]]`` sections of schema 2, in place of the one instrument of schema 1.
    """
    values = description.model_dump(by_alias=True, exclude_none=True)
    if instruments:
        del values["instrument"]
        values |= {"schema": SECOND, "instrument": list(instruments)}
    elif description.instrument.target == "tcp":  # the default
        del values["instrument"]["target"]
    text = tomli_w.dumps({key: value for key, value in values.items() if value not in ({}, (), [])})
    file.write_text(text, encoding="utf-8", newline="\n")


def explained(
    file: Path | None, error: ValidationError, model: type[BaseModel] = Description, *place: str
) -> DatasetError:
    """Turn the first of pydantic's errors into one line with a hint.

    ``model``, ``place``: what was validated, and the keys that lead to it.
    """
    first = error.errors(include_url=False)[0]
    location = [str(part) for part in first["loc"] if part != "[key]"]
    what, hint = _explanation(first["type"], location, first, model)
    return DatasetError(what, file=file, column=".".join([*place, *location]), hint=hint)


def _explanation(kind: str, location: list[str], first: Any, model: type[BaseModel]) -> tuple[str, str]:
    """What is wrong, and what to write."""
    given = f"{str(first['input'])[:60]!r}"
    if kind == "mistake":
        return first["msg"], first["ctx"]["hint"]
    section = _SECTIONS.get(location[0], model) if model is Description and len(location) > 1 else model
    # Of a place such as instrument.station.2, the key is station; of planes.A.normal, it is planes.
    hints = {name: field.description for model_ in (model, section) for name, field in _fields(model_).items()}
    key = next((part for part in location[section is not model :] if part in hints), location[0])
    expected = f"correct the value: {first['msg'][:1].lower()}{first['msg'][1:]}"
    hint = hints.get(key) or ("a finite number, 0 or more, m or rad" if key.endswith("_sigma") else expected)
    if kind == "extra_forbidden":
        inside = section is model and len(location) > 1  # of a key, such as a plane's of planes
        return "unknown key", hint if inside else _nearest(location[-1], section)
    if kind == "missing":
        return "the key is missing", hint
    if key == "schema":
        return f"{given} is not a schema that this version reads", hint
    if key == "instrument" and isinstance(first["input"], list):
        return "several instruments are of schema 2", f'write schema = "{SECOND}", or [instrument] in single brackets'
    if kind in ("model_type", "dict_type") and key in ("instrument", "conditions", "tolerance"):
        return "of the wrong kind", f"[{key}] is a section of its own"
    return f"{given} can't be", hint


def _fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _nearest(key: str, model: type[BaseModel]) -> str:
    """What an unknown key may have been meant to be."""
    if model in (Description, *_SECTIONS.values()):
        sections: list[tuple[str, type[TomlSection]]] = [("", Description), *_SECTIONS.items()]
        for name, other in sections:
            if other is not model and key in _fields(other):
                return f"it belongs under [{name}]" if name else "it belongs at the top, before any [section]"
    return meant(key, _fields(model))


def meant(word: str, known: Collection[str]) -> str:
    """The known word that an unknown one may have been meant to be, or all that are known."""
    close = difflib.get_close_matches(word.lower(), known, n=1)
    return f"did you mean {close[0]}?" if close else f"known here: {', '.join(known)}"
