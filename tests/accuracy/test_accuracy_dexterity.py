"""Gains, distances, stiffness and workspace, against differences and springs that are solved here."""

import re

import numpy as np
import pytest
from accuracy_machines import MODEL, NOMINAL, ROBOT, commands, other
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation
from stiffness import stiffness

import gtpin
from gtpin.accuracy.dexterity import dexterity
from gtpin.accuracy.workspace import default_commands, workspace
from gtpin.errors import ModelError, UnreachableError
from gtpin.robot.description import RobotDescription

ROD, CARTS = 5e7, np.array([3e7, 2e7, 4e7])


def test_gains_are_those_of_moved_commands() -> None:
    q = commands(4, seed=1)
    h = 1e-6
    columns = [(MODEL.predict(q + h * e).minus(MODEL.predict(q - h * e))) / (2 * h) for e in np.eye(3)]
    J = np.stack(columns, axis=2)
    found = dexterity(MODEL, q)
    np.testing.assert_allclose(found.position_gain, np.linalg.svd(J[:, :3], compute_uv=False), rtol=1e-6)
    np.testing.assert_allclose(found.rotation_gain, np.linalg.svd(J[:, 3:], compute_uv=False), atol=1e-6)
    np.testing.assert_allclose(found.condition, np.linalg.cond(J[:, :3]), rtol=1e-6)


def test_amplification_is_the_largest_answer_to_rod_errors() -> None:
    q = commands(3, seed=2)
    found = dexterity(MODEL, q)
    names = [f"length[{rod.name}]" for rod in ROBOT.rods]
    columns = []
    for name in names:
        h = 1e-6 * (np.array(MODEL.geometry.names) == name)
        ahead, back = (gtpin.Model(MODEL.geometry.with_values(MODEL.geometry.values + s * h)) for s in (1, -1))
        columns.append(ahead.predict(q).minus(back.predict(q)) / 2e-6)
    J = np.stack(columns, axis=2)
    np.testing.assert_allclose(found.position_amplification, np.linalg.norm(J[:, :3], 2, axis=(1, 2)), rtol=1e-5)
    np.testing.assert_allclose(found.rotation_amplification, np.linalg.norm(J[:, 3:], 2, axis=(1, 2)), rtol=1e-5)


def test_distance_from_singularity_is_one_at_home_and_falls_towards_one() -> None:
    assert dexterity(MODEL, ROBOT.home_q[None]).singularity == pytest.approx(1.0)
    # With carts 2 and 3 far apart their links come to be stretched, and an error of a rod moves the TCP ever farther.
    reach = np.linspace(0.0, 1.5, 40)
    q = np.outer(reach, [0.0, 1.0, -1.0]) + ROBOT.home_q
    poses = MODEL.predict(q)
    q = q[poses.reached]
    found = dexterity(MODEL, q)
    worst = found.position_amplification.argmax()
    assert found.singularity[worst] < 0.9


def test_distance_from_singularity_does_not_know_where_the_tcp_is() -> None:
    """The same machine with a longer tool: all joints on the plate shift in the TCP frame."""
    q = commands(5, seed=3)
    home, offset = ROBOT.description.home, np.array([0.1, 0.05, -0.4])
    assert home is not None
    T = home.tcp_xyz + Rotation.from_rotvec(home.tcp_rotvec).apply(offset)
    xml = re.sub(r'(<child link="tcp"/><origin xyz=)"0 0 0"', r'\1"0.1 0.05 -0.4"', ROBOT.description.xml)
    xml = re.sub(
        r'tcp_xyz="[^"]*"', f'tcp_xyz="{T[0]!r} {T[1]!r} {T[2]!r}"'.replace("np.float64(", "").replace(")", ""), xml
    )
    longer = gtpin.Model(gtpin.Geometry.nominal(gtpin.Robot(RobotDescription.parse(xml))))
    assert np.linalg.norm(longer.predict(q).T - MODEL.predict(q).T, axis=1).min() > 0.4
    np.testing.assert_allclose(dexterity(longer, q).singularity, dexterity(MODEL, q).singularity, rtol=1e-8)


def test_distance_to_the_limits_is_that_of_the_nearest_actuator() -> None:
    q = np.array([[0.6, 0.0, -0.1], [0.0, -0.649, 0.3], [0.0, 0.71, 0.0]])
    np.testing.assert_allclose(dexterity(MODEL, q).limit, [0.1, 0.001, -0.01], atol=1e-12)


