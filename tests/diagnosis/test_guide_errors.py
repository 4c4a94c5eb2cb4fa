"""A track that is bent and twisted: its cart shifts and rolls along it. A Gantry-Tau of the tests' own closures."""

from dataclasses import dataclass

import numpy as np
import pytest
from closures import ORIENTATION_SIGMA, POSITION_SIGMA, Closures, Floats, nominal
from diagnosed import classes, quietly
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import InstrumentSection

BEND, ROLL = 1e-4, 4e-4


@dataclass(frozen=True)
class Moved(Closures):
    """Seats that are elsewhere by ``moved`` (N, 6, 3), m."""

    moved: Floats | None = None

    def C(self, q: Floats) -> Floats:
        return super().C(q) + self.moved


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))])
def test_a_bent_and_twisted_track_is_both_and_no_soft_cart(seed):
    rng, plain = np.random.default_rng(seed), nominal("gantry_tau")
    machine = plain.off({name: rng.normal(0.0, 0.3 * size) for name, size in plain.parameters().items()})
    q, cart = machine.in_range(rng, 150), 1 + seed % 2
    T, R = machine.follow(q)
    x = 2.0 * (q[:, cart] - q[:, cart].min()) / np.ptp(q[:, cart]) - 1.0
    waves = np.stack([np.cos(np.pi / 2.0 * k * (x + 1.0) + 0.3 * (k - 2)) for k in range(2, 6)], axis=1)
    bend, roll = (waves @ (rng.standard_normal((2, 4)) / np.arange(1, 5)).T).T
    axis = machine.axis[machine.driver == cart][0]
    up = np.eye(3)[2] - axis[2] * axis
    rods = np.flatnonzero(machine.driver == cart)
    seats, moved = machine.C(q)[:, rods], np.zeros((150, 6, 3))
    turn = ROLL * roll[:, None] / np.abs(roll).max() * axis
    moved[:, rods] = np.cross(turn[:, None], seats - seats.mean(axis=1, keepdims=True) + 0.05 * up)
    moved[:, rods] += BEND * (bend / np.abs(bend).max())[:, None, None] * up / np.linalg.norm(up)
    T, R = Moved(**vars(machine), moved=moved).close(q, T, R)
    noise = Rotation.from_rotvec(rng.normal(0.0, ORIENTATION_SIGMA, (150, 3)))
    found = quietly(
        gtpin.diagnose,
        gtpin.Dataset(
            "gantry_tau",
            np.array([f"p{n}" for n in range(150)]),
            q,
            T + rng.normal(0.0, POSITION_SIGMA, (150, 3)),
            (noise * Rotation.from_matrix(R)).as_quat(scalar_first=True),
            {"payload": rng.choice([0.0, 5.0, 10.0], 150)},
            instrument=InstrumentSection(position_sigma=POSITION_SIGMA, orientation_sigma=ORIENTATION_SIGMA),
        ),
    )
    site = f"cart{cart + 1}"
    assert classes(found) >= {("straightness", site), ("cart_rotation", site)}
    assert ("cart_compliance", site) not in classes(found)
