"""Covariates are those of one way through one day."""

import numpy as np
import pytest

from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.build import known_robot
from gtpin.bench.simulator.fields import Field, curve, play, uneven_curve
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.visits import BACK_OFF, Day, plan

MACHINE = RodMachine.draw(known_robot("gantry_tau"), np.random.default_rng(0))


def visits(conditions: SimulatedConditions, seed: int = 1, poses: int = 200):
    return plan(MACHINE, poses, 120, conditions, np.random.default_rng(seed))


@pytest.mark.parametrize("order", ["random", "layers"])
def test_every_pose_is_visited_and_a_tenth_of_the_measured_ones_twice(order: str) -> None:
    way = visits(SimulatedConditions(order=order))
    numbers, counts = np.unique(way.pose, return_counts=True)
    assert list(numbers) == list(range(320))
    assert (counts[:200] == 2).sum() == 20
    assert (counts[200:] == 1).all()
    assert (way.held == (way.pose >= 200)).all()


def test_approach_is_the_sign_of_the_last_move_which_starts_at_the_visit_before_or_near_by() -> None:
    way = visits(SimulatedConditions(direct=0.5))
    moved = way.q - way.before
    np.testing.assert_array_equal(way.approach, np.sign(moved))
    straight = (way.before[1:] == way.q[:-1]).all(axis=1)
    assert 0.35 < straight.mean() < 0.65
    off = np.abs(moved[1:][~straight])
    assert off.min() >= BACK_OFF[0] - 1e-9
    assert off.max() <= BACK_OFF[1] + 1e-9


def test_speed_is_along_the_last_move_and_zero_at_rest() -> None:
    way = visits(SimulatedConditions(rest=0.5))
    moving = way.speed.any(axis=1)
    assert 0.35 < moving.mean() < 0.65
    moved = way.q - way.before
    crossed = np.cross(way.speed[moving], moved[moving])
    assert np.abs(crossed).max() < 1e-12
    assert (way.speed[moving] * way.approach[moving] > 0.0).all()
    assert np.abs(way.speed).max() <= 0.3
    assert not visits(SimulatedConditions(rest=1.0)).speed.any()


def test_time_goes_on_sessions_follow_each_other_with_breaks_and_loads_come_in_blocks() -> None:
    way = visits(SimulatedConditions(sessions=3, payload_blocks=6))
    gaps = np.diff(way.time)
    assert (gaps > 0.0).all()
    assert list(np.unique(way.session)) == [0, 1, 2]
    breaks = np.diff(way.session)
    assert set(breaks) == {0, 1}
    assert gaps[breaks == 1].min() > 500.0
    assert set(way.payload) == {0.0, 10.0, 20.0}
    assert (np.diff(way.payload) != 0.0).sum() <= 5


def test_temperatures_follow_one_day_smoothly_from_the_reference_and_not_in_step() -> None:
    for seed in range(20):
        day = Day.draw(np.random.default_rng(seed), 7200.0, 20.0)
        assert day.frame[0] == pytest.approx(20.0, abs=0.1)
        assert day.link[0] == pytest.approx(20.0, abs=0.1)
        assert np.abs(np.diff(day.frame)).max() < 0.2
        assert 0.2 < np.ptp(day.frame) < 12.0
        assert 0.2 < np.ptp(day.link) < 12.0
        assert np.abs((day.frame - 20.0) - (day.link - 20.0)).max() > 0.1


def test_rows_are_shuffled_but_their_covariates_are_those_of_their_time() -> None:
    case = make_case(3, conditions=SimulatedConditions(sessions=2, push=50.0))
    order = np.argsort(case.dataset.covariates["time"])
    assert (np.diff(order) != 1).mean() > 0.9
    sessions = case.dataset.covariates["session"][order].astype(int)
    assert (np.diff(sessions) >= 0).all()
    assert {"fx", "fy", "fz", "payload", "approach3", "speed1", "temp_link"} < set(case.dataset.covariates)
    assert set(case.dataset.covariates) == set(case.commands.covariates)
    measured, asked = case.dataset.covariates, case.commands.covariates
    both = np.concatenate([measured["time"], asked["time"]])
    frame = np.concatenate([measured["temp_frame"], asked["temp_frame"]])[np.argsort(both)]
    assert np.abs(np.diff(frame)).max() < 1.5  # held-out commands are of the same day; a break lasts up to 90 minutes


def test_commands_are_rounded_in_range_and_keep_the_tcp_in_its_box() -> None:
    way = visits(SimulatedConditions())
    robot = MACHINE.robot
    assert np.abs(way.q * 1e6 - np.round(way.q * 1e6)).max() < 1e-6
    assert ((way.q >= robot.lower) & (way.q <= robot.upper)).all()
    T = MACHINE.predict(way.q).T
    assert np.isfinite(T).all()
    assert (np.ptp(T, axis=0) > [0.85, 0.55, 0.5]).all()
    assert (np.ptp(T, axis=0) < [1.0, 0.7, 0.65]).all()


def test_conditions_drawn_for_an_effect_let_it_show() -> None:
    for seed in range(40):
        drawn = SimulatedConditions.draw(np.random.default_rng(seed), ("session", "speed", "payload", "force"))
        assert drawn.sessions >= 2
        assert drawn.rest < 1.0
        assert len(drawn.payloads) > 1
        assert drawn.push > 0.0


@pytest.mark.parametrize("smoothness", ["rough", "once", "twice", "smooth"])
def test_curves_have_mean_0_and_rms_1_and_stay_so_beyond_their_ends(smoothness: str) -> None:
    drawn = curve(np.random.default_rng(0), -1.0, 1.0, 0.2, smoothness)
    assert drawn.values.mean() == pytest.approx(0.0, abs=1e-12)
    assert np.sqrt((drawn.values**2).mean()) == pytest.approx(1.0)
    assert drawn(np.array([5.0]))[0] == drawn.values[-1]
    for seed in range(10):
        assert np.sqrt((uneven_curve(np.random.default_rng(seed), -0.8, 0.8).values ** 2).mean()) == pytest.approx(1.0)


def test_shorter_lengths_wiggle_more() -> None:
    def steepness(length: float) -> float:
        return float(
            np.mean([np.abs(np.diff(curve(np.random.default_rng(s), 0, 1, length).values)).mean() for s in range(20)])
        )

    assert steepness(0.05) > 3.0 * steepness(0.3)


@pytest.mark.slow
def test_fields_have_unit_variance_and_correlate_over_their_length() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    fields = [Field.draw(np.random.default_rng(seed), [0.4, 0.4]) for seed in range(200)]
    values = np.array([f(points) for f in fields])
    assert values.var() == pytest.approx(1.0, abs=0.1)
    near = np.array([f(points + 0.05) for f in fields])
    far = np.array([f(points + 2.0) for f in fields])
    assert (values * near).mean() > 0.9
    assert abs((values * far).mean()) < 0.2


def test_play_lags_behind_its_pin_by_its_width() -> None:
    pin = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.0, 50)])
    dragged = play(pin, 0.1)
    assert dragged[49] == pytest.approx(0.9)
    assert dragged[-1] == pytest.approx(0.1)
    assert np.abs(dragged - pin).max() <= 0.1 + 1e-15
