"""Orientations that a calibration fits far better when they are read by another convention."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.calibration.checks.readings import misread, rotation_readings
from gtpin.calibration.checks.recognise import either
from gtpin.calibration.checks.suspected import refuse, suspect
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.problem import Point, Problem
from gtpin.data import Dataset
from gtpin.data.names import ORIENTATION
from gtpin.errors import DatasetError
from gtpin.kinematics.poses import Poses
from gtpin.typing import Floats

ROWS = 150
"""Number of poses that are enough for the decision. Assumed."""
LEFT, GAIN = 0.8, 60.0
"""Share of the squared orientation residuals that another convention may leave, and the least by which it lowers them: a
factor of exp(30) in likelihood, over some 150 readings. A convention has no free parameter: with residuals of effects, no
other convention left less than 0.96 (80 fits of 40 machines of the plant); a runout in one of 200 sealed cases left 0.77."""
CERTAIN = 0.1
"""Share of the squared orientation residuals that another convention leaves where it is certain, whatever noise is declared. By
the same study no effect is so much like a convention."""
AS_GOOD = 1.5
"""Ratio of its squared residuals to the smallest up to which a convention counts as equally good. Assumed."""
LEAST = 20
"""Number of poses below which nothing is reported. Assumed."""


def check_convention(dataset: Dataset, fit: Fit[Problem], sigmas: Floats) -> None:
    """Suspect orientations that fit far better when they are read by another convention of rotations.

    ``dataset``: the rows of the fit, used or not. ``sigmas`` (2,): the noise of the fit, m and rad.

    For small angles two conventions give nearly the same rotation: the difference grows with the square of the angle, and a fit
    absorbs a part of it. Therefore the residuals of a convention are those after a linearised fit to the orientations read by
    it: r - J dx, with dx from the normal equations with the tolerances as priors.
    """
    measured = fit.problem.poses
    # About one axis conventions differ only in how they scale noise about other axes.
    if measured.R is None or len(measured.T) < LEAST or measured.q.shape[1] == 1:
        return
    rows = np.linspace(0, len(measured.T) - 1, min(len(measured.T), ROWS)).astype(int)
    some = measured.take(rows)
    assert some.R is not None
    point = fit.point
    predicted = point.model.in_instrument_frame(point.poses[rows])
    problem = fit.problem.take(rows, fit.problem.whitening[rows])
    J = problem.jacobian(Point(point.x, point.model, point.poses[rows]), slice(None))
    weight = np.repeat(np.sqrt(fit.weight[rows]), 6)
    A = J.reshape(-1, J.shape[2]) * weight[:, None]
    solve = np.linalg.solve(A.T @ A + np.diag(problem.prior), A.T)

    rotation = Rotation.from_matrix(some.R)
    as_is, *other_axes = rotation_readings(rotation, turned=True)
    readings = [as_is, *misread(rotation), *other_axes]
    count = len(readings)
    read = Poses(np.tile(some.T, (count, 1)), np.concatenate([reading.R for reading in readings]))
    difference = read.minus(Poses(np.tile(predicted.T, (count, 1)), np.tile(predicted.R, (count, 1, 1))))
    r = np.einsum("nij,knj->kni", problem.whitening, difference.reshape(count, -1, 6)).reshape(count, -1) * weight
    # (k, 2) sums of squares of the position and orientation residuals that each of k readings leaves after the fit.
    sums = ((r - (r @ solve.T) @ A.T).reshape(count, -1, 2, 3) ** 2).sum(axis=(1, 3))
    now, *others = sums[:, 1]
    least = min(others)
    if not (least < LEFT * now and least < now - GAIN):
        return
    found = [reading for value, reading in zip(others, readings[1:], strict=True) if value <= AS_GOOD * least]
    looks, hints = (either(words) for words in zip(*((r.looks, r.hint) for r in found), strict=True))
    of_each = (sigmas * np.sqrt(sums / (3.0 * fit.weight[rows].sum()))).tolist()
    before, after = (tuple(of_each[i]) for i in (0, 1 + others.index(least)))
    error = DatasetError(looks, file=dataset.file, column=" ".join(ORIENTATION), hint=hints)
    if least <= CERTAIN * now:
        return refuse(error, dataset)
    suspect(error, dataset, before, after, exact=True)
