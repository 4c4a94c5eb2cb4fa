"""Robots without rods: the effect of a small error of each joint's placement, and of the tool, on the TCP."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.accuracy import figures
from gtpin.accuracy.analysis import SCHEMA, range_json
from gtpin.accuracy.chain_workspace import ChainWorkspace, chain_commands, chain_dexterity, chain_workspace
from gtpin.accuracy.expected import Error, ExpectedError, Uncertainty, expected_error
from gtpin.accuracy.map_figures import map_figures
from gtpin.accuracy.rods import reached_poses
from gtpin.accuracy.steps import STEP
from gtpin.errors import ModelError
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.euler import well_defined, zyz_change
from gtpin.model.model import Model
from gtpin.output.figure import write_figures
from gtpin.output.json_text import json_text
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


PARAMETERS = ("x", "y", "z", "rx", "ry", "rz")
"""Components of a placement, of a joint on its parent or of the TCP on its body: translation, m, and rotation, rad, own
axes."""
POSES = 200
"""Number of commands where none are given."""


@dataclass(frozen=True)
class ChainSensitivity:
    """The sensitivity of a robot without rods.

    Parameters
    ----------
    model, q
        The model, and the (N, n) commands, m or rad, at which it was analysed.
    links
        Names of the k joints, and ``platform``.
    position
        (6, k) ||T - T+|| + ||T - T-||, summed over the poses, m, with T+ and T- the TCP's positions after a step to each side.
    rotation
        (6, k) absolute changes of the three ZYZ Euler angles, summed over both steps and all poses, rad; NaN where these angles
        are not well defined.
    expected
        The errors to expect.
    uncertainty, uncertain
        The uncertainty that causes the expected errors, and its source as text.
    seed
        Seed of the random postures and machines.
    """

    model: Model
    q: Floats
    links: tuple[str, ...]
    position: Floats
    rotation: Floats
    expected: ExpectedError
    uncertainty: Uncertainty
    uncertain: str
    seed: int = 0

    @cached_property
    def space(self) -> ChainWorkspace:
        """The reachable positions of the TCP, from postures that fill the joints' ranges."""
        return chain_workspace(self.model, self.seed)

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
        """The content of accuracy.json, SI units: that of an ``Accuracy`` without ``zyz_range``."""
        measures = asdict(chain_dexterity(self.model, self.q, self.model.kinematics.forward(self.q)))
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
            "dexterity": {name: range_json(values) for name, values in measures.items()},
        }

    def write(self, folder: Path) -> None:
        """Write ``sensitivity.csv``, ``accuracy.json`` and figures into a new folder."""
        self.to_table().to_csv(folder / "sensitivity.csv", index=False, lineterminator="\n")
        (folder / "accuracy.json").write_text(json_text(self.to_json()), encoding="utf-8")
        write_figures(self._figures, folder)

    def _figures(self) -> dict[str, Figure]:
        blocks = {"position": self.position, "rotation": self.rotation}
        bars = figures.bars(blocks, PARAMETERS, self.links, STEP, len(self.q), "rad for rotations")
        return {"sensitivity": bars, **map_figures(self)}


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
    q = chain_commands(model, POSES, seed) if q is None else q
    poses = reached_poses(kinematics, q)
    places = [p.name.rpartition(".")[0] for p in geometry.parameters]
    labels = [place.removeprefix("placement[").removeprefix("anchor[").removesuffix("]") for place in places]
    links = tuple(dict.fromkeys(labels))
    position, rotation = np.full((6, len(links)), np.nan), np.full((6, len(links)), np.nan)
    defined = well_defined(poses.R)
    for column, parameter in enumerate(geometry.parameters):
        link = links.index(labels[column])
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
    uncertainty = Uncertainty(covariance)
    expected = expected_error(model, q, uncertainty, seed=seed)
    return ChainSensitivity(model, q, links, position, rotation, expected, uncertainty, uncertain, seed)


def _error(error: Error) -> dict[str, float]:
    return {"mean": error.mean, "p95": error.p95, "maximum": error.maximum}
