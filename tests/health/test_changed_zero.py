"""The zero of an arm's joint that moved since a model is in the updated geometry, and so in its URDF; Pinocchio is the arm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from by_pinocchio import placed

import gtpin
from gtpin.export import export

Floats = np.ndarray
SIGMA, OFF, SHIFT, ELBOW = 1.5e-5, 5e-4, 4e-4, 2
LOW, HIGH = np.array([-2.5, -2.4, 0.4, -2.5, 0.4, -2.5]), np.array([2.5, -0.3, 2.2, 2.5, 2.2, 2.5])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_zero_that_moved_is_in_the_updated_urdf(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    real = pin.buildModelFromXML(gtpin.load_robot("ur10").description.xml)
    for joint in range(1, real.njoints):
        real.jointPlacements[joint] = real.jointPlacements[joint] * pin.exp6(rng.normal(0.0, OFF, 6))

    def measured(q: Floats, shift: Floats) -> gtpin.Dataset:
        seen = placed(real, q + shift)[0] + SIGMA * rng.standard_normal((len(q), 3))
        return gtpin.Dataset("ur10", [f"p{n}" for n in range(len(q))], q, seen, None, {}, {"position_sigma": SIGMA})

    moved = SHIFT * np.eye(6)[ELBOW]
    earlier = gtpin.calibrate(measured(rng.uniform(LOW, HIGH, (100, 6)), np.zeros(6))).model
    found = gtpin.diagnose(measured(rng.uniform(LOW, HIGH, (40, 6)), moved), against=earlier)
    assert found.causes[0].effect == "zero_shift"
    export(found.model, tmp_path / "robot.urdf")
    updated, q = pin.buildModelFromUrdf(str(tmp_path / "robot.urdf")), rng.uniform(LOW, HIGH, (300, 6))
    before, after = (
        np.sqrt(((at - placed(real, q + moved)[0]) ** 2).sum(axis=1).mean())
        for at in (earlier.predict(q).T, placed(updated, q)[0])
    )
    assert before > 1e-4
    assert after < 2e-5
