"""Encoders: the coordinate of a joint that nothing drives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.data.instrument_tables import EncoderTable
from gtpin.errors import DatasetError, RobotError
from gtpin.instruments.instrument import Component, Instrument, Unknown
from gtpin.kinematics.poses import Poses
from gtpin.robot.chain import measured_joint
from gtpin.typing import Floats


class Encoder(Instrument):
    """The coordinate x of a passive joint, as in the URDF, plus the encoder's zero: z = x + zero, rad or m.

    Readings of a revolute joint are compared modulo one turn. Unknown: the zero (standard deviation of its prior:
    ``zero_sigma``; where that is 0, the zero is exact).
    """

    kind, Table = "encoder", EncoderTable
    table: EncoderTable

    def _unknowns(self) -> Sequence[Unknown]:
        try:
            self.turns = measured_joint(self.robot, self.table.joint).turns
        except RobotError as error:
            raise DatasetError(error.what, column="joint", hint=error.hint) from None
        unit = "rad" if self.turns else "m"
        self.components = (Component("reading", unit, initial_sigma=5e-5 if self.turns else 2e-5),)
        return self._identified([Unknown(f"{self.table.name}.zero", unit, 0.0, self.table.zero_sigma)])

    def predicted(self, poses: Poses, u: Floats) -> Floats:
        return np.asarray(poses.joints[self.table.joint][:, None] + u.sum())

    def residual_at(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1) measured less predicted, rad or m; for a revolute joint between -pi and pi."""
        residual = super().residual_at(poses, u)
        return np.asarray(residual - 2.0 * np.pi * np.round(residual / (2.0 * np.pi))) if self.turns else residual

    def by_pose(self, poses: Poses, u: Floats) -> Floats:
        """(M, 1, 6) zeros: given the joint's coordinate, the reading does not depend on the platform's pose."""
        return np.zeros((len(poses), 1, 6))

    def by_joints(self, poses: Poses, u: Floats) -> Floats:
        found = np.zeros((len(poses), 1, len(poses.joints)))
        found[:, :, list(poses.joints).index(self.table.joint)] = 1.0
        return found

    def by_unknown(self, poses: Poses, u: Floats) -> Floats:
        return np.ones((len(poses), 1, len(u)))

    def start(self, nominal: Poses) -> Floats:
        """(k,) first guess of the zero: for a revolute joint the circular mean of measured less predicted, else 0."""
        left = (self.measured() - self.predicted(nominal, np.zeros(1)))[:, 0]
        if not len(self.unknowns) or not self.turns or not len(left):
            return np.zeros(len(self.unknowns))
        return np.array([np.arctan2(np.sin(left).mean(), np.cos(left).mean())])
