"""FIGAROH's geometric calibration of a serial arm (full parameters, Levenberg-Marquardt). Names no cause.

    gtpin export ur5 -o ur5.urdf
    pip install figaroh
    python examples/benchmark/rivals/figaroh_fit.py ur5.urdf SET/cases ANSWERS/figaroh

Positions and orientations are weighted by the instrument's noise. Needs no gtpin.
"""

from __future__ import annotations

import csv
import json
import logging
import sys
import tempfile
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pinocchio as pin
import yaml
from figaroh.calibration.base_calibration import BaseCalibration
from figaroh.calibration.calibration_tools import calc_updated_fkm

SIGMA = (1.5e-5, 5e-5)
"""Noise where the dataset does not declare it, m and rad."""
OUTLIER = 0.002
"""Position error, m, above which FIGAROH leaves a pose out and fits again: a gross error."""


class Calibration(BaseCalibration):
    """FIGAROH's calibration with the noise of the instrument as weights."""

    weights = (1.0 / SIGMA[0], 1.0 / SIGMA[1])

    def cost_function(self, var: np.ndarray) -> np.ndarray:
        """Weighted residuals."""
        poses = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        raw = self._compute_logmap_residuals(self.PEE_measured, poses)
        return self.apply_measurement_weighting(raw, pos_weight=self.weights[0], orient_weight=self.weights[1])


def settings(joints: list[str], file: Path, poses: int, turns: bool) -> dict[str, object]:
    """FIGAROH's unified configuration."""
    marker = {
        "name": "target",
        "reference_joint": joints[-1],
        "measurable_dof": [True] * 3 + [turns] * 3,
        "sensor_type": "mocap",
    }
    calibration = {
        "enabled": True,
        "parameters": {
            "calibration_level": "full_params",
            "include_non_geometric": False,
            "outlier_threshold": OUTLIER,
        },
        "kinematics": {"base_frame": "universe", "tool_frame": "wrist_3_link"},
        "measurements": {"markers": [marker], "poses": {"base_pose": [0.0] * 6, "tool_pose": [0.0] * 6}},
        "data": {"source_file": str(file), "number_of_samples": poses},
    }
    return {
        "robot": {"name": "arm", "properties": {"joints": {"active_joints": joints}}},
        "tasks": {"calibration": calibration},
    }


def table(file: Path) -> dict[str, np.ndarray]:
    """The numeric columns of a CSV file."""
    with file.open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    names = [name for name in rows[0] if name != "pose"]
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in names}


def answer(urdf: Path, case: Path) -> dict[str, object]:
    """The answer to one case."""
    said = tomllib.loads((case / "dataset.toml").read_text(encoding="utf-8"))["instrument"]
    robot = pin.RobotWrapper(pin.buildModelFromUrdf(str(urdf)))  # without meshes
    joints = [name for name in robot.model.names if name != "universe"]
    data = table(case / "poses.csv")
    columns = {f"{name}1": data[name] for name in "xyz"}
    turns = "qw" in data and bool(np.isfinite(data["qw"]).all())
    if turns:
        quaternions = np.stack([data[f"q{c}"] for c in "xyzw"], axis=1)
        angles = np.array([pin.rpy.matrixToRpy(pin.Quaternion(row).normalized().matrix()) for row in quaternions])
        columns |= {f"phi{axis}1": angles[:, i] for i, axis in enumerate("xyz")}
    columns |= {name: data[f"q{i + 1}"] for i, name in enumerate(joints)}
    with tempfile.TemporaryDirectory() as place:
        source, config = Path(place) / "poses.csv", Path(place) / "config.yaml"
        pd.DataFrame(columns).to_csv(source, index=False, float_format="%.12g")
        config.write_text(yaml.safe_dump(settings(joints, source, len(data["x"]), turns)), encoding="utf-8")
        fit = Calibration(robot, str(config))
        fit.weights = (
            1.0 / said.get("position_sigma", SIGMA[0]),
            1.0 / said.get("orientation_sigma", SIGMA[1]),
        )
        fit.calib_config |= {"known_baseframe": False, "known_tipframe": False}
        fit.initialize()
        fit.solve(enable_logging=False)
    commands = table(case / "commands.csv")
    held = np.stack([commands[f"q{i + 1}"] for i in range(len(joints))], axis=1)
    predicted = calc_updated_fkm(fit.model, fit.data, fit.var_, held, {**fit.calib_config, "NbSample": len(held)})
    return {"schema": "gtpin-answer/1", "positions": predicted.reshape(-1, len(held))[:3].T.tolist()}


def main(urdf: Path, cases: Path, answers: Path) -> None:
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    answers.mkdir(parents=True, exist_ok=True)
    for case in sorted(cases.glob("ur5-tracker-*")):
        try:
            found = answer(urdf, case)
        except Exception as error:  # whatever FIGAROH raises: no answer, which counts as wrong
            print(f"{case.name}: {type(error).__name__}: {error}", flush=True)
            continue
        (answers / f"{case.name}.json").write_text(json.dumps(found) + "\n", encoding="utf-8")
        print(case.name, flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit("give three paths: python figaroh_fit.py URDF SET/cases ANSWERS")
    main(*map(Path, sys.argv[1:4]))
