"""The content of ``model.json``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field, ValidationError

from gtpin.data.files import read_text, refuse_control
from gtpin.errors import ModelError
from gtpin.model.effect_record import EffectRecord, Finite, Positive, Record, Triple
from gtpin.paper.geometry import Arm, Per

SCHEMA: Final = "gtpin-model/1"
AGAIN = "write the model again"


class FrameRecord(Record):
    """Pose of the base frame in the instrument's frame: its origin, m, and the rows of its rotation matrix."""

    position: Triple
    rotation: Annotated[list[Triple], Field(min_length=3, max_length=3)]


class TrackRecord(Record):
    """A measured track; see :class:`~gtpin.paper.tracks.MeasuredTrack`."""

    q: list[Finite]
    path: list[Triple]
    turns: list[Triple] | None
    origin: Triple


class InstrumentRecord(Record):
    """An instrument; see :class:`~gtpin.model.model.FittedInstrument`."""

    declared: dict[str, Any]
    columns: list[str]
    known: dict[str, list[str]]
    unknowns: dict[str, Finite]


class FitRecord(Record):
    """Noise, temperatures and ranges of a fit; see :class:`~gtpin.model.fit_conditions.FitConditions`."""

    position_sigma: Positive
    orientation_sigma: Positive
    drives: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    misfit: Annotated[float, Field(ge=1.0, allow_inf_nan=False)] = 1.0
    temp_frame: Finite | None = None
    temp_link: Finite | None = None
    lower: tuple[Finite, ...] = Field((), strict=False)
    upper: tuple[Finite, ...] = Field((), strict=False)


class UnexplainedRecord(Record):
    """What a fit left unexplained; see :class:`~gtpin.model.fit_conditions.ModelDiscrepancy`."""

    position: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    orientation: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    noise_known: bool
    least: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None
    most: Annotated[float, Field(ge=0.0, allow_inf_nan=False)] | None = None


class ModelFile(Record):
    """The whole of ``model.json``; docs/export.md explains the keys."""

    optional = (
        "target",
        "held",
        "widened",
        "joint_covariance",
        "between_members",
        "fit",
        "unexplained",
        "doubt",
    )  # older versions do not know them
    schema_: Literal["gtpin-model/1"] = Field(alias="schema")
    robot: str
    nominal_urdf: str
    tcp: str
    directions: Per
    scale: Per | None
    arm: Arm = "full"
    tracks: list[TrackRecord | None] = Field(default_factory=list)
    parameters: dict[str, Finite]
    tolerance: dict[str, Positive]
    widened: dict[str, Positive] = Field(default_factory=dict)
    target: list[Finite] | None = Field(default=None, min_length=6, max_length=6)
    held: dict[str, Finite] = Field(default_factory=dict)
    covariance: list[list[Finite]] | None = None
    joint_covariance: list[list[Finite]] | None = None
    between_members: list[list[Finite]] | None = None
    fit: FitRecord | None = None
    unexplained: UnexplainedRecord | None = None
    doubt: str = ""
    base_in_instrument: FrameRecord | None
    effects: list[EffectRecord] = Field(default_factory=list)
    instruments: list[InstrumentRecord] = Field(default_factory=list)


def read_model_file(file: Path) -> ModelFile:
    """Read a ``model.json``.

    Raises `ModelError` if the file can't be read, is not JSON, or has an invalid value; with the key of that value.
    """
    try:
        content = json.loads(read_text(file, ModelError, hint=AGAIN))
        refuse_control(content, file, ModelError)
        return ModelFile.model_validate(content)
    except json.JSONDecodeError as error:
        raise ModelError(f"no JSON ({error.msg})", file=file, row=error.lineno, hint=AGAIN) from None
    except ValidationError as error:
        raise explained(error, file) from None
    except (RecursionError, ValueError) as error:  # brackets nested a thousand deep, endless integers
        raise ModelError(f"no JSON that can be read ({str(error)[:80]})", file=file, hint=AGAIN) from None


def explained(error: ValidationError, file: Path, place: str = "") -> ModelError:
    """The first of pydantic's errors, with its key in the usual notation after ``place``: ``effects.0.coefficients.3``."""
    first = error.errors(include_url=False)[0]
    key = place + ".".join(str(part) for part in first["loc"])
    return ModelError(first["msg"], file=file, column=key, hint=AGAIN)
