"""Unknowns of instruments fitted to given poses: their first guess for a fit, and for comparisons with the nominal robot."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.problem import FRAME_UNIT
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses

STEPS = 12
"""Largest number of Gauss-Newton steps."""
FARTHEST = 1e3
"""Largest deviation of unknowns, m and rad: readings that need more are not a robot's, and are compared at this limit."""


def with_unknowns(readings: Readings, poses: Poses) -> Readings:
    """The readings with the unknowns' values that fit best at given poses (N), base frame; gross errors have little weight."""
    if not len(readings.u):
        return readings
    sigma = readings.sigma
    unit, prior = np.where(np.isfinite(sigma), sigma, FRAME_UNIT), np.isfinite(sigma).astype(float)
    each = np.where(np.isfinite(readings.row_sigma), readings.row_sigma, readings.usual[readings.group])
    # The nominal geometry has errors of the size of its tolerances, about 1 mm and 1 mrad. With the instruments' noise alone,
    # the unknowns would compensate these errors.
    each = np.hypot(each, 1e-3)
    start = readings.u
    for _ in range(STEPS):
        left = readings.minus(poses) / each
        weight = 1.0 / np.maximum(np.abs(left) / max(float(np.median(np.abs(left))), 1e-9) / 3.0, 1.0)
        J = (readings.by_unknown(poses) * unit / each[:, :, None] * np.sqrt(weight)[:, :, None]).reshape(-1, len(unit))
        x = np.where(np.isfinite(sigma), readings.u / unit, 0.0)
        normal = J.T @ J + np.diag(prior) + 1e-12 * np.eye(len(unit))
        step = np.linalg.solve(normal, J.T @ (left * np.sqrt(weight)).ravel() - prior * x)
        now = readings.u + unit * step
        far = ~(np.abs(now - start) <= FARTHEST)
        readings = readings.at(np.where(far, readings.u, now))
        if np.abs(step).max() < 1e-6:
            break
    return readings
