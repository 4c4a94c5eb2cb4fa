"""The paper's tables, as printed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Measurement:
    """What was measured (Sections I and III-B): counts, ranges in m, and what names say in um and degrees.

    Parameters
    ----------
    tcp_poses, layers
        Set 1: the TCP on a grid.
    calibration_poses
        Of set 1, within the actuator range; as many again were kept for validation.
    cart_points, random_poses
        Sets 2 (per cart) and 3.
    actuator_range
        Commands, m, at which set 2 covers the tracks.
    repeatability_mean_um, repeatability_max_um
        Of the TCP.
    cart2_residual_um
        Linearity residuals of cart 2, smallest and largest of what the text names.
    orientation_range_deg
        Smallest (alpha) and largest (beta) range of the ZYZ Euler angles over the grid.
    """

    tcp_poses: int
    layers: int
    calibration_poses: int
    cart_points: int
    random_poses: int
    actuator_range: tuple[float, float]
    repeatability_mean_um: float
    repeatability_max_um: float
    cart2_residual_um: tuple[float, float]
    orientation_range_deg: Mapping[str, float]


@dataclass(frozen=True)
class Calibrated:
    """Table II: one model's parameters.

    Parameters
    ----------
    links
        The k closures, each a link, or a cluster of links in the reduced arm of models 1 and 2.
    length
        (k,) m.
    offset
        (k, 3) m: joints on the carts at zero, base frame; for models 2 and 4 a transformation between tracker frames.
    cost
        (k,) sum over the calibration poses of the squared closure residual, m^4.
    direction
        (k, 3) track directions, base frame, norms as printed; None for models 2 and 4.
    orientation
        (k, 3) ZYX Euler angles of the transformation, degrees; None for models 1 and 3.
    platform_joint
        (k, 3) joints on the plate, TCP frame, m; None for models 1 and 2.
    """

    links: tuple[str, ...]
    length: Floats
    offset: Floats
    cost: Floats
    direction: Floats | None
    orientation: Floats | None
    platform_joint: Floats | None


@dataclass(frozen=True)
class Tables:
    """Everything that the paper prints.

    Parameters
    ----------
    links
        The k links, in the order of all columns.
    measurement
        Facts about the measurements.
    mean_um, max_um
        (5,) Table I: absolute positioning error of models 1 to 5, micrometres.
    calibrated
        Table II by model, 1 to 4.
    source
        (k,) the model, 3 or 4, that model 5 takes each link from.
    position_mm, rotation_rad, cost_m4
        Table III by parameter, (k,) each: summed over 61 poses and both signs of a step of 5e-5.
    """

    links: tuple[str, ...]
    measurement: Measurement
    mean_um: Floats
    max_um: Floats
    calibrated: Mapping[int, Calibrated]
    source: tuple[int, ...]
    position_mm: Mapping[str, Floats]
    rotation_rad: Mapping[str, Floats]
    cost_m4: Mapping[str, Floats]

    def costs(self, model: int) -> Floats:
        """(k,) final cost of each closure of a model, 1 to 5, m^4."""
        if model != 5:
            return self.calibrated[model].cost
        return np.array([self.calibrated[source].cost[i] for i, source in enumerate(self.source)])

    def closure_sigmas(self, model: int) -> Floats:
        """(k,) root mean square of each closure's residual \\|d\\|^2 - L^2 of a model, 1 to 5, m^2."""
        return np.asarray(np.sqrt(self.costs(model) / self.measurement.calibration_poses))

    @property
    def direction_excess(self) -> Floats:
        """(k,) norms of the track directions of model 3, less one: drive scale that the direction has taken in."""
        direction = self.calibrated[3].direction
        assert direction is not None
        return np.asarray(np.linalg.norm(direction, axis=1) - 1.0)


@cache
def tables() -> Tables:
    """Read the paper's tables, which stand beside this file."""
    told = tomllib.loads(Path(__file__).with_name("paper_tables.toml").read_text(encoding="utf-8"))
    table2, table3, facts = told["table2"], told["table3"], told["measurement"]
    return Tables(
        links=tuple(told["links"]),
        measurement=Measurement(
            **facts | {name: tuple(facts[name]) for name in ("actuator_range", "cart2_residual_um")}
        ),
        mean_um=_frozen(told["table1"]["mean_um"]),
        max_um=_frozen(told["table1"]["max_um"]),
        calibrated={model: _calibrated(table2[f"model{model}"]) for model in (1, 2, 3, 4)},
        source=tuple(table2["model5"]["source"]),
        position_mm=_rows(table3["position_mm"]),
        rotation_rad=_rows(table3["rotation_rad"]),
        cost_m4=_rows(table3["cost_m4"]),
    )


def _calibrated(told: Mapping[str, Any]) -> Calibrated:
    names = ("length", "offset", "cost", "direction", "orientation", "platform_joint")
    arrays = {name: _frozen(told[name]) if name in told else None for name in names}
    return Calibrated(links=tuple(told["links"]), **arrays)  # type: ignore[arg-type]


def _rows(told: Mapping[str, Any]) -> dict[str, Floats]:
    return {name: _frozen(values) for name, values in told.items()}


def _frozen(values: Any) -> Floats:
    array = np.array(values, dtype=float)
    array.flags.writeable = False
    return array
