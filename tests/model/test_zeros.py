"""The zeros of a robot's drives from the posterior of a calibration that had none among its parameters."""

import numpy as np
import pytest

import gtpin
from gtpin.model.departures import with_zeros
from gtpin.robot.geometry import Geometry

SHIFT = 5e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma", [1e-5, 1e-6, 1e-7, 1e-8])
def test_one_shifted_zero_is_found_alone_however_precise_the_data_are(sigma: float, seed: int) -> None:
    geometry, rng = gtpin.read_model("ur5").geometry, np.random.default_rng(seed)
    turn = geometry.names.index("placement[elbow_joint].ry")  # the elbow turns about y of its frame
    J = rng.normal(size=(600, len(geometry.values))) * 10.0 ** rng.uniform(-3.0, 0.0, len(geometry.values)) / sigma
    covariance = np.linalg.inv(np.diag(geometry.tolerance**-2.0) + J.T @ J)
    deviation = covariance @ J.T @ (SHIFT * J[:, turn] + rng.normal(size=len(J)))

    fitted = Geometry(geometry.robot, geometry.parameters, geometry.values + deviation)
    beyond = [one for one in with_zeros(fitted, covariance) if one.beyond]

    assert [one.name for one in beyond] == ["zero[elbow_joint]"]
    assert abs(beyond[0].value - SHIFT) < 5.0 * beyond[0].sigma
