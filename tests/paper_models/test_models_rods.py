"""Rods with paths of their own, of any machine: where they share their cart's, they are Pinocchio's own chain."""

from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.errors import ModelError
from gtpin.kinematics.kinematics import Kinematics
from gtpin.model.model_folder import calibrated_urdf
from gtpin.paper.geometry import PaperGeometry, nominal_geometry
from gtpin.paper.kinematics import PaperKinematics, kinematics_of

MACHINES = ("gantry_tau", "linear_delta", "stewart", "tau")  # tracks, legs that change their lengths, arms


def off(nominal: PaperGeometry, seed: int = 5) -> PaperGeometry:
    """The geometry with every parameter a tolerance or so off."""
    return nominal.with_values(
        nominal.values + nominal.tolerance * np.random.default_rng(seed).standard_normal(len(nominal.values))
    )


def near_home(robot: gtpin.Robot, count: int) -> np.ndarray:
    lower, upper = np.maximum(robot.lower, robot.home_q - 0.1), np.minimum(robot.upper, robot.home_q + 0.1)
    return np.random.default_rng(0).uniform(lower, upper, (count, robot.n_actuators))


@pytest.mark.parametrize("name", MACHINES)
def test_with_one_path_for_each_actuator_they_are_the_chain_itself(name: str):
    robot = gtpin.load_robot(name)
    geometry, q = off(PaperGeometry.nominal(robot, scale="actuator")), near_home(robot, 20)
    chain = Kinematics(gtpin.Geometry.nominal(robot, scale="actuator").with_values(geometry.values))
    assert chain.geometry.names == geometry.names
    rods = PaperKinematics(geometry)
    poses, other = rods.forward(q), chain.forward(q)
    np.testing.assert_allclose(poses.minus(other), 0.0, atol=1e-12)
    for one, two in (
        (rods.command_jacobian(q, poses), chain.command_jacobian(q, other)),
        (rods.geometry_jacobian(q, poses), chain.geometry_jacobian(q, other)),
    ):
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-11 * np.abs(two).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
def test_derivatives_by_each_rods_own_parameters_and_by_commands_are_those_of_differences(name: str):
    robot = gtpin.load_robot(name)
    geometry, q = off(PaperGeometry.nominal(robot, directions="rod", scale="rod")), near_home(robot, 4)
    rods = PaperKinematics(geometry)
    poses = rods.forward(q)

    def difference(plus: gtpin.Poses, minus: gtpin.Poses, step: float) -> np.ndarray:
        return plus.minus(minus) / (2.0 * step)

    J, step = rods.geometry_jacobian(q, poses), 1e-5
    for column, row in enumerate(step * np.eye(len(geometry.values))):
        plus, minus = (PaperKinematics(geometry.with_values(geometry.values + s * row)) for s in (1.0, -1.0))
        found = difference(plus.forward(q, poses), minus.forward(q, poses), step)
        np.testing.assert_allclose(J[:, :, column], found, rtol=0, atol=1e-6 * max(1.0, np.abs(found).max()))
    J = rods.command_jacobian(q, poses)
    for column, row in enumerate(step * np.eye(robot.n_actuators)):
        found = difference(rods.forward(q + row, poses), rods.forward(q - row, poses), step)
        np.testing.assert_allclose(J[:, :, column], found, rtol=0, atol=1e-7 * max(1.0, np.abs(found).max()))


def test_each_rod_may_have_a_direction_and_a_scale():
    names = nominal_geometry(gtpin.load_robot("gantry_tau"), directions="rod", scale="rod").names
    assert len(names) == 60
    assert {"track_direction[3c].b", "scale[2a]"} <= set(names)


@pytest.mark.parametrize("options", [{}, {"scale": "actuator"}])
def test_what_a_chain_can_hold_is_no_geometry_of_the_paper(options: dict[str, str]):
    for name in ("gantry_tau", "ur5"):
        geometry = nominal_geometry(gtpin.load_robot(name), **options)
        assert type(geometry) is gtpin.Geometry
        assert type(kinematics_of(geometry)) is Kinematics


@pytest.mark.parametrize("options", [{"directions": "cart"}, {"scale": "link"}, {"without": "lenght"}, {"arm": "half"}])
def test_options_that_do_not_exist_are_refused(options: dict[str, str]):
    for nominal in (nominal_geometry, PaperGeometry.nominal):
        with pytest.raises(ModelError):
            nominal(gtpin.load_robot("gantry_tau"), **options)


@pytest.mark.parametrize("name", ["gantry_tau", "stewart"])
def test_the_urdf_has_their_joints_lengths_and_shared_directions(name: str, tmp_path: Path):
    robot = gtpin.load_robot(name)
    model = gtpin.Model(off(PaperGeometry.nominal(robot)))
    file = tmp_path / "robot.urdf"
    file.write_text(calibrated_urdf(model), encoding="utf-8")
    again = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(file)))
    q = near_home(robot, 10)
    np.testing.assert_allclose(again.predict(q).minus(model.predict(q)), 0.0, atol=1e-11)
