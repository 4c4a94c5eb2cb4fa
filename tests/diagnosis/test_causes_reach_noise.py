"""Where the causes alone leave less than the declared noise, what a smooth term gains beside them is no unknown cause."""

from dataclasses import replace

import numpy as np
import pinocchio_arm as arm
import pytest
from diagnosed import quietly

import gtpin
from gtpin.data import Driver
from gtpin.diagnosis.result import Diagnosis


def said(declared: float) -> Diagnosis:
    """A frame that moves with the payload, which a driver tells, and a small error of a joint that is not tried.

    The noise is declared ``declared`` times as large as it is.
    """
    data = arm.measured(
        3,
        joints=arm.of_joint("shoulder", lambda campaign: 1e-4 * np.sin(6.0 * campaign.q[:, 1])),
        frame=lambda campaign: np.outer(campaign.payload, [0.0, 1e-4, 2e-4]),
    )
    noise = {"position_sigma": declared * arm.SHIFT, "orientation_sigma": declared * arm.TURN}
    drivers = (Driver("payload", "frame", "y", 1e-4), Driver("payload", "frame", "z", 1e-4))
    tried = [effect for effect in gtpin.catalogue() if effect.id in ("backlash", "joint_compliance")]
    return quietly(gtpin.diagnose, replace(data, instrument=noise, drivers=drivers), effects=tried)


@pytest.mark.slow
def test_a_cause_that_leaves_less_than_the_noise_explains_the_gap() -> None:
    found = said(3.0)
    assert {(cause.effect, cause.site) for cause in found.causes} == {("driver:payload", "frame")}
    assert found.unexplained.p_value > 0.95
    assert found.verdict == "explained"


@pytest.mark.slow
def test_the_same_error_beyond_the_noise_stays_unknown() -> None:
    found = said(1.0)
    assert found.verdict == "unknown"
    assert ("driver:payload", "frame") in {(cause.effect, cause.site) for cause in found.causes}
