"""Lines of a turning joint: several periods are one effect, each with its own parameters."""

from __future__ import annotations

import numpy as np

import gtpin
from gtpin.effects import Situation
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.modulation import MODULATION
from gtpin.effects.rack_periodic import RackPeriodic

ROBOT = gtpin.load_robot("ur5")
SITE = ROBOT.sites[0]


def situation() -> Situation:
    kinematics = gtpin.Model(gtpin.Geometry.nominal(ROBOT)).kinematics
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (20, ROBOT.n_actuators))
    return Situation(kinematics, q, kinematics.forward(q), {})


def test_two_lines_move_the_joint_by_the_sum_of_both() -> None:
    at, periods = situation(), (2.0 * np.pi / 12.0, 2.0 * np.pi / 23.0)
    both = RackPeriodic().basis_of(at, SITE, periods)
    each = [RackPeriodic().basis(at, SITE, period) for period in periods]
    summed = np.concatenate([basis.displacement(at) for basis in each], axis=2)
    np.testing.assert_allclose(both.displacement(at), summed, rtol=0, atol=1e-15)


def test_parameters_of_the_second_line_have_its_number_and_are_angles() -> None:
    found = RackPeriodic().parameters_of(ROBOT, SITE, np.array([3e-4, 4e-4, 0, 0, 6e-5, 8e-5, 0, 0]), (0.5, 0.25))
    assert found["period"] == (0.5, "rad")
    assert found["period_2"] == (0.25, "rad")
    np.testing.assert_allclose([found["amplitude"][0], found["amplitude_2"][0]], [5e-4, 1e-4], rtol=1e-12)


def test_a_drift_of_a_line_is_as_small_as_gears_let_it_be() -> None:
    sigma = RackPeriodic().basis(situation(), SITE, 0.5).sigma
    np.testing.assert_allclose(sigma[2:] / sigma[0], MODULATION.line, rtol=1e-12)


def test_lines_displace_the_pose_as_the_joint_turned_by_hand() -> None:
    at, periods = situation(), (2.0 * np.pi / 12.0, 2.0 * np.pi / 23.0)
    c = np.array([1e-3, 0, 0, 0, 0, 5e-4, 0, 0])
    lines = ActiveEffect(RackPeriodic(), SITE, periods[0], c, np.zeros((8, 8)), at.references, periods[1:])
    moved = with_effects(at.kinematics, at.q, {}, [lines])
    q = at.q.copy()
    q[:, 0] += 1e-3 * np.cos(12.0 * q[:, 0]) + 5e-4 * np.sin(23.0 * at.q[:, 0])
    np.testing.assert_allclose(moved.minus(at.kinematics.forward(q)), 0.0, atol=1e-12)
