"""Readings that are late are those of the pose that the machine had before."""

import numpy as np
import pytest
from effect_places import ARM_FIT, EFFECTS, FIT, active, moved

from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.untestable import Untestable

DELAY = EFFECTS["measurement_delay"]
LATE = 1e-3
"""s; the machine moves by 0.3 mm at most, and its path bends by less than 0.3 um in this time."""


@pytest.mark.parametrize("at", [FIT, ARM_FIT], ids=["gantry_tau", "arm"])
def test_a_late_reading_is_of_the_pose_before(at: OperatingPoints) -> None:
    speed = np.stack([at.covariate(f"speed{i + 1}") for i in range(at.robot.n_actuators)], axis=1)
    before = at.kinematics.forward(at.q - LATE * speed).minus(at.poses)
    late = moved(at, active(DELAY.id, "frame", np.array([LATE, 0.0, 0.0]), at.references))
    assert np.abs(before).max() > 2e-4
    np.testing.assert_allclose(late, before, rtol=0, atol=1e-6)


def test_a_target_on_a_soft_holder_lags_without_a_turn_and_with_the_square_of_its_speed() -> None:
    at, shift = ARM_FIT, moved(ARM_FIT, active(DELAY.id, "frame", np.array([LATE, 0.0, 0.0]), ARM_FIT.references))
    found = moved(at, active(DELAY.id, "frame", np.array([LATE, -LATE, LATE]), at.references))
    fast = np.linalg.norm(shift[:, :3], axis=1, keepdims=True) / (0.3 * LATE)
    np.testing.assert_allclose(found[:, :3], shift[:, :3] * fast, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[:, 3:], 0.0, rtol=0, atol=1e-9)


def test_speeds_of_all_actuators_are_needed_and_one_that_varies_is_enough() -> None:
    def why(**speeds: np.ndarray | None) -> Untestable | str | None:
        told = {name: values for name, values in {**FIT.covariates, **speeds}.items() if values is not None}
        return DELAY.untestable(OperatingPoints(FIT.kinematics, FIT.q, FIT.poses, told), "frame")

    still = np.zeros(len(FIT))
    assert why() is None
    assert why(speed1=still, speed3=still) is None
    assert why(speed1=still, speed2=still, speed3=still) == Untestable("constant", "speed1")
    assert why(speed2=None) == Untestable("missing", "speed2")
    assert why(speed1=still, speed3=None) == Untestable("missing", "speed3")
