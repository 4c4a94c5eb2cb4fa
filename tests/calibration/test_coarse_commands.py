"""Commands that were rounded or truncated are named as the reason where residuals are of the size that this makes."""

from dataclasses import replace

import numpy as np
import pytest
from test_recognise import machine

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.errors import GtpinError, GtpinWarning

pytestmark = pytest.mark.slow


def test_truncated_commands_are_named_as_multiples_of_their_step():
    data = machine("gantry_tau", 2)
    with pytest.warns(GtpinWarning, match="all commands are multiples of 0.01 m, and poses are off by.*more digits"):
        gtpin.calibrate(replace(data, q=np.trunc(data.q / 0.01) * 0.01))


@pytest.mark.filterwarnings(
    "ignore:parameters more than", "ignore:off by more than", "ignore:set aside as gross errors"
)
@pytest.mark.parametrize("robot", ["gantry_tau", "stewart"])
@pytest.mark.parametrize("step", [0.01, 0.001])
def test_a_calibration_by_rounded_commands_warns_of_their_step(robot, step):
    data = machine(robot, 661)
    with pytest.warns(GtpinWarning, match=f"all commands are multiples of {step:g} m, and poses are off by"):
        gtpin.calibrate(replace(data, q=np.round(data.q / step) * step))


@pytest.mark.filterwarnings("ignore:set aside as gross errors")
@pytest.mark.parametrize(("unit", "step", "words"), [(1.0, 1e-3, "0.001 rad"), (np.pi / 180.0, 0.01, "0.01 degrees")])
def test_steps_of_a_few_times_the_noise_are_named_in_rad_and_in_degrees(unit, step, words):
    data = simulate(gtpin.load_robot("ur5"), "ur5", poses=60, seed=3, held_out=1).dataset
    assert gtpin.calibrate(data).chi2_per_dof < 2.0
    rounded = np.round(data.q / (unit * step)) * step * unit
    with pytest.warns(GtpinWarning, match=f"times the noise: all commands are multiples of {words}, and poses are off"):
        gtpin.calibrate(replace(data, q=rounded))


@pytest.mark.filterwarnings("default::gtpin.errors.GtpinWarning")
@pytest.mark.study
def test_exact_commands_on_a_grid_are_not_blamed_for_another_error(recwarn):
    data = machine("gantry_tau", 662)
    gridded = replace(data, q=np.round(data.q / 0.01) * 0.01)
    robot = gtpin.load_robot("gantry_tau")
    exact = gtpin.calibrate(data).model.predict(gridded.q)  # what that machine does at these very commands
    rng = np.random.default_rng(662)
    right = replace(gridded, position=exact.T + rng.normal(0, 2e-5, exact.T.shape), orientation=None)
    assert gtpin.calibrate(right, robot).chi2_per_dof < 2.0
    wrong = replace(right, position=right.position + rng.normal(0, 0.1, exact.T.shape))
    with pytest.raises(GtpinError) as refused:
        gtpin.calibrate(wrong)
    assert "multiples" not in str(refused.value)
    assert not [w for w in recwarn if "multiples" in str(w.message)]
