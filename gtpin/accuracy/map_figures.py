"""Maps of the workspace of any robot, as figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from gtpin.accuracy import figures
from gtpin.accuracy.chain_workspace import ChainWorkspace
from gtpin.accuracy.expected import Uncertainty, mean_length, response
from gtpin.accuracy.workspace import Workspace
from gtpin.model.model import Model
from gtpin.typing import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SINGULARITY = {False: "smallest singular value / at home", True: "smallest singular value / at the best posture"}
"""Title of the measure of singularity: False: for robots with rods; True: for chains."""


class Analysed(Protocol):
    """The parts of an analysis that maps need."""

    @property
    def model(self) -> Model:
        """The analysed model."""

    @property
    def uncertainty(self) -> Uncertainty:
        """The uncertainty that causes the expected errors."""

    @property
    def uncertain(self) -> str:
        """The source of this uncertainty, as text."""

    @property
    def space(self) -> Workspace | ChainWorkspace:
        """The reachable positions of the TCP."""


def map_figures(found: Analysed) -> dict[str, Figure]:
    """The maps of an analysis, by name, without orientations that never change and without values that are infinite everywhere.

    The condition number is infinite everywhere if the TCP is on the axis of a joint, whose command then does not move it.
    """
    return {
        f"map_{name}": figures.workspace_map(found.space, values, title, unit)
        for name, (values, unit, title) in _maps(found).items()
        if (name != "orientation" or not found.model.geometry.reduced) and np.isfinite(values).any()
    }


def _maps(found: Analysed) -> dict[str, tuple[Floats, str, str]]:
    space = found.space
    covariance = response(found.model, space.q, found.uncertainty).covariance
    position, orientation = mean_length(covariance[:, :3, :3]), mean_length(covariance[:, 3:, 3:])
    at = space.dexterity
    return {
        "position": (*_small(position, "m"), f"Expected position error ({found.uncertain})"),
        "orientation": (*_small(orientation, "rad"), f"Expected orientation error ({found.uncertain})"),
        "condition": (at.condition, "largest / smallest gain", "Condition number of TCP position by commands"),
        "singularity": (at.singularity, SINGULARITY[isinstance(space, ChainWorkspace)], "Distance from singularity"),
    }


def _small(values: Floats, unit: str) -> tuple[Floats, str]:
    """Values in mm or um (mrad or urad), depending on the largest value, and this unit."""
    return (1e3 * values, f"m{unit}") if values.max() >= 1e-3 else (1e6 * values, f"u{unit}")
