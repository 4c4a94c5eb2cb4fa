"""What could be in the place of a cause: two joints, the tool, a backlash. On an arm that Pinocchio alone moves."""

import warnings
from functools import cache

import numpy as np
import pytest
from diagnosed import classes
from pinocchio_arm import HALF, MIDDLE, Campaign, Deviation, Floats, measured, of_joint

import gtpin
from gtpin.diagnosis.result import Diagnosis
from gtpin.errors import GtpinWarning

pytestmark = pytest.mark.slow

STEADY = MIDDLE, np.where([False, True, True, False, False, False], 0.1, HALF)
"""Ranges in which the loads of shoulder and elbow hardly vary."""
AWAY = 5.0, 2.0, -8.2
"""Gravity that the file of the arm does not say, m/s^2."""


def diagnosed(
    seed: int, joints: Deviation | None = None, tool: Deviation | None = None, frame: Deviation | None = None, **more
) -> Diagnosis:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        return gtpin.diagnose(measured(seed, joints, tool, frame, **more))


def sure(found: Diagnosis, least: float = 0.95) -> set[tuple[str, str]]:
    return {(cause.effect, cause.site) for cause in found.causes if cause.probability >= least}


def warming(axis: tuple[float, float, float]) -> Deviation:
    """A growth by 90 um along an axis, with a time constant of half an hour."""
    return lambda campaign: 9e-5 * (1.0 - np.exp(-campaign.time / 1800.0))[:, None] * np.array(axis)


def test_two_elastic_joints_are_no_certain_link_between_them():
    drives = {("joint_compliance", "shoulder"), ("joint_compliance", "elbow")}
    found = diagnosed(0, lambda c: c.moment * [0.0, 1e-5, 1.2e-5, 0.0, 0.0, 0.0])
    assert drives <= classes(found)
    assert sure(found) <= drives


def test_no_two_others_are_in_the_place_of_one_elastic_joint():
    """The column before it, twisted about the same axis, is: both turn the arm alike."""
    found = diagnosed(0, of_joint("shoulder", lambda c: 8e-6 * c.moment[:, 1]))
    assert classes(found) == {("joint_compliance", "shoulder"), ("link_compliance", "column")}
    assert all(member.beside is None for cause in found.causes for member in cause.members)


@cache
def drifting(where: str) -> Diagnosis:
    along = warming((0.0, 0.0, 1.0))
    return diagnosed(0, tool=along) if where == "platform" else diagnosed(0, frame=along)


@pytest.mark.parametrize(("where", "effect"), [("platform", "target_drift"), ("frame", "tracker_drift")])
def test_a_tool_that_grows_and_a_frame_that_drifts_are_told_apart_by_an_arm(where, effect):
    found = drifting(where)
    leader = found.causes[0]
    assert (leader.effect, leader.site) == (effect, where)
    assert {site for _, site in classes(found)} == {where}
    said = leader.parameters["shift_z"]
    start, end = (
        np.exp(-t / 1800.0) for t in (min(found.dataset.covariates["time"]), max(found.dataset.covariates["time"]))
    )
    assert abs(said.value - 9e-5 * (start - end)) < 4.0 * said.sigma


def test_a_target_that_is_put_back_in_each_session_is_named():
    places = 1e-5 * np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 3.0], [-3.0, 5.0, 0.0], [0.0, -4.0, 2.0]])
    found = diagnosed(0, tool=lambda c: places[c.session])
    assert (found.causes[0].effect, found.causes[0].site) == ("target_shift", "platform")


def test_a_backlash_under_a_load_that_hardly_varies_is_no_compliance_with_hysteresis():
    def gear(c: Campaign) -> Floats:
        return 1.5e-5 * c.moment + np.eye(6)[1] * 5e-5 * c.approach[:, [1]]

    found = diagnosed(0, gear, ranges=STEADY, payloads=(0.0,))
    assert (found.causes[0].effect, found.causes[0].site) == ("backlash", "shoulder")
    said = found.causes[0].parameters["half_width"]
    assert abs(said.value - 5e-5) < 4.0 * said.sigma


def test_beside_something_unknown_no_wrong_cause_is_sure():
    drives = {("joint_compliance", name) for name in ("waist", "shoulder", "elbow", "wrist1")}
    found = diagnosed(0, lambda c: c.moment * [6e-6, 6e-6, 7e-6, 3e-6, 0.0, 0.0], gravity=AWAY)
    assert found.verdict == "unknown"
    assert sure(found, 0.9) <= drives


def test_a_period_that_is_seen_less_than_twice_has_a_sigma_that_says_so():
    found = diagnosed(0, of_joint("elbow", lambda c: 1e-4 * (np.cos(c.q[:, 2]) + np.cos(101.0 * c.q[:, 2]))))
    told = found.causes[0].parameters
    assert (found.causes[0].effect, found.causes[0].site) == ("rack_periodic", "elbow")
    periods = {name: one for name, one in told.items() if name.startswith("period")}
    fast = told["period"]
    assert abs(fast.value - 2.0 * np.pi / 101.0) < 4.0 * fast.sigma < 1e-3
    seen = np.ptp(found.dataset.q[:, 2])
    slow = [one for one in periods.values() if one.value > seen / 2.0]
    assert slow
    assert all(abs(one.value - 2.0 * np.pi) < 1.96 * one.sigma for one in slow)
