"""mujoco.sysid's fit of a serial arm's geometry: placements of all bodies with joints, and of the tool. Names no cause.

    gtpin export ur5 -o ur5.xml
    pip install "mujoco[sysid]"
    python examples/benchmark/rivals/mujoco_sysid.py ur5.xml SET/cases ANSWERS/mujoco_sysid

mujoco.sysid estimates the parameters that its user chooses. Poses at rest are no trajectories, so the residual is computed
here (positions and orientations over their noise, by mj_kinematics), and ``mujoco.sysid.optimize`` minimises it within bounds.
Needs no gtpin.
"""

from __future__ import annotations

import csv
import json
import sys
import tomllib
from pathlib import Path

import mujoco
import numpy as np
from mujoco import sysid
from scipy.spatial.transform import Rotation

TCP = "tool0"
LARGEST = (0.01, 0.02)
"""Bounds of a placement's errors, m and rad."""
SIGMA = (1.5e-5, 5e-5)
"""Noise where the dataset does not declare it, m and rad."""


def table(file: Path) -> dict[str, np.ndarray]:
    """The numeric columns of a CSV file."""
    with file.open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    names = [name for name in rows[0] if name != "pose"]
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in names}


class Arm:
    """The kinematics of an MJCF arm with errors of its placements."""

    def __init__(self, file: Path) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.data = mujoco.MjData(self.model)
        self.tcp = self.model.body(TCP).id
        self.bodies = [*dict.fromkeys(int(body) for body in self.model.jnt_bodyid), self.tcp]
        self.pos, self.quat = self.model.body_pos.copy(), self.model.body_quat.copy()

    def poses(self, q: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) positions and (N, 3, 3) rotations of the TCP; x has six errors of each placement."""
        for body, error in zip(self.bodies, x.reshape(-1, 6), strict=True):
            nominal = Rotation.from_quat(self.quat[body], scalar_first=True)
            self.model.body_pos[body] = self.pos[body] + nominal.apply(error[:3])
            turned = nominal * Rotation.from_rotvec(error[3:])
            self.model.body_quat[body] = turned.as_quat(scalar_first=True)
        T, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        for i, row in enumerate(q):
            self.data.qpos[:] = row
            mujoco.mj_kinematics(self.model, self.data)
            T[i], R[i] = self.data.xpos[self.tcp], self.data.xmat[self.tcp].reshape(3, 3)
        return T, R


def answer(arm: Arm, case: Path) -> dict[str, object]:
    """The answer to one case."""
    said = tomllib.loads((case / "dataset.toml").read_text(encoding="utf-8"))["instrument"]
    sigma = said.get("position_sigma", SIGMA[0]), said.get("orientation_sigma", SIGMA[1])
    data, joints = table(case / "poses.csv"), arm.model.nq
    q = np.stack([data[f"q{i + 1}"] for i in range(joints)], axis=1)
    T = np.stack([data[name] for name in "xyz"], axis=1)
    turns = "qw" in data and bool(np.isfinite(data["qw"]).all())
    R = Rotation.from_quat(np.stack([data[f"q{c}"] for c in "wxyz"], axis=1), scalar_first=True) if turns else None
    bounds = np.tile(np.repeat(LARGEST, 3), len(arm.bodies))

    def residual(x: np.ndarray, _: object = None) -> list[np.ndarray]:
        """Whitened residuals for one vector of parameters, or for each column of several."""
        columns = []
        for column in np.atleast_2d(np.asarray(x).T):
            found, turned = arm.poses(q, column)
            parts = [((found - T) / sigma[0]).ravel()]
            if R is not None:
                parts.append(((R.inv() * Rotation.from_matrix(turned)).as_rotvec() / sigma[1]).ravel())
            columns.append(np.concatenate(parts))
        return [np.stack(columns, axis=1) if np.ndim(x) == 2 else columns[0]]

    params = sysid.ParameterDict({"placements": sysid.Parameter("placements", np.zeros(len(bounds)), -bounds, bounds)})
    first, _ = sysid.optimize(params, lambda x, _: (residual(x), None, None), verbose=False, max_iters=50)
    commands = table(case / "commands.csv")
    held = np.stack([commands[f"q{i + 1}"] for i in range(joints)], axis=1)
    return {"schema": "gtpin-answer/1", "positions": arm.poses(held, first.as_vector())[0].tolist()}


def main(mjcf: Path, cases: Path, answers: Path) -> None:
    answers.mkdir(parents=True, exist_ok=True)
    for case in sorted(cases.glob("ur5-tracker-*")):
        (answers / f"{case.name}.json").write_text(json.dumps(answer(Arm(mjcf), case)) + "\n", encoding="utf-8")
        print(case.name, flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit("give three paths: python mujoco_sysid.py MJCF SET/cases ANSWERS")
    main(*map(Path, sys.argv[1:4]))
