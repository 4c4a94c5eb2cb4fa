"""Coordinates of the universal joints by which rods hang on a platform: Pinocchio's, with derivatives."""

from __future__ import annotations

import numpy as np
import pytest

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.situation import Situation
from gtpin.errors import ModelError, RobotError
from gtpin.kinematics.kinematics import kinematics
from gtpin.kinematics.pinocchio_rods import PinocchioRods
from gtpin.kinematics.posture import ClosedPosture
from gtpin.robot.measured_joints import measured_joint, readable

Floats = np.ndarray

STEP = 1e-6


@pytest.fixture(params=["gantry_tau", "gantry_tau_6dof", "linear_delta", "stewart"], scope="module")
def robot(request: pytest.FixtureRequest) -> gtpin.Robot:
    """With all joints measured that can be: two of each rod."""
    plain = gtpin.load_robot(request.param)
    assert len(readable(plain)) == 12
    return plain.measuring(readable(plain))


def off(robot: gtpin.Robot) -> gtpin.Geometry:
    nominal = gtpin.Geometry.nominal(robot)
    rng = np.random.default_rng(2)
    return nominal.with_values(nominal.values + nominal.tolerance * rng.standard_normal(len(nominal.values)))


def commands(robot: gtpin.Robot, count: int = 4) -> Floats:
    lower, upper = (np.where(np.isfinite(end), end, side) for end, side in ((robot.lower, -1.0), (robot.upper, 1.0)))
    way = np.random.default_rng(3).uniform(-0.15, 0.15, (count, robot.n_actuators))
    return robot.home_q + way * (upper - lower)


def coordinates(poses: gtpin.Poses) -> Floats:
    return np.stack(list(poses.joints.values()), axis=1)


def turned(one: Floats, other: Floats) -> Floats:
    """Differences of angles, rad."""
    return np.abs(np.angle(np.exp(1j * (one - other))))


def postures(geometry: gtpin.Geometry, q: Floats) -> list[ClosedPosture]:
    """As Pinocchio closes the URDF of a geometry, pose by pose."""
    plain = gtpin.Geometry(geometry.robot.measuring([]), geometry.parameters, geometry.values)
    start = PinocchioRods(plain)._posture
    return [start.moved_to(row) for row in q]


def test_coordinates_are_pinocchio_s_of_the_machine_s_own_urdf(robot: gtpin.Robot) -> None:
    """No parameter turns the rods' joints on the platform, so that this URDF has them as the nominal one does."""
    drawn, q = off(robot), commands(robot)
    found = kinematics(drawn).forward(q)
    for i, posture in enumerate(postures(drawn, q)):
        for name, x in found.joints.items():
            there = measured_joint(posture.robot, name).coordinate(posture.configuration)
            assert turned(x[i], np.array(there)) < 1e-9, name


@pytest.mark.slow
def test_derivatives_by_geometry_are_those_of_the_coordinates(robot: gtpin.Robot) -> None:
    drawn, q = off(robot), commands(robot)
    here = kinematics(drawn)
    slopes = [
        coordinates(kinematics(drawn.with_values(drawn.values + h)).forward(q))
        - coordinates(kinematics(drawn.with_values(drawn.values - h)).forward(q))
        for h in STEP * np.eye(len(drawn.values))
    ]
    found = here.geometry_jacobian(q, here.forward(q))
    assert found.shape[1] == robot.motion_size == 18
    np.testing.assert_allclose(found[:, 6:], np.moveaxis(slopes, 0, 2) / (2.0 * STEP), rtol=0, atol=1e-7)


def test_derivatives_by_commands_are_those_of_the_coordinates(robot: gtpin.Robot) -> None:
    here, q = kinematics(off(robot)), commands(robot)
    slopes = [coordinates(here.forward(q + h)) - coordinates(here.forward(q - h)) for h in STEP * np.eye(q.shape[1])]
    found = here.command_jacobian(q, here.forward(q))[:, 6:]
    np.testing.assert_allclose(found, np.moveaxis(slopes, 0, 2) / (2.0 * STEP), rtol=0, atol=1e-7)


class Displaced(Effect):
    """One coefficient displaces a command, the rods' joints on their carriers, their lengths, and the target."""

    id, title = "displaced", "displaced"

    def sites(self, robot: gtpin.Robot) -> tuple[str, ...]:
        return robot.sites

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        rng, k = np.random.default_rng(4), len(at.robot.rods)
        return Basis(
            np.ones(1),
            command=(0, rng.standard_normal((len(at), 1))),
            carrier_joints=rng.standard_normal((len(at), k, 3, 1)),
            length=rng.standard_normal((len(at), k, 1)),
            twist=rng.standard_normal((len(at), 6, 1)),
        )


def test_displacements_by_effects_are_those_of_the_exact_solution(robot: gtpin.Robot) -> None:
    here, q = kinematics(off(robot)), commands(robot)
    at = Situation(here, q, here.forward(q), {})
    first = Displaced().basis(at, robot.sites[0]).displacement(at)[:, :, 0]

    def displaced(size: float) -> gtpin.Poses:
        active = ActiveEffect(Displaced(), robot.sites[0], None, np.array([size]), np.zeros((1, 1)), at.references)
        return with_effects(here, q, {}, [active])

    there, back = displaced(STEP), displaced(-STEP)
    exact = np.hstack([there.minus(back), coordinates(there) - coordinates(back)]) / (2.0 * STEP)
    np.testing.assert_allclose(first, exact, rtol=1e-7, atol=1e-7)


def test_poses_that_are_not_reached_have_no_coordinates(robot: gtpin.Robot) -> None:
    q = np.vstack([robot.home_q, robot.home_q + 50.0 * np.eye(robot.n_actuators)[0]])
    found = kinematics(gtpin.Geometry.nominal(robot)).forward(q)
    assert found.reached.tolist() == [True, False]
    assert np.isfinite(coordinates(found)).all(axis=1).tolist() == [True, False]


def test_a_platform_s_pose_has_several_coordinates_and_a_cart_is_driven() -> None:
    robot = gtpin.load_robot("gantry_tau")
    for joint, what in (("platform_pose", "6 coordinates"), ("track1", "driven by q1")):
        with pytest.raises(RobotError, match=what) as caught:
            robot.measuring([joint])
        assert "link1_pitch" in caught.value.hint


def test_the_solver_of_single_postures_refuses_measured_joints() -> None:
    robot = gtpin.load_robot("gantry_tau").measuring(["link1_pitch"])
    with pytest.raises(ModelError, match="arrays"):
        kinematics(gtpin.Geometry.nominal(robot), "pinocchio")
