"""Lines of a turning joint: several periods are one effect, each with its own parameters."""

import numpy as np
import pytest
from effect_places import nominal_at

import gtpin
from gtpin.effects import OperatingPoints
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.modulation import MODULATION
from gtpin.effects.rack import APART, LEAST_TURNS, RackPeriodic
from gtpin.effects.smooth import LEAST_ORDERS, SLOWEST_LINE, cosines, smooth_cosines

ROBOT = gtpin.load_robot("ur5")
SITE = ROBOT.sites[0]


def operating_points() -> OperatingPoints:
    return nominal_at(ROBOT, np.random.default_rng(0).uniform(-1.0, 1.0, (20, ROBOT.n_actuators)))


def test_parameters_of_the_second_line_have_its_number_and_are_angles() -> None:
    found = RackPeriodic().parameters_of(ROBOT, SITE, np.array([3e-4, 4e-4, 0, 0, 6e-5, 8e-5, 0, 0]), (0.5, 0.25))
    assert found["period"] == (0.5, "rad")
    assert found["period_2"] == (0.25, "rad")
    np.testing.assert_allclose([found["amplitude"][0], found["amplitude_2"][0]], [5e-4, 1e-4], rtol=1e-12)


def test_a_drift_of_a_line_is_as_small_as_gears_let_it_be() -> None:
    sigma = RackPeriodic().basis(operating_points(), SITE, 0.5).sigma
    np.testing.assert_allclose(sigma[2:] / sigma[0], MODULATION.line, rtol=1e-12)


def test_two_lines_displace_the_pose_as_the_joint_turned_by_the_sum_of_both() -> None:
    at, periods = operating_points(), (2.0 * np.pi / 12.0, 2.0 * np.pi / 23.0)
    c = np.array([1e-3, 0, 0, 0, 0, 5e-4, 0, 0])
    lines = ActiveEffect(RackPeriodic(), SITE, periods[0], c, np.zeros((8, 8)), at.references, periods[1:])
    moved = with_effects(at.kinematics, at.q, {}, [lines])
    q = at.q.copy()
    q[:, 0] += 1e-3 * np.cos(12.0 * q[:, 0]) + 5e-4 * np.sin(23.0 * at.q[:, 0])
    np.testing.assert_allclose(moved.minus(at.kinematics.forward(q)), 0.0, atol=1e-12)


def test_a_first_line_has_enough_periods_in_the_range_and_a_further_one_is_apart_from_it() -> None:
    at = operating_points()
    effect, span = RackPeriodic(), float(np.ptp(at.q[:, 0]))
    values = np.array(effect.nonlinear_values(at, SITE))
    assert values.max() > span / LEAST_TURNS  # slow ones are tried, beside another line
    alone = effect.resolved(at, SITE, values, ())
    assert (span / values[alone] >= LEAST_TURNS * (1.0 - 1e-6)).all()
    assert (span / values[~alone] < LEAST_TURNS).all()
    wide = nominal_at(
        ROBOT, np.random.default_rng(0).uniform(-1.8, 1.8, (200, ROBOT.n_actuators))
    )  # more than half a turn
    turns = effect.resolved(wide, SITE, np.array([2.0 * np.pi, 6.0]), ())
    assert turns.tolist() == [True, False]  # an eccentric wheel has one period a turn
    other = 2.0 * np.pi / 12.0
    beside = effect.resolved(at, SITE, values, [other])
    assert (np.abs(span / values[beside] - span / other) >= APART).all()
    assert (span / values[beside] >= APART).all()  # the slope of half a period is a scale
    near = np.minimum(np.abs(span / values - span / other), span / values)
    assert (near[~beside] < APART).all()
    assert not beside.all()


@pytest.mark.parametrize(
    ("a_turn", "nature"),
    [
        ((1.0, 2.0, 101.0, 202.0), "mechanism"),  # an eccentric encoder and a strain wave gear
        ((1.0, 6.25, 12.5, 18.75, 31.25), "mechanism"),  # a gear of ratio 6.25, its multiples
        ((7.3, 100.5, 201.0), "mechanism"),  # two gears
        ((2.18, 4.39, 7.71, 10.3), "profile"),
        ((2.18, 4.39), "mechanism"),
    ],
)
def test_periods_of_few_gears_are_a_mechanism_and_others_a_rough_drive(a_turn: tuple[float, ...], nature: str) -> None:
    turn = 2.0 * np.pi
    for order in (a_turn, a_turn[::-1]):
        assert RackPeriodic().nature_of([(turn / f, 0.02 * turn / f**2) for f in order]) == nature
    # Periods that are known to half a cycle a turn may be of any gear.
    assert RackPeriodic().nature_of([(turn / f, 0.5 * turn / f**2) for f in a_turn]) == "mechanism"


def test_the_fastest_line_has_a_value_on_either_side_between_which_a_scan_refines_it() -> None:
    at = operating_points()
    a_turn = 2.0 * np.pi / np.array(RackPeriodic().nonlinear_values(at, SITE))
    step = np.pi / 3.0 / float(np.ptp(at.q[:, 0]))  # a sixth of a period over the range
    near = np.abs(a_turn - 202.0) < 1.001 * step  # two for each turn of a strain wave gear of ratio 101
    assert (a_turn[near] <= 202.0).any()
    assert (a_turn[near] > 202.0).any()


def test_smooth_deviations_have_ever_smaller_parts_beyond_three_periods_a_turn() -> None:
    at = operating_points()
    _, size = smooth_cosines(at, 0, 14, 1.2)
    _, plain = cosines(at.travel[:, 0], 1, 14, 1.2)
    rate = np.arange(1, 15) * np.pi / np.ptp(at.q[:, 0])
    slow, fast = rate <= SLOWEST_LINE, (rate > SLOWEST_LINE) & (np.arange(14) >= LEAST_ORDERS)
    np.testing.assert_allclose(size[slow], plain[slow], rtol=1e-12)
    assert fast.sum() > 3
    assert (np.diff(size[fast] / plain[fast]) < 0.0).all()
