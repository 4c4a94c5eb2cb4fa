"""Coordinates of passive joints: those that close the loops, with derivatives by geometry, commands and effects."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from test_planar_loops import five_bar, hinge, loop, parallelogram, robot_of

import gtpin
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.basis import Basis
from gtpin.effects.effect import Effect
from gtpin.effects.situation import Situation
from gtpin.kinematics.kinematics import kinematics
from gtpin.robot.description import RobotDescription
from gtpin.robot.measured_joints import readable

Floats = np.ndarray

STEP = 1e-5


def four_bar() -> gtpin.Robot:
    return robot_of(
        "four_bar",
        hinge("crank", "base", "arm", "0 0 0", "0 0 1", 1.0),
        hinge("coupler", "arm", "bar", "0.1 0 0", "0 0 1", -1.0).replace("revolute", "continuous"),
        hinge("rocker", "base", "back", "0.25 0 0", "0 0 1", 1.3),
        loop("bar", "0.26 0 0", "back", "0.18 0 0"),
        '<gtpin><actuator joint="crank"/><platform link="bar"/></gtpin>',
    )


def slider() -> gtpin.Robot:
    """A crank that moves a slider: its coordinate is a length."""
    slide = hinge("slide", "base", "block", "0.4 0 0", "1 0 0").replace("revolute", "prismatic")
    return robot_of(
        "slider",
        hinge("crank", "base", "arm", "0 0 0", "0 0 1", 1.0),
        hinge("coupler", "arm", "bar", "0.1 0 0", "0 0 1", -1.0),
        slide,
        loop("bar", "0.3 0 0", "block", "0 0 0"),
        '<gtpin><actuator joint="crank"/><platform link="bar"/></gtpin>',
    )


def spatial_loop() -> gtpin.Robot:
    """A crank, a coupler that hangs on it by a universal joint, and a rocker to which a ball joint leads: RUSR."""
    joints = "".join(
        f'<link name="{child}"/><joint name="{child}_joint" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/></joint>'
        for child, parent, xyz, rpy, axis in (
            ("crank", "base", "0 0 0", "0 0 0", "0 0 1"),
            ("cross", "crank", "0.2 0 0", "0 0 1.0", "0 0 1"),
            ("coupler", "cross", "0 0 0", "0 0 0", "0 1 0"),
            ("rocker", "base", "0.6 0 0", "0.3 0 1.9", "0 0 1"),
        )
    )
    own = '<gtpin><actuator joint="crank_joint"/><platform link="rocker"/></gtpin>'
    text = (
        f'<robot name="rusr"><link name="base"/>{joints}{loop("coupler", "0.5 0 0", "rocker", "0.45 0 0")}{own}</robot>'
    )
    return gtpin.Robot(RobotDescription.parse(text))


ROBOTS: dict[str, tuple[Callable[[], gtpin.Robot], tuple[str, ...]]] = {
    "four_bar": (four_bar, ("coupler", "rocker")),
    "five_bar": (five_bar, ("elbow2", "elbow1")),
    "slider": (slider, ("slide", "coupler")),
    "parallelogram": (parallelogram, ("follow", "top")),
    "rusr": (spatial_loop, ("rocker_joint", "coupler_joint", "cross_joint")),
}


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> gtpin.Robot:
    made, joints = ROBOTS[request.param]
    return made().measuring(joints)


def off(robot: gtpin.Robot) -> gtpin.Geometry:
    """A machine whose joints are off by their tolerances."""
    nominal = gtpin.Geometry.nominal(robot)
    return nominal.with_values(
        nominal.values + nominal.tolerance * np.random.default_rng(2).standard_normal(len(nominal.values))
    )


def commands(robot: gtpin.Robot) -> Floats:
    return np.random.default_rng(3).uniform(-0.3, 0.3, (4, robot.n_actuators))


def coordinates(poses: gtpin.Poses) -> Floats:
    """(N, k)."""
    return np.stack(list(poses.joints.values()), axis=1)


def test_the_joints_that_can_be_read_are_those_that_the_loops_move() -> None:
    for made, joints in ROBOTS.values():
        assert set(readable(made())) == set(joints)


def test_coordinates_close_the_loops(robot: gtpin.Robot) -> None:
    """Pinocchio's own forward kinematics at the coordinates leaves no gap of the nominal loops."""
    geometry, q = gtpin.Geometry.nominal(robot), commands(robot)
    found = kinematics(geometry).forward(q)
    assert tuple(found.joints) == tuple(joint.name for joint in robot.measured_joints)
    assert set(readable(robot)) == set(found.joints)  # so that they and the commands are all
    for i, row in enumerate(q):
        configuration = pin.neutral(robot.model)
        for name, value in {
            **{a.joint: v for a, v in zip(robot.actuators, row, strict=True)},
            **{name: x[i] for name, x in found.joints.items()},
        }.items():
            joint = robot.model.getJointId(name)
            at = robot.model.idx_qs[joint]
            size = robot.model.nqs[joint]
            configuration[at : at + size] = [value] if size == 1 else [np.cos(value), np.sin(value)]
        pin.forwardKinematics(robot.model, robot.data, configuration)
        for c in robot.constraints:
            one, other = (
                (robot.data.oMi[j] * M).translation
                for j, M in ((c.joint1_id, c.joint1_placement), (c.joint2_id, c.joint2_placement))
            )
            assert np.abs(one - other).max() < 1e-12


