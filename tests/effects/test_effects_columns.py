"""Structures that bend and bases that rock, against an arm on a telescope that shares no code with the effects."""

import numpy as np
import pytest
import telescope_arm as world

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints

Floats = np.ndarray
NONE, STILL = np.zeros((2, 2)), np.zeros((8, 6))
SKEWED = 1e-7 * world.spd(np.random.default_rng(4), 0.1)
"""Small, so that what is left of the second order is below what the tests allow."""


@pytest.fixture(scope="module")
def at(tmp_path_factory: pytest.TempPathFactory) -> OperatingPoints:
    robot = gtpin.load_robot(world.write(tmp_path_factory.mktemp("machine")))
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    q = np.random.default_rng(1).uniform(*np.array(world.TRAVEL).T, (20, 7))
    return OperatingPoints(kinematics, q, kinematics.forward(q), {"time": np.linspace(0.0, 900.0, 20)})


def moved(at: OperatingPoints, effect: str, coefficients: Floats, without: str = "") -> Floats:
    """(N, 3) what an effect at the lift does to the tool."""
    m = len(coefficients)
    active = ActiveEffect(effects_by_id()[effect], "lift", None, coefficients, np.zeros((m, m)), at.references)
    covariates = {name: values for name, values in at.covariates.items() if name != without}
    return with_effects(at.kinematics, at.q, covariates, [active]).T - at.poses.T


def truth(at: OperatingPoints, machine: world.Machine) -> Floats:
    time = at.covariate("time")
    return world.seen(at.q, time, STILL, machine, np.zeros((len(at), 6))) - at.poses.T


def alike(found: Floats, expected: Floats) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


def test_a_telescope_bends_about_two_axes_and_by_more_with_its_extension(at: OperatingPoints) -> None:
    """Twenty-four short pieces, one after the other. The axes a and b of a vertical joint are x and y of the base."""
    (a, skew), (_, b) = SKEWED
    alike(
        moved(at, "cart_compliance", np.array([a, b, skew, 0.0, 0.0])),
        truth(at, world.Machine(NONE, SKEWED)),
    )


def rocking(settles: tuple[float, float] = (0.0, 0.0), aside: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Coefficients of a base that turns about the origin of the base frame: those of a tilt about the joint's and about it."""
    own = SKEWED[[0, 1, 0], [0, 1, 1]]
    return np.concatenate([[own[0], 0.0, own[1], 0.0, own[2]], own, aside, settles])


def test_a_base_rocks_about_a_skewed_line(at: OperatingPoints) -> None:
    alike(moved(at, "bearing_compliance", rocking()), truth(at, world.Machine(SKEWED, NONE)))


def test_a_base_may_rock_about_a_point_aside_from_the_axis(at: OperatingPoints) -> None:
    """But for the constant by which the weight lowers it."""
    pivot = np.array([0.15, -0.1, 0.0])
    mass, centre = world.weight(at.q)
    turn = np.zeros((len(at), 3))
    turn[:, :2] = np.cross(centre - pivot, mass * world.GRAVITY)[:, :2] @ SKEWED
    expected = np.cross(turn, at.poses.T - pivot)
    found = moved(at, "bearing_compliance", rocking(aside=tuple(SKEWED @ [0.1, 0.15])))
    alike(found - found.mean(axis=0), expected - expected.mean(axis=0))
    alike(found[:, :2], expected[:, :2])


def test_a_base_that_settles_tilts_exponentially_under_its_mean_moment_and_then_stays(at: OperatingPoints) -> None:
    coefficients = rocking((3e-8, -2e-8))
    coefficients[:10] = 0.0
    mass, centre = world.weight(at.q)
    moment = np.linalg.norm(np.cross(centre, mass * world.GRAVITY)[:, :2].mean(axis=0))
    end = np.cross(moment * np.array([3e-8, -2e-8, 0.0]), at.poses.T)  # about the origin of the base frame
    grown = 1.0 - np.exp(-5.0 * np.linspace(0.0, 1.0, len(at)))[:, None]
    alike(moved(at, "bearing_compliance", coefficients), grown * end)
    alike(moved(at, "bearing_compliance", coefficients, without="time"), (1.0 - np.exp(-5.0)) * end)


def test_parameters_tell_the_axes_and_the_settling(at: OperatingPoints) -> None:
    effects, (a, b, skew) = effects_by_id(), SKEWED[[0, 1, 0], [0, 1, 1]]
    base = effects["bearing_compliance"].parameters_at(at.robot, "lift", rocking((3e-8, -4e-8)), None)
    assert base["tilt"][0] == pytest.approx((a + b) / 2.0)
    assert base["settling"][0] == pytest.approx(5e-8)
    assert base["skew"][0] == pytest.approx(skew)
    column = effects["cart_compliance"].parameters_at(at.robot, "lift", np.array([2.5, 1.5, 0.3, 0.0, 0.1]), None)
    assert {name: value for name, (value, _) in column.items()} == {
        "bending": 2.0,
        "difference": 1.0,
        "skew": 0.3,
        "stiffening": 0.0,
        "drawn_out": 0.1,
    }
