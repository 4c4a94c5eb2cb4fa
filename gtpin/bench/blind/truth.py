"""The truth of a case: the effects of its machine, and its true poses."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

Kind = Literal["one", "none", "unlisted", "two", "three", "known_and_unlisted", "rough", "power", "many"]
"""Kind of case: see ``docs/blind.md``."""
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Triple = tuple[Finite, Finite, Finite]
Six = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class TrueEffect(BaseModel):
    """A true effect of a machine."""

    model_config = ConfigDict(frozen=True)

    # `effect`, `site`: Its id and its site; the id of an unlisted effect is in no catalogue
    effect: Annotated[str, Field(min_length=1)]
    site: str = ""
    energy: Positive | None = None  # E: its whitened energy that geometry can't explain
    # D: the part of E that the best wrong effect leaves; None if the file does not give it
    leaves: Positive | None = None
    amplitude: Finite | None = None  # Its size relative to the typical size
    # (N, 6) TCP displacement by this effect alone at the dataset's rows: position, m, and rotation vector, rad, base
    # frame
    displacement: tuple[Six, ...] | None = None

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect}@{self.site}"


class TruePoses(BaseModel):
    """True poses at a case's ``commands.csv``: ids, positions (H, 3), m, and quaternions (H, 4), scalar first, if known."""

    model_config = ConfigDict(frozen=True)

    pose: tuple[str, ...]
    position: tuple[Triple, ...]
    orientation: tuple[tuple[Finite, Finite, Finite, Finite], ...] | None = None

    @property
    def T(self) -> npt.NDArray[np.float64]:
        """(H, 3) positions, m."""
        return np.array(self.position).reshape(-1, 3)


class TrueReadings(BaseModel):
    """What an instrument reads without noise at a case's ``commands-NAME.csv`` or, without this file, ``commands.csv``.

    Stations, planes or targets are assigned to the rows of ``commands.csv`` in turn, in alphabetical order of their ids; the
    predictions of the worker have the same assignment. The reading of a touch is the distance of the target from what it
    touches.
    """

    model_config = ConfigDict(frozen=True)

    name: str  # Name of the instrument
    # `values`, `sigma`: (H, c) readings and their noise, m or rad; for a tracker, positions
    values: tuple[tuple[Finite, ...], ...]
    sigma: tuple[tuple[Finite, ...], ...]


class TrueNoise(BaseModel):
    """The noise of an instrument's readings with which E is computed."""

    model_config = ConfigDict(frozen=True)

    name: str  # Name of the instrument
    # (M, c) sigma of every number in the rows of its table, with the scatter by the machine's repeatability, m or rad
    sigma: tuple[tuple[Finite, ...], ...]


class Truth(BaseModel):
    """The sealed truth of a case."""

    model_config = ConfigDict(frozen=True)

    kind: Kind  # Kind of case
    effects: tuple[TrueEffect, ...]  # True effects of the machine; can be empty
    poses: TruePoses | None = None  # True poses at the held-out commands, if known
    # True readings where other instruments than a tracker alone measured; ``poses`` is then None
    readings: tuple[TrueReadings, ...] = ()
    # (6,) the instrument's noise, m and rad, with which displacements are whitened; None if not known
    sigma: Six | None = None
    noise: tuple[TrueNoise, ...] = ()  # The same for instruments of schema 2, for each number; empty if not known

    @model_serializer(mode="wrap")
    def _without_empty_noise(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave the noise out where there is none: truths of a tracker's cases keep the digests that were published."""
        found: dict[str, Any] = handler(self)
        return found if self.noise else {name: value for name, value in found.items() if name != "noise"}
