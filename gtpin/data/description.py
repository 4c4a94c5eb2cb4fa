"""The content of dataset.toml: robot, instrument, conditions, tolerances."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from gtpin.data.files import read_bytes
from gtpin.errors import DatasetError

SCHEMA = "gtpin-dataset/1"

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_Name = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Instrument(_Section):
    """What measured the poses, and in which frame.

    Sigmas are per axis, m and rad, None where they are to be estimated; `station` is where it stands, m. A `frame` or a
    `target` that is free is identified: where the robot's base is in the instrument's frame, and where the target sits on the
    platform.
    """

    position_sigma: _Positive | None = None
    orientation_sigma: _Positive | None = None
    frame: Literal["robot", "free"] = "robot"
    target: Literal["tcp", "free"] = "tcp"
    station: Annotated[tuple[_Finite, _Finite, _Finite], Field(strict=False)] | None = None


class Conditions(_Section):
    """What the commands and the nominal geometry refer to: the temperature in degC."""

    reference_temperature: _Finite = 20.0


class Description(_Section):
    """The whole of dataset.toml; `tolerance` holds 1-sigma tolerances by kind of parameter."""

    schema_: Literal["gtpin-dataset/1"] = Field(alias="schema")
    robot: _Name
    instrument: Instrument = Instrument()
    conditions: Conditions = Conditions()
    tolerance: dict[_Name, _Positive] = {}


_SECTIONS: dict[str, type[_Section]] = {"": Description, "instrument": Instrument, "conditions": Conditions}
_KEYS = {
    section: [field.alias or name for name, field in model.model_fields.items()] for section, model in _SECTIONS.items()
}


def describe(values: Mapping[str, object], file: Path | None = None) -> Description:
    """Check the content of a dataset.toml; raises `DatasetError` with the invalid key."""
    try:
        return Description.model_validate(values)
    except ValidationError as error:
        raise _explained(file, error) from None


def read_description(file: Path) -> Description:
    """Read a dataset.toml; raises `DatasetError` if it is not TOML, not UTF-8, or has an invalid value."""
    try:
        return describe(tomllib.loads(read_bytes(file).decode("utf-8-sig")), file)
    except UnicodeDecodeError:
        raise DatasetError("the file is not UTF-8", file=file, hint="save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        line = re.search(r"at line (\d+)", str(error))
        what = f"not TOML: {re.sub(r' *[(]at .*[)]$', '', str(error))}"
        raise DatasetError(what, file=file, row=int(line[1]) if line else None, hint="correct the line") from None
    except (RecursionError, ValueError) as error:
        # tomllib gives up on brackets nested a thousand deep and on impossible dates or endless integers.
        raise DatasetError(f"not TOML that can be read ({str(error)[:80]})", file=file) from None


def write_description(file: Path, description: Description) -> None:
    """Write a dataset.toml from which `read_description` gives the same again; unknown values are omitted."""
    values = {
        "schema": SCHEMA,
        "robot": description.robot,
        "instrument": _written(description.instrument),
        "conditions": description.conditions.model_dump(),
        "tolerance": description.tolerance,
    }
    text = tomli_w.dumps({key: value for key, value in values.items() if value != {}})
    file.write_text(text, encoding="utf-8", newline="\n")


def _written(instrument: Instrument) -> dict[str, Any]:
    """The keys of [instrument], without the target where it is at the TCP, which needs no saying."""
    return instrument.model_dump(exclude_none=True, exclude={"target"} if instrument.target == "tcp" else None)


def _explained(file: Path | None, error: ValidationError) -> DatasetError:
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
        example = {"schema": f'write schema = "{SCHEMA}"', "robot": 'write robot = "NAME" or a path to a URDF'}
        return "the key is missing", example.get(key, "station needs three numbers")
    if key == "schema":
        return f"{first['input']!r} is not a schema that this version reads", f'write schema = "{SCHEMA}"'
    hints = {
        "position_sigma": "1 sigma per axis in m, above 0; leave it out to have the noise estimated",
        "orientation_sigma": "1 sigma per axis in rad, above 0; leave it out to have the noise estimated",
        "frame": 'write "robot" or "free"',
        "robot": "the name of a robot that gtpin ships, or a path to a URDF",
        "reference_temperature": "a finite number, in degC",
    }
    if "station" in location:
        return f"{str(first['input'])[:60]} can't be", "station = [x, y, z], three finite numbers in m"
    if section == "tolerance":
        return f"{str(first['input'])[:60]} can't be", "a tolerance is 1 sigma, a finite number above 0"
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
