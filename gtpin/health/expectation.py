"""The linear problem of a check: new poses less what an earlier model predicts, whitened, and how uncertain that is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import Measured, rough_frame
from gtpin.diagnosis.linear.design import Design
from gtpin.effects.situation import Column, Situation
from gtpin.health.earlier import Earlier
from gtpin.health.readings import with_unknowns
from gtpin.instruments.readings import Readings
from gtpin.noise.noise import Noise
from gtpin.noise.reading_noise import ReadingNoise

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Conditions:
    """The conditions under which a check is measured.

    Parameters
    ----------
    noise
        Noise of the check's poses or readings.
    free_frame
        Whether the pose of the instrument is unknown.
    temperature
        Reference temperature, degC, at which the geometry holds.
    """

    noise: Noise | ReadingNoise
    free_frame: bool
    temperature: float = 20.0


def expectation(
    earlier: Earlier,
    measured: Measured | Readings,
    covariates: Mapping[str, Column],
    how: Conditions,
    since: Mapping[str, Column],
) -> Design:
    """The linear problem about an earlier model: y ~ N(0, I + B B') where nothing has changed.

    y is the whitened difference of the measured poses and those that the model predicts. B is the whitened derivative by the
    model's unknowns, scaled by the root of their posterior covariance, and by the pose of the instrument where that is unknown,
    or by the unknowns of the instruments, scaled by the sigmas of their priors.

    Parameters
    ----------
    earlier
        The earlier model.
    measured
        The poses or readings of the check.
    covariates
        The covariates as they were recorded.
    how
        Noise, frame and temperature.
    since
        The covariates on which changes depend: see :class:`~gtpin.health.changes.Since`.

    Raises
    ------
    ModelError
        If a covariate is missing that an effect of the model needs.
    """
    kinematics, q = earlier.model.kinematics, measured.q
    plain = kinematics.forward(q)
    poses = earlier.predicted(q, covariates, plain)
    model, at = earlier.model, Situation(kinematics, q, plain, since, temperature=how.temperature)
    c = measured.components
    if isinstance(measured, Readings):
        assert isinstance(how.noise, ReadingNoise)
        measured = with_unknowns(measured, how.noise, at.command_jacobian, poses)
    elif how.free_frame:
        model = replace(model, frame=rough_frame(poses, measured))
    W = how.noise.whitening(measured.scatter(at.command_jacobian, model, poses), c)
    by_model = measured.seen(earlier.jacobian(q, covariates, plain) @ earlier.root, model, poses)
    unknowns, free = measured.unknown_columns(model, poses, how.free_frame, None)
    B = np.asarray((W @ np.concatenate([by_model, unknowns], axis=2)).reshape(len(q) * c, -1))
    known = len(measured.deviation)
    y = np.einsum("nij,nj->ni", W, measured.left(model, poses)).ravel()
    y = y + B[:, B.shape[1] - free - known : B.shape[1] - free] @ measured.deviation
    return Design(at, W, model, y, B, B.shape[1] - free, measured.taken(how.free_frame), measured)
