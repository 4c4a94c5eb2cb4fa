"""Robots without rods: the effect of a small error of each joint's placement, and of the tool, on the TCP."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.stats import qmc

from gtpin.accuracy.analysis import SCHEMA
from gtpin.accuracy.expected import Error, ExpectedError, Uncertainty, expected_error
from gtpin.accuracy.rods import reached_poses
from gtpin.accuracy.steps import STEP
from gtpin.errors import ModelError
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.euler import well_defined, zyz_change
from gtpin.model.model import Model
from gtpin.output.json_text import json_text

if TYPE_CHECKING:
    import pandas as pd

Floats = npt.NDArray[np.float64]

PARAMETERS = ("x", "y", "z", "rx", "ry", "rz")
"""Placement of a joint in its parent, and of the TCP on its body, in their own axes: m and rad."""
POSES = 200
"""Commands where none are given."""


@dataclass(frozen=True)
class ChainSensitivity:
    """The sensitivity of a robot without rods.

    Parameters
    ----------
    model, q
        Of what, and at which (N, n) commands.
    links
        Names of the k joints, and ``platform``.
    position
        (6, k) ||T - T+|| + ||T - T-||, summed over the poses, m.
    rotation
        (6, k) absolute changes of the ZYZ Euler angles, likewise, rad; NaN where these are not well defined.
    expected
        The errors to expect.
    uncertain
        What was taken to be uncertain, in words.
    """

    model: Model
    q: Floats
    links: tuple[str, ...]
    position: Floats
    rotation: Floats
    expected: ExpectedError
    uncertain: str

    def to_table(self) -> pd.DataFrame:
        """The columns ``parameter link position_mm rotation_rad cost_m4``; the last has no values."""
        import pandas as pd

        return pd.DataFrame(
            {
                "parameter": np.repeat(PARAMETERS, len(self.links)),
                "link": np.tile(self.links, len(PARAMETERS)),
                "position_mm": 1e3 * self.position.ravel(),
                "rotation_rad": self.rotation.ravel(),
                "cost_m4": np.nan,
            }
        )

    def to_json(self) -> dict[str, Any]:
        """The content of accuracy.json, SI units: as of an :class:`~gtpin.accuracy.analysis.Accuracy`, without its maps."""
        return {
            "schema": SCHEMA,
            "robot": self.model.robot.name,
            "poses": len(self.q),
            "step": STEP,
            "uncertainty": self.uncertain,
            "expected": {
                "position": _error(self.expected.position),
                "orientation": None if self.expected.orientation is None else _error(self.expected.orientation),
            },
        }

    def write(self, folder: Path) -> None:
        """Write ``sensitivity.csv`` and ``accuracy.json`` into a new folder."""
        self.to_table().to_csv(folder / "sensitivity.csv", index=False, lineterminator="\n")
        (folder / "accuracy.json").write_text(json_text(self.to_json()), encoding="utf-8")


def chain_sensitivity(model: Model, q: Floats | None = None, *, seed: int = 0) -> ChainSensitivity:
    """Change every parameter of the geometry, one at a time, by a step of 5e-5 m or rad to both sides.

    Parameters
    ----------
    q
        (N, n) commands, m or rad; by default some that fill the joints' ranges.

    Raises
    ------
    ModelError
        If the robot has rods.
    UnreachableError
        If the commands can't be reached.
    """
    kinematics, geometry = model.kinematics, model.geometry
    if not isinstance(kinematics, ChainKinematics):
        raise ModelError(f"{model.robot.name} has rods", hint="use gtpin.accuracy.analysis.analyse")
    q = _commands(model, seed) if q is None else q
    poses = reached_poses(kinematics, q)
    names = {p.owner: model.robot.model.names[p.owner] for p in geometry.parameters if p.kind == "placement"}
    links = (*names.values(), "platform")
    position, rotation = np.full((6, len(links)), np.nan), np.full((6, len(links)), np.nan)
    defined = well_defined(poses.R)
    for column, parameter in enumerate(geometry.parameters):
        link = len(links) - 1 if parameter.kind == "platform" else list(names).index(parameter.owner)
        moved = []
        for sign in (1.0, -1.0):
            values = geometry.values.copy()
            values[column] += sign * STEP
            moved.append(reached_poses(ChainKinematics(geometry.with_values(values)), q))
        row = parameter.component
        position[row, link] = sum(np.linalg.norm(there.T - poses.T, axis=1).sum() for there in moved)
        if defined:
            rotation[row, link] = sum(np.abs(zyz_change(there.R, poses.R)).sum() for there in moved)
    calibrated = model.covariance is not None
    uncertain = "covariance of the calibration" if calibrated else "manufacturing tolerances"
    covariance = model.covariance if calibrated else np.diag(geometry.tolerance**2)
    expected = expected_error(model, q, Uncertainty(covariance), seed=seed)
    return ChainSensitivity(model, q, links, position, rotation, expected, uncertain)


def _commands(model: Model, seed: int) -> Floats:
    """(N, n) commands that fill the joints' ranges, or a turn where there is no end to them."""
    robot = model.robot
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    q = lower + (upper - lower) * qmc.Halton(robot.n_actuators, rng=seed).random(POSES)
    return np.asarray(q[model.kinematics.forward(q).reached])


def _error(error: Error) -> dict[str, float]:
    return {"mean": error.mean, "p95": error.p95, "maximum": error.maximum}
