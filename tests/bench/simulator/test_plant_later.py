"""A machine that is measured again is the same machine."""

import numpy as np
import pytest
from scipy import stats

from gtpin.bench.simulator import make_case, measure_at
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise
from gtpin.data import Commands
from gtpin.errors import GtpinError
from gtpin.kinematics.rotations import from_quaternions, log

EXACT = SimulatedNoise(repeatability=(0.0, 0.0))


@pytest.mark.parametrize("noise", [EXACT, SimulatedNoise(repeatability=(0.0, 0.0), free=True)], ids=["robot", "free"])
def test_at_held_out_commands_it_is_where_the_truth_says_but_for_the_noise(noise: SimulatedNoise) -> None:
    case = make_case(2, effects=[("rack_periodic", "cart2")], noncentrality=4000.0, noise=noise, background=False)
    again = measure_at(case, Commands(case.commands.pose, case.commands.q))
    off = (again.position - case.truth.T) / noise.position_sigma
    turned = log(from_quaternions(again.orientation) @ np.swapaxes(case.truth.R, 1, 2)) / noise.orientation_sigma
    for errors in (off, turned):
        assert stats.kstest(errors.ravel(), "norm").pvalue > 1e-3


@pytest.mark.slow
def test_it_comes_from_where_the_commands_say_and_shows_it() -> None:
    case = make_case(3, effects=[("backlash", "cart1")], noncentrality=4000.0, noise=EXACT, background=False)
    q = np.repeat(case.commands.q[:1], 80, axis=0)
    approach = np.tile([1.0, -1.0], 40)
    told = Commands(np.array(["0"] * 80, dtype=object), q, {"approach1": approach})
    again = measure_at(case, told)
    np.testing.assert_array_equal(again.covariates["approach1"], approach)
    mean = [again.position[approach == way].mean(axis=0) for way in (1.0, -1.0)]
    assert np.linalg.norm(mean[0] - mean[1]) > 8.0 * EXACT.position_sigma / np.sqrt(40.0)


@pytest.mark.slow
def test_its_covariates_are_those_of_the_case_and_what_the_commands_say() -> None:
    case = make_case(4, conditions=SimulatedConditions(without=("payload",)))
    asked = Commands(
        case.commands.pose, case.commands.q, {"payload": np.full(120, 7.0), "session": np.array(["1"] * 120)}
    )
    again = measure_at(case, asked)
    assert set(again.covariates) == set(case.dataset.covariates) | {"payload", "session"}
    assert (again.covariates["payload"] == 7.0).all()
    assert again.covariates["time"].min() > case.dataset.covariates["time"].max()


@pytest.mark.slow
def test_same_seed_same_bytes_and_other_seeds_other_noise() -> None:
    case = make_case(5)
    first, same, other = (measure_at(case, Commands(case.commands.pose, case.commands.q), seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.position, same.position)
    assert np.abs(first.position - other.position).max() > 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    "said",
    [
        {"time": np.zeros(120)},
        {"speed1": np.full(120, 0.1), "approach1": np.full(120, -1.0)},
        {"session": np.array(["monday"] * 120)},
    ],
    ids=["time", "speed", "session"],
)
def test_circumstances_that_can_t_be_are_one_line(said: dict) -> None:
    case = make_case(6)
    with pytest.raises(GtpinError) as error:
        measure_at(case, Commands(case.commands.pose, case.commands.q, said))
    assert "\n" not in str(error.value)
