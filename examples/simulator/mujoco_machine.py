"""A file of `gtpin export` in MuJoCo: driven to commands from a direction, brought to rest, and read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

import gtpin

QUIET = 1e-7
"""m/s or rad/s below which every coordinate counts as at rest."""
BACK = 2e-3
"""m or rad in front of a command from which it is approached."""
THERE, NEAR, PATIENCE = 400, 300, 12000
"""Steps of the way from home, of the approach, and of all."""
SIZES = (6, 3, 1, 1)
"""Freedoms of MuJoCo's joints, by type."""


class MujocoMachine:
    """A machine in MuJoCo, from an MJCF that ``gtpin export`` wrote; ``limits``: whether joints and commands have ranges."""

    def __init__(self, file: Path | str, tcp: str, *, limits: bool = True) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(file))
        if not limits:
            self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL | mujoco.mjtDisableBit.mjDSBL_LIMIT
        self.data = mujoco.MjData(self.model)
        self.tcp = self.model.body(tcp).id
        # Cranks turn by tens of radians for a metre: the joint that turns them says whether they are at rest.
        joints = [self.model.joint(i) for i in range(self.model.njnt)]
        self.watched = np.concatenate(
            [np.arange(j.dofadr[0], j.dofadr[0] + SIZES[j.type[0]]) for j in joints if "_crank_" not in j.name]
        )

    def poses(self, q: np.ndarray, covariates: Mapping[str, np.ndarray]) -> gtpin.Poses:
        """Poses of the TCP at rest at commands q (N, n), m or rad, each reached from home.

        Of the covariates, ``approach1..n`` are the directions from which commands are reached, and ``payload``, kg, and ``fx fy
        fz``, N, act on the TCP.
        """
        none = np.zeros(len(q))
        approach = np.column_stack([covariates.get(f"approach{i + 1}", none) for i in range(q.shape[1])])
        force = np.column_stack([covariates.get(name, none) for name in ("fx", "fy", "fz")])
        force = force + np.outer(covariates.get("payload", none), self.model.opt.gravity)
        found = [self._one(*row) for row in zip(q, approach, force, strict=True)]
        return gtpin.Poses(np.array([T for T, _ in found]), np.array([R for _, R in found]))

    def _one(self, q: np.ndarray, approach: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        model, data = self.model, self.data
        mujoco.mj_resetDataKeyframe(model, data, 0)
        home, before = data.ctrl.copy(), q - BACK * approach
        at = np.arange(THERE + NEAR + 1)[:, None]
        way = home + _smooth(at / THERE) * (before - home) + _smooth((at - THERE) / NEAR) * (q - before)
        loaded = force.any()
        for step in range(PATIENCE):
            if step < len(way):
                data.ctrl[:] = way[step]
            if loaded:
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                data.qfrc_applied[:] = 0.0
                mujoco.mj_applyFT(model, data, force, np.zeros(3), data.xpos[self.tcp], self.tcp, data.qfrc_applied)
            mujoco.mj_step(model, data)
            if step > THERE + NEAR + 20 and np.abs(data.qvel[self.watched]).max() < QUIET:
                break
        else:
            raise RuntimeError(f"not at rest at {q}: {np.abs(data.qvel).max():.2g}")
        mujoco.mj_kinematics(model, data)
        return data.xpos[self.tcp].copy(), data.xmat[self.tcp].reshape(3, 3).copy()


def _smooth(share: np.ndarray) -> np.ndarray:
    """From 0 to 1, starting and ending without a speed."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(share, 0.0, 1.0))
