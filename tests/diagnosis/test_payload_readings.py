"""Payload columns that are inverted, marks of a load, or in another unit, on an arm with a compliant joint.

Pinocchio alone moves the arm.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pinocchio_arm import Deviation, measured, of_joint

import gtpin
from gtpin.errors import GtpinWarning

Floats = np.ndarray
MASS = 3.2
COMPLIANT = of_joint("elbow", lambda campaign: 1e-5 * campaign.moment[:, 2])
WRONG: dict[str, tuple[Callable[[Floats], Floats], str]] = {
    "inverted": (lambda mass: MASS - mass, r"inverted .*Write 3.2 less the column"),
    "mark": (
        lambda mass: 1.0 * (mass > 0.0),
        r"like a mark of the load.*Write the mass, about (2\.[6-9]|3\.?[0-9]?) kg",
    ),
    "inverted mark": (lambda mass: 1.0 * (mass == 0.0), r"inverted .*like a mark of the load"),
    "g": (lambda mass: 1e3 * mass, r"like g.*Divide it by 1000"),
    "N": (lambda mass: 9.81 * mass, r"like N.*Divide it by 9\.81"),
}


def recorded(seed: int, joints: Deviation | None, read: Callable[[Floats], Floats] | None = None) -> gtpin.Dataset:
    """Poses of the arm with the load or without, and the column as it was ``read``."""
    dataset = measured(seed, joints, poses=120, payloads=(0.0, MASS))
    mass = np.asarray(dataset.covariates["payload"])
    return dataset if read is None else replace(dataset, covariates={**dataset.covariates, "payload": read(mass)})


def told(dataset: gtpin.Dataset) -> list[str]:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", GtpinWarning)
        gtpin.calibrate(dataset)
    return [str(one.message) for one in said if "payload looks" in str(one.message)]


@pytest.mark.parametrize("wrong", WRONG)
def test_another_reading_of_a_payload_that_fits_far_better_is_named(wrong: str) -> None:
    read, words = WRONG[wrong]
    (text,) = told(recorded(0, COMPLIANT, read))
    assert re.search(words, text)


OTHERS: dict[str, Deviation | None] = {
    "nothing": None,
    "compliant": COMPLIANT,
    "backlash": of_joint("shoulder", lambda campaign: 4e-4 * campaign.approach[:, 1]),
    "of the posture": of_joint(
        "elbow", lambda campaign: 3e-4 * np.sin(3.0 * campaign.q[:, 1] + 2.0 * campaign.q[:, 3])
    ),
    "with the load": of_joint("elbow", lambda campaign: -1e-5 * campaign.payload),
    "of time": of_joint("shoulder", lambda campaign: 1e-7 * campaign.time),
}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("joints", OTHERS)
def test_a_payload_that_is_right_is_not_suspected(joints: str, seed: int) -> None:
    assert not told(recorded(seed, OTHERS[joints]))


@pytest.mark.parametrize("wrong", ["inverted", "mark"])
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_a_payload_that_is_wrong_makes_no_wrong_certain_cause(wrong: str) -> None:
    found = gtpin.diagnose(recorded(1, COMPLIANT, WRONG[wrong][0]))
    assert all(cause.probability < 0.95 or cause.site == "elbow" for cause in found.causes)
    assert any("payload is not used" in text for text in found.warnings)
