"""An arm in motion whose readings are late, whose target lags, or whose drives lag. Pinocchio alone moves it."""

import warnings
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from diagnosed import classes
from pinocchio_arm import JOINTS, URDF, Campaign, Deviation, Floats, measured, of_joint

import gtpin
from gtpin.diagnosis.result import Diagnosis
from gtpin.errors import GtpinWarning

pytestmark = pytest.mark.slow

LATE = ("measurement_delay", "frame")
LAGS = {("servo_lag", joint) for joint in JOINTS}


def diagnosed(seed: int, joints: Deviation | None = None, tool: Deviation | None = None) -> Diagnosis:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        return gtpin.diagnose(measured(seed, joints, tool, fastest=0.3))


@cache
def late(seed: int) -> Diagnosis:
    return diagnosed(seed, lambda c: -2e-3 * c.speed)


def dragged(campaign: Campaign) -> Floats:
    """(N, 3) displacements of a target by 4 ms times the square of its speed over 1 m/s, against its motion, tool axes."""
    model = pin.buildModelFromUrdf(str(URDF))
    data, shifts = model.createData(), np.empty((len(campaign.q), 3))
    for n, (q, speed) in enumerate(zip(campaign.q, campaign.speed, strict=True)):
        pin.forwardKinematics(model, data, q, speed)
        v = pin.getFrameVelocity(model, data, model.nframes - 1, pin.ReferenceFrame.LOCAL).linear
        shifts[n] = -4e-3 * v * np.linalg.norm(v)
    return shifts


@pytest.mark.parametrize("seed", [0, 1])
def test_late_readings_are_in_one_class_with_equal_lags_of_all_drives(seed):
    found = late(seed)
    assert classes(found) == {LATE, *LAGS}
    assert len(found.causes) == 1
    assert found.verdict == "ambiguous"
    told = found.causes[0].parameters["delay"]
    assert abs(told.value - 2e-3) < 4.0 * told.sigma < 4e-4


def test_no_poses_are_proposed_to_distinguish_late_readings_from_equal_lags():
    assert [one for one in late(0).next_experiment if one.kind == "discriminate"] == []


@pytest.mark.parametrize("seed", [0, 1])
def test_a_target_that_lags_on_a_soft_holder_is_no_lag_of_the_drives(seed):
    found = diagnosed(seed, tool=dragged)
    assert (found.causes[0].effect, found.causes[0].site) == LATE
    assert not classes(found) & LAGS
    told = found.causes[0].parameters
    assert abs(told["turn_delay"].value) < 4.0 * told["turn_delay"].sigma < told["delay"].value


def test_one_drive_that_lags_is_no_late_reading():
    found = diagnosed(0, of_joint("elbow", lambda c: -2e-3 * c.speed[:, 2]))
    assert classes(found) == {("servo_lag", "elbow")}
