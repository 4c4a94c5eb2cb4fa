"""A drive whose zero follows a temperature that differs between sessions, which no effect describes: by Pinocchio alone."""

from dataclasses import replace

import numpy as np
import pinocchio_arm as arm
import pytest
from diagnosed import quietly

import gtpin

pytestmark = pytest.mark.slow

DAYS = np.array([18.0, 24.0, 21.0, 27.0])


def temperature(campaign: arm.Campaign) -> np.ndarray:
    return DAYS[campaign.session] + 0.8 * np.sin(campaign.time / 150.0)


def measured(seed: int, warmth: float = 0.0, moved: float = 0.0) -> gtpin.Dataset:
    """Of the elbow's zero: ``warmth``, rad/K, and ``moved``, rad, between sessions."""
    zeros, seen = moved * np.random.default_rng([7, seed]).standard_normal(4), []

    def elbow(campaign: arm.Campaign) -> np.ndarray:
        seen.append(temperature(campaign))
        return warmth * (seen[0] - 20.0) + zeros[campaign.session]

    dataset = arm.measured(seed, joints=arm.of_joint("elbow", elbow), poses=140, payloads=(0.0,))
    return replace(dataset, covariates={**dataset.covariates, "temp_link": seen[0]})


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_zero_that_follows_a_temperature_is_no_shift_between_sessions(seed: int) -> None:
    found = quietly(gtpin.diagnose, measured(seed, warmth=5e-5))
    assert found.verdict == "unknown"
    assert ("elbow", ("temp_link",)) in {(doubt.site, doubt.over) for doubt in found.doubts}
    assert not found.causes


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_zero_that_moved_between_sessions_of_other_temperatures_is_named(seed: int) -> None:
    found = quietly(gtpin.diagnose, measured(seed, moved=3e-4))
    assert [(cause.effect, cause.site) for cause in found.causes if cause.probability >= 0.9] == [
        ("zero_shift", "elbow")
    ]
