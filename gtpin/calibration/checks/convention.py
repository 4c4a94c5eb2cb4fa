"""Orientations that a calibration fits far better when they are read by another convention."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.readings import misread, rotation_readings
from gtpin.calibration.checks.recognise import either
from gtpin.calibration.checks.suspected import refuse, suspect
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.problem import Point, Problem
from gtpin.data import Dataset
from gtpin.data.names import ORIENTATION
from gtpin.errors import DatasetError
from gtpin.kinematics.rotations import log
from gtpin.typing import Floats


def check_convention(dataset: Dataset, fit: Fit[Problem], sigmas: Floats) -> None:
    """Suspect orientations that fit far better when they are read by another convention of rotations.

    ``dataset``: the rows of the fit, used or not. ``sigmas`` (2,): the noise of the fit, m and rad.

    For small angles two conventions give nearly the same rotation: the difference grows with the square of the angle, and a fit
    absorbs a part of it. Therefore the residuals of a convention are those after a linearised fit to the orientations read by
    it: r - J dx, with dx from the normal equations with the tolerances as priors.
    """
    measured = fit.problem.poses
    # About one axis conventions differ only in how they scale noise about other axes.
    if measured.R is None or len(measured.T) < limits.CONVENTION_ROWS or measured.q.shape[1] == 1:
        return
    rows = np.linspace(0, len(measured.T) - 1, min(len(measured.T), limits.ENOUGH_ROWS)).astype(int)
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
    vectors = log(np.stack([reading.R for reading in readings]) @ np.swapaxes(predicted.R, 1, 2))
    both = np.concatenate([np.broadcast_to(some.T - predicted.T, vectors.shape), vectors], axis=2)
    r = np.einsum("nij,knj->kni", problem.whitening, both, optimize=True).reshape(len(readings), -1) * weight
    # (k, 2) sums of squares of the position and orientation residuals that each of k readings leaves after the fit.
    sums = ((r - (r @ solve.T) @ A.T).reshape(len(readings), -1, 2, 3) ** 2).sum(axis=(1, 3))
    now, *others = sums[:, 1]
    least = min(others)
    if not (least < limits.CONVENTION_LEFT * now and least < now - limits.CONVENTION_GAIN):
        return
    found = [reading for value, reading in zip(others, readings[1:], strict=True) if value <= limits.AS_GOOD * least]
    looks, hints = (either(words) for words in zip(*((r.looks, r.hint) for r in found), strict=True))
    of_each = (sigmas * np.sqrt(sums / (3.0 * fit.weight[rows].sum()))).tolist()
    before, after = (tuple(of_each[i]) for i in (0, 1 + others.index(least)))
    error = DatasetError(looks, file=dataset.file, column=" ".join(ORIENTATION), hint=hints)
    if least <= limits.CONVENTION_CERTAIN * now:
        return refuse(error, dataset)
    suspect(error, dataset, before, after, exact=True)