def sprung(q: np.ndarray, force: np.ndarray, T: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Displacement (3,) of the TCP at which the energy of six rods and three drives under a force is least."""

    def energy(x: np.ndarray) -> float:
        turned = Rotation.from_rotvec(1e-6 * x[3:6]).as_matrix() @ R
        cart = q + 1e-6 * x[6:]
        d = T + 1e-6 * x[:3] + NOMINAL.P @ turned.T - NOMINAL.C(cart[None])[0]
        stretch = 1e6 * (np.linalg.norm(d, axis=1) - NOMINAL.L0)
        return float((ROD * stretch**2).sum() + (CARTS * x[6:] ** 2).sum()) / 2e6 - float(force @ x[:3])

    def gradient(x: np.ndarray) -> np.ndarray:
        return np.array([(energy(x + e) - energy(x - e)) / 0.02 for e in 0.01 * np.eye(9)])

    x = fsolve(gradient, np.zeros(9), epsfcn=1e-4, xtol=1e-8)
    assert np.abs(gradient(x)).max() < 1e-3
    return 1e-6 * np.asarray(x[:3])


@pytest.mark.slow
def test_stiffness_is_that_of_a_sprung_machine_under_load() -> None:
    q = commands(2, seed=4)
    poses = MODEL.predict(q)
    found = stiffness(MODEL, q, ROD, CARTS)
    for i in range(2):
        for force in 20.0 * np.eye(3):
            moved = sprung(q[i], force, poses.T[i], poses.R[i])
            expected = np.linalg.solve(found.matrix[i], np.concatenate([force, np.zeros(3)]))[:3]
            np.testing.assert_allclose(moved, expected, atol=2e-3 * np.abs(expected).max())


def test_principal_stiffness_is_what_a_force_along_its_direction_meets() -> None:
    found = stiffness(MODEL, commands(6, seed=5), ROD, CARTS)
    for i in range(6):
        for k in range(3):
            along = found.directions[i, :, k]
            moved = np.linalg.solve(found.matrix[i], np.concatenate([along, np.zeros(3)]))[:3]
            np.testing.assert_allclose(moved, along / found.principal[i, k], atol=1e-15)
    assert (np.diff(found.principal, axis=1) >= 0.0).all()


def test_drives_that_do_not_give_way_leave_the_rods_alone() -> None:
    q = commands(3, seed=6)
    rigid, stiff = stiffness(MODEL, q, ROD), stiffness(MODEL, q, ROD, 1e16)
    np.testing.assert_allclose(rigid.matrix, stiff.matrix, rtol=1e-6, atol=1.0)
    assert (stiffness(MODEL, q, ROD, CARTS).principal < rigid.principal).all()


def test_a_leg_and_its_drive_are_springs_in_a_row() -> None:
    model = other("stewart")
    q = model.robot.home_q[None]
    row, one = stiffness(model, q, 6e7, 3e7), stiffness(model, q, 2e7)
    np.testing.assert_allclose(row.matrix, one.matrix, rtol=1e-9, atol=1e-3)


def test_a_stiffness_of_zero_is_refused() -> None:
    with pytest.raises(ModelError, match="stiffness"):
        stiffness(MODEL, commands(1), 0.0)
    with pytest.raises(ModelError, match="stiffness"):
        stiffness(MODEL, commands(1), 1e7, np.ones(2))


@pytest.mark.slow
def test_workspace_holds_just_the_points_whose_commands_are_in_range() -> None:
    T = MODEL.predict(ROBOT.home_q[None]).T[0]
    space = workspace(MODEL, T - 1.2, T + 1.2, (5, 5, 5))
    assert 0 < space.reachable.sum() < 125
    there = np.stack(np.meshgrid(*space.axes, indexing="ij"), axis=-1)
    np.testing.assert_allclose(MODEL.predict(space.q).T, there[space.reachable], atol=1e-10)
    assert (space.dexterity.limit >= 0.0).all()
    # Random commands in range land in cells about reachable points, or in cells at the workspace's edge.
    image = MODEL.predict(commands(200, seed=7)).T
    inside = image[(np.abs(image - T) < 0.3).all(axis=1)]
    near = np.array([np.abs(there[space.reachable] - point).max(axis=1).min() for point in inside])
    assert (near <= 0.31).all()


@pytest.mark.slow
def test_values_come_back_to_their_points() -> None:
    T = MODEL.predict(ROBOT.home_q[None]).T[0]
    space = workspace(MODEL, T - 0.8, T + 0.8, (3, 4, 5))
    table = space.on_grid(space.poses.T[:, 2])
    assert np.isnan(table[~space.reachable]).all()
    for k, z in enumerate(space.axes[2]):
        np.testing.assert_allclose(table[:, :, k][space.reachable[:, :, k]], z, atol=1e-10)


@pytest.mark.slow
def test_a_box_out_of_reach_is_refused() -> None:
    with pytest.raises(UnreachableError, match="no point"):
        workspace(MODEL, np.full(3, 50.0), np.full(3, 51.0), (2, 2, 2))
    with pytest.raises(ModelError, match="box"):
        workspace(MODEL, np.ones(3), np.zeros(3))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gantry_tau", "stewart"])
def test_default_commands_are_in_range_and_reached(name: str) -> None:
    model = MODEL if name == "gantry_tau" else other(name)
    q = default_commands(model, 50)
    assert q.shape == (50, model.robot.n_actuators)
    assert model.predict(q).reached.all()
    assert (q >= model.robot.lower).all()
    assert (q <= model.robot.upper).all()
    assert len(np.unique(q, axis=0)) == 50
