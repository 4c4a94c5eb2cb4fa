"""Drives whose own joint does not carry the tool: what follows them by <mimic> does, and their effects act there."""

import numpy as np
import pytest
import telescope_arm as world

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links_at

Floats = np.ndarray
SLIDE = '<limit lower="0" upper="0.8" effort="900" velocity="1"/>'
FOLLOWS = '<mimic joint="motor" multiplier="0.5"/>'


@pytest.fixture(scope="module")
def at(tmp_path_factory: pytest.TempPathFactory) -> OperatingPoints:
    """The arm on a telescope of two stages that follow a motor at its side, as its maker's file may have it."""
    aside = (
        '<link name="nut"/><link name="stage"/>'
        '<joint name="motor" type="prismatic"><parent link="base"/><child link="nut"/><origin xyz="0.3 0 0"/>'
        f'<axis xyz="0 0 1"/>{SLIDE}</joint>'
        '<joint name="outer" type="prismatic"><parent link="base"/><child link="stage"/><origin xyz="0 0 0.2"/>'
        f'<axis xyz="0 0 1"/>{SLIDE}{FOLLOWS}</joint>'
    )
    text = world.urdf().replace('<joint name="lift" type="prismatic"><parent link="base"/>', aside + LIFT)
    text = text.replace('xyz="0.0 0.0 0.45" rpy="0.0 0 0"/>\n    <axis xyz="0 0 1"/>', PLACE + FOLLOWS)
    file = tmp_path_factory.mktemp("machine") / "machine.urdf"
    file.write_text(text)
    robot = gtpin.Robot.from_urdf(file, "tool")
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    q = np.random.default_rng(1).uniform(*np.array(world.TRAVEL).T, (20, 7))
    return OperatingPoints(kinematics, q, kinematics.forward(q), {})


LIFT = '<joint name="lift" type="prismatic"><parent link="stage"/>'
PLACE = 'xyz="0.0 0.0 0.25" rpy="0.0 0 0"/>\n    <axis xyz="0 0 1"/>'


def test_a_telescope_whose_stages_follow_a_motor_bends_as_one_column(at: OperatingPoints) -> None:
    column = 1e-7 * world.spd(np.random.default_rng(4), 0.4)
    coefficients = np.array([column[0, 0], column[1, 1], column[0, 1], 0.0, 0.0])
    effect = effects_by_id()["cart_compliance"]
    active = ActiveEffect(effect, "motor", None, coefficients, np.zeros((5, 5)), at.references)
    found = with_effects(at.kinematics, at.q, {}, [active]).T - at.poses.T
    machine = world.Machine(np.zeros((2, 2)), column)
    expected = world.seen(at.q, np.arange(20.0), np.zeros((8, 6)), machine, np.zeros((20, 6))) - at.poses.T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


def test_the_drive_carries_what_follows_it_by_its_ratio(at: OperatingPoints) -> None:
    """Both stages go half of the motor's way: together the whole weight, upwards positive."""
    effect = effects_by_id()["joint_compliance"]
    assert effect.untestable(at, "motor") is None
    travel = effect.basis(at, "motor").command
    assert travel is not None
    np.testing.assert_allclose(travel[1][:, 0], -9.81 * sum(world.MASSES), rtol=1e-9)


def test_the_stages_are_links_that_bend_and_the_tilt_is_that_of_the_first(at: OperatingPoints) -> None:
    assert {"stage", "carriage"} <= {link.name for link in links_at(at.robot, "arm")}
    ((index, _),) = effects_by_id()["bearing_compliance"].basis(at, "motor").placements
    assert index == at.robot.model.getJointId("outer") - 1


@pytest.mark.slow
def test_a_diagnosis_says_where_the_effects_of_such_a_drive_act(at: OperatingPoints) -> None:
    rng, file = np.random.default_rng(2), at.robot.description.source
    q = rng.uniform(*np.array(world.TRAVEL).T, (80, 7))
    seen = at.kinematics.forward(q).T + 1e-4 * rng.standard_normal((80, 3))
    data = gtpin.Dataset(file, np.array([f"p{n}" for n in range(80)]), q, seen, None, {}, {"position_sigma": 1e-4})
    with pytest.warns(
        gtpin.GtpinWarning, match="motor does not carry the TCP itself: its effects are those of outer, lift"
    ):
        gtpin.diagnose(data, at.robot, effects=[effects_by_id()["encoder_scale"]])
