"""The commands for which a certificate holds: those between the measured ones."""

from __future__ import annotations

import numpy as np

from gtpin.certificate.response import At
from gtpin.data import Dataset
from gtpin.errors import UnreachableError
from gtpin.model.model import Model

POSES = 200
"""Number of poses over which the budget is averaged."""
TRIES = 20
"""Number of pairs of measured commands that are tried for each of these poses."""


def between(dataset: Dataset, model: Model, rng: np.random.Generator, count: int = POSES) -> At:
    """``count`` commands drawn on straight lines between two measured commands, each with the covariates of a measured row.

    They are in the convex hull of the measured commands, so that the certificate does not extrapolate.

    Raises
    ------
    UnreachableError
        If the model reaches none of them.
    """
    tried = count * TRIES
    one, two = rng.integers(0, len(dataset), (2, tried))
    w = rng.random((tried, 1))
    q = w * dataset.q[one] + (1.0 - w) * dataset.q[two]
    poses = model.kinematics.forward(q[:count])
    if not poses.reached.all():
        poses = model.kinematics.forward(q)
    kept = np.flatnonzero(poses.reached)[:count]
    if not len(kept):
        raise UnreachableError("no pose between the measured ones can be reached", hint="check the model")
    q = q[kept]
    rows = rng.integers(0, len(dataset), len(q))
    return At(q, {name: values[rows] for name, values in dataset.covariates.items()}, poses[kept])
