"""Tracks on a frame that bends as it warms: of a Gantry-Tau of the tests' own closures."""

from dataclasses import dataclass

import numpy as np
import pytest
from closures import ORIENTATION_SIGMA, POSITION_SIGMA, Closures, Floats, nominal
from diagnosed import quietly
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.diagnosis.result import Diagnosis

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Bent(Closures):
    """Seats that are higher by ``bend`` (N, 3), 1/m, of their carts times the square of the command."""

    bend: Floats | None = None

    def C(self, q: Floats) -> Floats:
        C = super().C(q)
        C[..., 2] += self.bend[:, self.driver] * q[:, self.driver] ** 2
        return C


SIDES = 1.0, 0.6, -0.4
"""Bends of the tracks over that of the first: the sun shines on one side."""


def diagnosed(seed: int, warming: bool) -> Diagnosis:
    """``warming``: the bend follows the temperatures; if not it is that of the end. The noise is not declared."""
    rng, plain = np.random.default_rng(seed), nominal("gantry_tau")
    machine = plain.off({f"length[{rod[4:]}]": rng.normal(0.0, 2e-4) for rod in plain.rods})
    q, time = machine.in_range(rng, 120), np.sort(rng.uniform(0.0, 9000.0, 120))
    warm = 20.0 + 3.0 * (1.0 - np.exp(-time / 3000.0))
    bend = 1e-3 * np.outer(warm - 20.0 if warming else np.full(120, 3.0), SIDES)
    T, R = machine.follow(q)
    T, R = Bent(**vars(machine), bend=bend).close(q, T, R)
    noise = Rotation.from_rotvec(rng.normal(0.0, ORIENTATION_SIGMA, (120, 3)))
    orientation = (noise * Rotation.from_matrix(R)).as_quat()[:, [3, 0, 1, 2]]
    return quietly(
        gtpin.diagnose,
        gtpin.Dataset(
            "gantry_tau",
            np.array([f"p{n}" for n in range(120)]),
            q,
            T + rng.normal(0.0, POSITION_SIGMA, (120, 3)),
            orientation,
            {"time": time, "temp_frame": np.full(120, 20.0) + rng.normal(0.0, 0.02, 120), "temp_link": warm},
        ),
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_a_frame_that_bends_as_it_warms_is_unknown_and_no_track_that_is_not_straight(seed):
    found = diagnosed(seed, warming=True)
    assert found.verdict == "unknown"
    assert not [cause for cause in found.causes if cause.probability >= 0.5]


def test_tracks_that_are_bent_all_the_time_are_not_straight():
    found = diagnosed(0, warming=False)
    assert {(cause.effect, cause.site) for cause in found.causes} == {("straightness", f"cart{i}") for i in (1, 2, 3)}