@pytest.mark.slow
def test_derivatives_by_geometry_are_those_of_the_coordinates(robot: gtpin.Robot) -> None:
    drawn, q = off(robot), commands(robot)
    here = kinematics(drawn)
    slopes = [
        coordinates(kinematics(drawn.with_values(drawn.values + h)).forward(q))
        - coordinates(kinematics(drawn.with_values(drawn.values - h)).forward(q))
        for h in STEP * np.eye(len(drawn.values))
    ]
    found = here.geometry_jacobian(q, here.forward(q))[:, 6:]
    assert np.abs(found).max() > 0.1
    np.testing.assert_allclose(found, np.moveaxis(slopes, 0, 2) / (2.0 * STEP), rtol=0, atol=1e-7)


def test_derivatives_by_commands_are_those_of_the_coordinates(robot: gtpin.Robot) -> None:
    here, q = kinematics(off(robot)), commands(robot)
    steps = STEP * np.eye(robot.n_actuators)
    slopes = [coordinates(here.forward(q + h)) - coordinates(here.forward(q - h)) for h in steps]
    found = here.command_jacobian(q, here.forward(q))[:, 6:]
    assert np.abs(found).max() > 0.1
    np.testing.assert_allclose(found, np.moveaxis(slopes, 0, 2) / (2.0 * STEP), rtol=0, atol=1e-7)


class Displaced(Effect):
    """One coefficient displaces a command and the frames of all joints and of the tool."""

    id, title = "displaced", "displaced"

    def sites(self, robot: gtpin.Robot) -> tuple[str, ...]:
        return robot.sites

    def basis(self, at: Situation, site: str, nonlinear: float | None = None) -> Basis:
        rng = np.random.default_rng(4)
        frames = at.robot.model.njoints
        return Basis(
            np.ones(1),
            command=(0, rng.standard_normal((len(at), 1))),
            twist=rng.standard_normal((len(at), 6, 1)),
            placements=tuple((i, rng.standard_normal((len(at), 6, 1))) for i in range(frames)),
        )


def test_displacements_by_effects_are_those_of_the_exact_solution(robot: gtpin.Robot) -> None:
    here, q, step = kinematics(off(robot)), commands(robot), 2e-6
    plain = here.forward(q)
    at = Situation(here, q, plain, {})
    first = Displaced().basis(at, robot.sites[0]).displacement(at)[:, :, 0]

    def displaced(size: float) -> gtpin.Poses:
        active = ActiveEffect(Displaced(), robot.sites[0], None, np.array([size]), np.zeros((1, 1)), at.references)
        return with_effects(here, q, {}, [active])

    there, back = displaced(step), displaced(-step)
    exact = np.hstack([there.minus(back), coordinates(there) - coordinates(back)]) / (2.0 * step)
    assert np.abs(first[:, 6:]).max() > 0.1
    np.testing.assert_allclose(first, exact, rtol=0, atol=1e-7)


def test_a_robot_measures_the_same_after_it_was_sent_elsewhere_and_moved(robot: gtpin.Robot) -> None:
    again = pickle.loads(pickle.dumps(robot))
    assert again.measured_joints == robot.measured_joints
    assert robot.measuring(joint.name for joint in robot.measured_joints) is robot
    assert robot.measuring([]).measured_joints == ()
    q = commands(robot)
    np.testing.assert_array_equal(
        coordinates(kinematics(off(again)).forward(q)), coordinates(kinematics(off(robot)).forward(q))
    )


def test_poses_do_not_depend_on_what_is_measured(robot: gtpin.Robot) -> None:
    q, plain = commands(robot), robot.measuring([])
    one, other = (kinematics(off(r)) for r in (robot, plain))
    here, there = one.forward(q), other.forward(q)
    np.testing.assert_array_equal(here.T, there.T)
    np.testing.assert_array_equal(one.geometry_jacobian(q, here)[:, :6], other.geometry_jacobian(q, there))
    assert not there.joints
