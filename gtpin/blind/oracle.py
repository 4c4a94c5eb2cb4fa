"""Oracle baseline: a fit to which the true causes are given, each with its best scale and nonlinear parameter.

Both fit the true displacement best.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gtpin.blind.difficulty import Best
from gtpin.calibration.problem import measured_poses
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Situation
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]


def fit_known_causes(dataset: Dataset, baseline: Calibration, causes: Sequence[Best]) -> Model:
    """Fit geometry and the given causes together, in one Gauss-Newton step from a calibration in the robot's frame.

    Prior sigmas are the tolerances for the geometry, and for a cause's coefficients their typical sizes times its scale.
    """
    kept = dataset.take(baseline.used(dataset))
    model = baseline.model
    kinematics, geometry = model.kinematics, model.geometry
    poses = kinematics.forward(kept.q)
    at = Situation(kinematics, kept.q, poses, kept.covariates, None, kept.conditions.reference_temperature)
    measured = measured_poses(kept)
    whitening = baseline.noise.whitening(at.command_jacobian, measured.components)

    def whitened(columns: Floats) -> Floats:
        return np.asarray(whitening @ columns[:, : measured.components]).reshape(-1, columns.shape[2])

    bases = [cause.effect.basis_of(at, cause.site, cause.values) for cause in causes]
    sizes = [basis.sigma * cause.scale for basis, cause in zip(bases, causes, strict=True)]
    B = whitened(kinematics.geometry_jacobian(kept.q, poses) * geometry.tolerance)
    J = np.hstack([B, *(whitened(basis.displacement(at) * size) for basis, size in zip(bases, sizes, strict=True))])
    left = whitened(measured.minus(poses)[:, :, None])[:, 0]
    now = np.zeros(J.shape[1])
    now[: B.shape[1]] = geometry.deviation / geometry.tolerance
    covariance = np.linalg.inv(J.T @ J + np.eye(J.shape[1]))
    step = covariance @ (J.T @ left - now)
    moved = geometry.with_values(geometry.values + geometry.tolerance * step[: B.shape[1]])
    active, place = [], B.shape[1]
    for cause, size in zip(causes, sizes, strict=True):
        own = slice(place, place := place + len(size))
        uncertain = covariance[own, own] * np.outer(size, size)
        active.append(
            ActiveEffect(
                cause.effect, cause.site, cause.nonlinear, step[own] * size, uncertain, at.references, cause.further
            )
        )
    return Model(moved, model.frame, tuple(active))
