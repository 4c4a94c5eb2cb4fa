"""A frame that drifts by 80 um is told to drift by as much: a Gantry-Tau of the tests' own closures."""

import numpy as np
import pytest
from closures import ORIENTATION_SIGMA, POSITION_SIGMA, nominal
from diagnosed import quietly
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import InstrumentSection

SIZE = 8e-5


@pytest.mark.parametrize(
    ("settles", "least"),
    [(False, 0.84), pytest.param(True, 0.74, marks=pytest.mark.slow)],
)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 4))])
def test_a_drift_is_told_in_its_size(seed, settles, least):
    rng, plain = np.random.default_rng(seed), nominal("gantry_tau")
    machine = plain.off({name: rng.normal(0.0, 0.3 * size) for name, size in plain.parameters().items()})
    q = machine.in_range(rng, 150)
    T, R = machine.follow(q)
    time = np.sort(rng.uniform(0.0, 7200.0, 150))
    x = (time - time[0]) / np.ptp(time)
    way = (1.0 - np.exp(-x / 0.3)) / (1.0 - np.exp(-1.0 / 0.3)) if settles else x
    drift = rng.standard_normal(3)
    drift *= SIZE / np.linalg.norm(drift)
    turn = Rotation.from_rotvec(rng.normal(0.0, ORIENTATION_SIGMA, (150, 3))) * Rotation.from_matrix(R)
    found = quietly(
        gtpin.diagnose,
        gtpin.Dataset(
            "gantry_tau",
            np.array([f"p{n}" for n in range(150)]),
            q,
            T + way[:, None] * drift + rng.normal(0.0, POSITION_SIGMA, (150, 3)),
            turn.as_quat(scalar_first=True),
            {"time": time},
            instrument=InstrumentSection(position_sigma=POSITION_SIGMA, orientation_sigma=ORIENTATION_SIGMA),
        ),
    )
    (cause,) = found.causes
    assert (cause.effect, cause.site) == ("tracker_drift", "frame")
    told = [cause.parameters[f"shift_{axis}"] for axis in "xyz"]
    values, sigmas = np.array([one.value for one in told]), np.array([one.sigma for one in told])
    assert least < values @ drift / SIZE**2 < 1.1
    assert (np.abs(values - drift) < 3.5 * sigmas).all()
