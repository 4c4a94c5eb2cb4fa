"""Heat makes links longer: in trees, in loops, and where links follow drives, all links grow as if the robot's file said so."""

import numpy as np
import pytest
from effect_places import EFFECTS, active, moved, nominal_at
from growing_links import MACHINES, SITES, longer

import gtpin
from gtpin.model.predict import predict
from gtpin.robot.description import RobotDescription

STRAIN, WARM = 1e-5, 10.0
"""Growth, and warming, K, by which it grows."""
PLACES = [(name, site) for name, sites in SITES.items() for site in ("arm", *sites)]


def robot_of(text: str) -> gtpin.Robot:
    return gtpin.Robot(RobotDescription.parse(text))


@pytest.mark.parametrize("name", SITES)
def test_every_link_between_two_joints_or_the_ends_of_loops_is_a_site(name: str) -> None:
    robot = robot_of(MACHINES[name])
    for effect in ("thermal_links", "link_compliance"):
        assert sorted(EFFECTS[effect].sites(robot)) == sorted(("arm", *SITES[name]))


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_a_warm_robot_is_the_robot_of_longer_links(name: str, site: str) -> None:
    robot = robot_of(MACHINES[name])
    q = np.random.default_rng(0).uniform(-0.3, 0.3, (12, robot.n_actuators))
    at = nominal_at(robot, q, {"temp_link": np.full(12, 20.0 + WARM)})
    found = moved(at, active("thermal_links", site, np.array([STRAIN / WARM, 0.0, 0.0]), at.references))
    warm = nominal_at(robot_of(longer(MACHINES[name], STRAIN, site)), q)
    expected = warm.poses.minus(at.poses)
    assert np.abs(expected).max() > 1e-7
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("name", SITES)
def test_all_links_grow_by_what_each_link_does(name: str) -> None:
    robot = robot_of(MACHINES[name])
    q = np.random.default_rng(1).uniform(-0.3, 0.3, (12, robot.n_actuators))
    at = nominal_at(robot, q, {"temp_link": np.linspace(15.0, 40.0, 12)})
    every, *each = (EFFECTS["thermal_links"].basis(at, site).displacement(at) for site in ("arm", *SITES[name]))
    np.testing.assert_allclose(every, np.sum(each, axis=0), rtol=0, atol=1e-12)


def test_a_prediction_at_no_time_or_a_later_one_than_the_fit_s_is_as_at_its_end() -> None:
    """How an expansion changes with time is known within the time of the fit."""
    robot = robot_of(MACHINES["five_bar"])
    q = np.zeros((3, 2))
    at = nominal_at(robot, q, {"temp_link": np.array([20.0, 25.0, 30.0]), "time": np.array([0.0, 500.0, 1000.0])})
    model = gtpin.Model(
        at.kinematics.geometry, effects=(active("thermal_links", "arm", np.array([1e-5, 0.0, 1e-6]), at.references),)
    )
    later = {"temp_link": np.full(3, 25.0), "time": np.array([100.0, 1020.0, 3000.0])}
    commands = gtpin.Commands(np.array(["a", "b", "c"]), q, later)
    with pytest.warns(
        gtpin.GtpinWarning, match="1 of 3 times are outside 0 to 1000 s, where thermal_links@arm was fitted"
    ):
        later_on = predict(model, commands).T
    at_the_end = gtpin.Commands(np.array(["a"]), q[:1], {"temp_link": np.array([25.0]), "time": np.array([1000.0])})
    np.testing.assert_allclose(later_on[2], predict(model, at_the_end).T[0], rtol=0, atol=1e-15)  # as it was last
    without = gtpin.Commands(np.array(["a"]), q[:1], {"temp_link": np.array([25.0])})
    with pytest.warns(gtpin.GtpinWarning, match="no column time: thermal_links@arm is used as it was at the end"):
        np.testing.assert_allclose(predict(model, without).T, later_on[2:], rtol=0, atol=1e-15)
