"""An MJCF in MuJoCo, driven to commands and brought to rest."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

QUIET = 1e-7
"""m/s or rad/s below which every coordinate counts as at rest."""


class Rest:
    """A model in MuJoCo; ``load`` is a force on the TCP's body at the TCP, base frame, N."""

    def __init__(self, file: Path, tcp: str, load: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(file))
        self.data = mujoco.MjData(self.model)
        self.tcp = self.model.body(tcp).id
        self.load = np.array(load)

    def at(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and rotation (3, 3) of the TCP at rest at commands q (n,), reached from home."""
        model, data = self.model, self.data
        mujoco.mj_resetDataKeyframe(model, data, 0)
        home = data.ctrl.copy()
        for step in range(5000):
            data.ctrl[:] = home + min(1.0, (step + 1) / 150) * (q - home)
            mujoco.mj_kinematics(model, data)
            data.qfrc_applied[:] = 0.0
            if self.load.any():
                mujoco.mj_comPos(model, data)
                point = data.xpos[self.tcp]
                mujoco.mj_applyFT(model, data, self.load, np.zeros(3), point, self.tcp, data.qfrc_applied)
            mujoco.mj_step(model, data)
            if step > 180 and np.abs(data.qvel).max() < QUIET:
                mujoco.mj_kinematics(model, data)
                return data.xpos[self.tcp].copy(), data.xmat[self.tcp].reshape(3, 3).copy()
        raise AssertionError(f"not at rest at {q}: {np.abs(data.qvel).max():.2g}")

    def poses(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same for many commands (N, n)."""
        found = [self.at(row) for row in q]
        return np.array([T for T, _ in found]), np.array([R for _, R in found])
