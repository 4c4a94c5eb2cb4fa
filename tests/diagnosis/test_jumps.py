"""Errors that jump in time are told from those that drift, and the report then asks for sessions."""

from __future__ import annotations

import numpy as np
import pytest
from pinocchio_arm import Campaign, Floats, measured, of_joint

import gtpin
from gtpin.diagnosis.jumps import jumps

TIMES, POSES = (900.0, 2100.0, 3600.0), 120
ZEROS = np.array([0.0, 3e-4, -2e-4, 2.5e-4])


def zeros(campaign: Campaign) -> Floats:
    """The zero of a joint after each homing, rad."""
    return ZEROS[np.searchsorted(TIMES, campaign.time)]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("m", [1, 3])
def test_jumps_are_found_between_the_poses_around_them(m: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = rng.uniform(0.0, 5000.0, POSES)
    heights = 4.0 * np.array([0.0, 1.0, -1.0, 1.0])[np.searchsorted(TIMES, time)]
    weight = rng.uniform(0.2, 2.0, POSES)
    left = heights[:, None] + rng.standard_normal((POSES, m)) / np.sqrt(weight)[:, None]
    found = jumps(time, left, weight)
    assert len(found) == len(TIMES)
    for at, true in zip(found, TIMES, strict=True):
        assert np.count_nonzero((time > min(at, true)) & (time < max(at, true))) <= 2


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("drift", ["none", "line", "warming"])
def test_a_drift_has_no_jumps(drift: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = rng.uniform(0.0, 5000.0, POSES)
    size = {"none": 0.0 * time, "line": time / 5000.0, "warming": 1.0 - np.exp(-time / 1000.0)}[drift]
    left = 10.0 * size[:, None] + rng.standard_normal((POSES, 1))
    assert jumps(time, left, np.ones(POSES)) == ()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
@pytest.mark.parametrize("seed", [1, 2])
def test_zeros_that_jump_without_a_session_are_told_with_their_times(seed: int) -> None:
    dataset = measured(seed, joints=of_joint("elbow", zeros), poses=POSES)
    given = {name: column for name, column in dataset.covariates.items() if name in ("time", "payload")}
    found = gtpin.diagnose(gtpin.Dataset(dataset.robot, dataset.pose, dataset.q, dataset.position, None, given))
    text = " ".join(found.summary().split())
    assert "The error at elbow jumps at" in text
    assert "add a column session" in text
    times = found.unexplained.jumps
    assert found.to_json()["unexplained"]["jumps"] == list(times)
    for at, true in zip(times, TIMES, strict=True):
        assert np.count_nonzero((given["time"] > min(at, true)) & (given["time"] < max(at, true))) <= 2
