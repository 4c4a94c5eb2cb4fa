"""What a case hides: the effects that its machine has, and its true poses."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

Kind = Literal["one", "none", "unlisted", "two", "three", "known_and_unlisted", "rough", "power", "many"]
"""What sort of case it is: see ``docs/blind.md``."""
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Triple = tuple[Finite, Finite, Finite]
Six = tuple[Finite, Finite, Finite, Finite, Finite, Finite]


class Hidden(BaseModel):
    """An effect that a machine has.

    Parameters
    ----------
    effect, site
        What it is and where; an id that is in no catalogue where the cause is unknown.
    energy
        E: its whitened energy past geometry.
    leaves
        D: what the best wrong effect leaves of that, where whoever made the case says it.
    amplitude
        Its size over the typical one.
    displacement
        (N, 6) what it alone does at the dataset's rows: position, m, and rotation vector, rad, base frame.
    """

    model_config = ConfigDict(frozen=True)

    effect: Annotated[str, Field(min_length=1)]
    site: str = ""
    energy: Positive | None = None
    leaves: Positive | None = None
    amplitude: Finite | None = None
    displacement: tuple[Six, ...] | None = None

    @property
    def name(self) -> str:
        """``effect@site``."""
        return f"{self.effect}@{self.site}"


class TruePoses(BaseModel):
    """True poses at a case's ``commands.csv``: ids, positions (H, 3), m, and quaternions (H, 4), wxyz, where they are known."""

    model_config = ConfigDict(frozen=True)

    pose: tuple[str, ...]
    position: tuple[Triple, ...]
    orientation: tuple[tuple[Finite, Finite, Finite, Finite], ...] | None = None

    @property
    def T(self) -> npt.NDArray[np.float64]:
        """(H, 3) positions, m."""
        return np.array(self.position).reshape(-1, 3)


class Truth(BaseModel):
    """Everything that a case hides.

    Parameters
    ----------
    kind
        What sort of case it is.
    effects
        What the machine has; empty for none.
    poses
        True poses at the held-out commands, where they are known.
    sigma
        (6,) the instrument's noise, m and rad, by which energies are whitened; None where it is not known.
    """

    model_config = ConfigDict(frozen=True)

    kind: Kind
    effects: tuple[Hidden, ...]
    poses: TruePoses | None = None
    sigma: Six | None = None
