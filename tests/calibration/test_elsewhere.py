"""Beside the error of left-out poses the report says where it holds, and what to expect in the rest of the workspace."""

import re

import numpy as np
import pytest
from virtual_arm import Arm

import gtpin

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
HOME = np.array([0.0, -1.2, 1.2, -0.5, 0.7, 0.2])


def along_a_line(rng, count=60):
    return HOME + np.linspace(-0.3, 0.3, count)[:, None] * np.array([1.0, 0.4, -0.5, 0.1, 0.0, 0.0])


def told(calibration):
    """The error that is told for the rest of the workspace, m; None where none is."""
    found = re.search(
        r"rest\s+of\s+the\s+workspace,\s+expect\s+an\s+error\s+of\s+([\d.]+)\s(mm|µm)", calibration.summary()
    )
    return None if found is None else float(found[1]) * {"mm": 1e-3, "µm": 1e-6}[found[2]]


def measured_along_a_line(seed):
    """A machine drawn from the tolerances, and its calibration."""
    rng = np.random.default_rng([seed, 3])
    arm = Arm.drawn(rng, 5e-4)
    found = gtpin.calibrate(arm.measured(along_a_line(rng), rng, (2e-5, 5e-5), free=False))
    assert told(found) > 10.0 * found.by_instrument[0].left_out
    return rng, arm, found


def test_an_error_elsewhere_is_told_where_all_poses_are_along_a_line():
    measured_along_a_line(0)


@pytest.mark.slow
def test_the_error_elsewhere_is_what_is_told_where_all_poses_are_along_a_line():
    truth, said = [], []
    for seed in range(12):
        rng, arm, found = measured_along_a_line(seed)
        q = rng.uniform(-np.pi, np.pi, (200, 6))
        off = found.model.predict(q).T - arm.poses(q)[0]
        truth.append(float((off**2).sum(axis=1).mean()))
        said.append(told(found) ** 2)
    # The mean square of 12 machines, each with ten or more directions that are open, is known to a third.
    assert np.mean(truth) == pytest.approx(np.mean(said), rel=0.4)


def test_nothing_is_said_of_the_rest_where_the_poses_are_everywhere():
    rng = np.random.default_rng(4)
    arm = Arm.drawn(rng, 5e-4)
    found = gtpin.calibrate(arm.measured(rng.uniform(-np.pi, np.pi, (80, 6)), rng, (2e-5, 5e-5), free=False))
    assert told(found) is None
