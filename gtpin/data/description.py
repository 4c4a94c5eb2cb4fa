"""The content of dataset.toml: robot, instrument, conditions, tolerances, drivers."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from gtpin.data.files import read_text, refuse_control
from gtpin.errors import DatasetError

Motion = Literal["x", "y", "z", "rx", "ry", "rz", "q"]
MOTIONS: tuple[str, ...] = get_args(Motion)
SCHEMA, SECOND = "gtpin-dataset/1", "gtpin-dataset/2"
"""Of the poses of one tracker, and of several instruments."""
TomlFinite = Annotated[float, Field(allow_inf_nan=False)]
TomlPositive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
TomlName = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]
_DRIVER = {
    "column": 'write column = "NAME", a covariate of poses.csv',
    "site": 'write site = "NAME": a link, a joint, platform or frame',
    "motion": f"write motion = one of {', '.join(MOTIONS)}",
    "size": "write size = the typical motion over the column's range, m or rad, above 0",
}


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


class TomlSection(BaseModel):
    """A part of a dataset.toml: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class InstrumentSection(TomlSection):
    """The instrument that measured the poses.

    - `position_sigma`, `orientation_sigma`: standard deviation of its noise per axis, m and rad; None: it is estimated.
    - `frame`: `free` where the pose of the base frame in the instrument's frame is identified; `robot` where both are the same.
    - `target`: `free` where the target's pose on the platform is identified; `tcp` where the target is at the TCP.
    - `station`: the instrument's own position in its frame, m; None where it is not known.
    """

    position_sigma: TomlPositive | None = None
    orientation_sigma: TomlPositive | None = None
    frame: Literal["robot", "free"] = "robot"
    target: Literal["tcp", "free"] = "tcp"
    station: Annotated[tuple[TomlFinite, TomlFinite, TomlFinite], Field(strict=False)] | None = None


class Conditions(TomlSection):
    """The reference temperature, degC: the nominal geometry is valid at it, and thermal effects are zero."""

    reference_temperature: TomlFinite = 20.0


class DriverTable(TomlSection):
    """One `[[driver]]`: see :class:`~gtpin.data.description.Driver`."""

    column: TomlName
    site: TomlName
    motion: Motion
    size: TomlPositive


class Description(TomlSection):
    """The whole of dataset.toml.

    `tcp` is the link whose pose is measured; None: the robot's own TCP. `actuators` are the joints that q1 .. qn command;
    empty: the robot's own. `tolerance` has standard deviations by kind of parameter, m, rad or m/m.
    """

    schema_: Literal["gtpin-dataset/1"] = Field(alias="schema")
    robot: TomlName
    tcp: TomlName | None = None
    actuators: Annotated[tuple[TomlName, ...], Field(strict=False)] = ()
    instrument: InstrumentSection = InstrumentSection()
    conditions: Conditions = Conditions()
    tolerance: dict[TomlName, TomlPositive] = {}
    driver: Annotated[tuple[DriverTable, ...], Field(strict=False)] = ()


_SECTIONS: dict[str, type[TomlSection]] = {
    "": Description,
    "instrument": InstrumentSection,
    "conditions": Conditions,
    "driver": DriverTable,
}
_KEYS = {
    section: [field.alias or name for name, field in model.model_fields.items()] for section, model in _SECTIONS.items()
}


def describe(values: Mapping[str, object], file: Path | None = None) -> Description:
    """Check the content of a dataset.toml; raises `DatasetError` with the invalid key."""
    try:
        return Description.model_validate(values)
    except ValidationError as error:
        raise explained(file, error) from None


def read_toml(file: Path) -> dict[str, Any]:
    """Read a TOML file; raises `DatasetError` if it is not TOML, not UTF-8, or has control characters in names."""
    try:
        content = tomllib.loads(read_text(file))
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
    one = description.instrument
    values: dict[str, Any] = {
        "schema": SECOND if instruments else SCHEMA,
        "robot": description.robot,
        "tcp": description.tcp,
        "actuators": list(description.actuators),
        # A target at the TCP is the default.
        "instrument": one.model_dump(exclude_none=True, exclude={"target"} if one.target == "tcp" else None),
        "conditions": description.conditions.model_dump(),
        "tolerance": description.tolerance,
        "driver": [table.model_dump() for table in description.driver],
    }
    if instruments:
        del values["instrument"]
        values["instrument"] = list(instruments)
    text = tomli_w.dumps({key: value for key, value in values.items() if value not in ({}, [], None)})
    file.write_text(text, encoding="utf-8", newline="\n")


def explained(file: Path | None, error: ValidationError) -> DatasetError:
    """Turn the first of pydantic's errors into one line with a hint."""
    first = error.errors(include_url=False)[0]
    location = [str(part) for part in first["loc"] if part != "[key]"]
    column = ".".join(location)
    what, hint = _explanation(first["type"], location, first)
    return DatasetError(what, file=file, column=column, hint=hint)


def _explanation(kind: str, location: list[str], first: Any) -> tuple[str, str]:
    key, section = location[-1], location[0] if len(location) > 1 else ""
    if kind == "extra_forbidden":
        return "unknown key", _nearest(key, section)
    if kind == "missing":
        example = {
            "schema": f'write schema = "{SCHEMA}"',
            "robot": 'write robot = "NAME" or a path to a URDF',
            **_DRIVER,
        }
        return "the key is missing", example.get(key, "station needs three numbers")
    if key == "schema":
        hint = f'write schema = "{SCHEMA}", or "gtpin-dataset/2" for several instruments'
        return f"{first['input']!r} is not a schema that this version reads", hint
    hints = {
        "position_sigma": "1 sigma per axis in m, above 0; leave it out to have the noise estimated",
        "orientation_sigma": "1 sigma per axis in rad, above 0; leave it out to have the noise estimated",
        "frame": 'write "robot" or "free"',
        "target": 'write "free", or leave it out where the target is the TCP',
        "robot": "the name of a robot (gtpin robots lists them), or a path to a URDF or MJCF file",
        "tcp": 'write tcp = "LINK"',
        "reference_temperature": "a finite number, in degC",
    }
    if location[0] == "actuators":
        return f"{str(first['input'])[:60]} can't be", 'write actuators = ["JOINT", "JOINT", ...]'
    if location[0] == "driver":
        return f"{str(first['input'])[:60]!r} can't be", _DRIVER.get(key, "each driver is a table [[driver]]")
    if "station" in location:
        return f"{str(first['input'])[:60]} can't be", "station = [x, y, z], three finite numbers in m"
    if section == "tolerance":
        return f"{str(first['input'])[:60]} can't be", "a tolerance is 1 sigma, a finite number above 0"
    if key == "instrument" and isinstance(first["input"], list):
        return (
            "several instruments are of schema 2",
            'write schema = "gtpin-dataset/2", or [instrument] in single brackets',
        )
    if isinstance(first["input"], dict) or kind in ("model_type", "model_attributes_type", "dict_type"):
        return "of the wrong kind", hints.get(key, f"[{key}] is a section of its own")
    return f"{str(first['input'])[:60]!r} can't be", hints.get(key, "correct the value")


def _nearest(key: str, section: str) -> str:
    for other, keys in _KEYS.items():
        if other != section and key in keys:
            return f"it belongs under [{other}]" if other else "it belongs at the top, before any [section]"
    close = difflib.get_close_matches(key.lower(), _KEYS.get(section, []), n=1)
    if close:
        return f"did you mean {close[0]}?"
    return f"known here: {', '.join(_KEYS.get(section, []))}"
