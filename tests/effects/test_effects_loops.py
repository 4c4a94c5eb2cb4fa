"""Effects in a robot with a loop that is no rod: a link that carries more than one joint moves them all, and bears them all."""

import numpy as np
import pinocchio as pin
import pytest
from effect_places import active, basis, moved, operating_points
from urdfs import joint, loop, own, robot_of

import gtpin
from gtpin.effects.chain_motions import OWN_WEIGHT, tip_loads
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links_at
from gtpin.kinematics.posture import home

EXPANSION = 2e-5


def parallelogram(size: float = 1.0) -> gtpin.Robot:
    """A column that turns; on it a parallelogram that keeps its plate level; all ``size`` times as large."""
    hinges = (
        ("waist", "base", "column", "0 0 0", "0 0 1", "0 0.05 0.2"),
        ("shoulder", "column", "crank", "0.1 0 0.3", "0 1 0", "0 0.02 0.25"),
        ("follow", "column", "rocker", "-0.1 0 0.3", "0 1 0", "0 0 0.25"),
        ("top", "crank", "plate", "0 0 0.5", "0 1 0", "0.1 0 0.05"),
    )
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'

    def sized(xyz: str) -> str:
        return " ".join(str(size * float(word)) for word in xyz.split())

    def heavy(centre: str) -> str:
        return f'<inertial><origin xyz="{sized(centre)}"/><mass value="{3.0 * size**3}"/>{inertia}</inertial>'

    parts = [joint(*names, sized(xyz), axis, body=heavy(centre)) for *names, xyz, axis, centre in hinges]
    flange = joint("flange", "plate", "tool0", sized("0.3 0 0.1"), kind="fixed")
    pin_ = loop("plate", sized("-0.2 0 0"), "rocker", sized("0 0 0.5"))
    return robot_of("parallelogram", *parts, flange, pin_, own(["waist", "shoulder"], "tool0"))


def nominal(robot: gtpin.Robot) -> OperatingPoints:
    return operating_points(6, kinematics=gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics)


def test_a_column_that_grows_lifts_both_joints_that_stand_on_it() -> None:
    at = nominal(parallelogram())
    c = np.array([EXPANSION, 0.0, 0.0])
    found = moved(at, active("thermal_links", "column", c, at.references))
    growth = EXPANSION * (at.covariate("temp_link") - 20.0)
    way = np.column_stack([0.1 * np.cos(at.q[:, 0]), 0.1 * np.sin(at.q[:, 0]), np.full(len(at), 0.3)])
    np.testing.assert_allclose(found[:, :3], growth[:, None] * way, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, 3:], 0.0, atol=1e-12)


def test_a_column_bears_all_that_stands_on_it() -> None:
    robot = parallelogram()
    at = nominal(robot)
    (column,) = links_at(robot, "column")
    loads = tip_loads(at, column)
    model, data, start = robot.model, robot.model.createData(), home(robot)
    for i, q in enumerate(at.q):
        posture = start.moved_to(q)
        pin.forwardKinematics(model, data, posture.configuration)
        shoulder = data.oMi[column.joint_id] * model.jointPlacements[column.tip + 1]
        weights = [
            (float(model.inertias[j].mass) * model.gravity.linear, data.oMi[j].act(model.inertias[j].lever))
            for j in range(1, model.njoints)
            if j != column.joint_id
        ]
        pushed = np.array([at.covariate(name)[i] for name in ("fx", "fy", "fz")])
        weights.append((at.covariate("payload")[i] * model.gravity.linear + pushed, posture.T))
        force = sum(weight for weight, _ in weights)
        moment = sum(np.cross(place - shoulder.translation, weight) for weight, place in weights)
        own = OWN_WEIGHT * float(model.inertias[column.joint_id].mass) * model.gravity.linear
        expected = np.concatenate([shoulder.rotation.T @ (force + own), shoulder.rotation.T @ moment])
        np.testing.assert_allclose(loads[i], expected, atol=1e-9)


@pytest.mark.parametrize("size", [0.4, 0.7])
def test_links_of_a_robot_of_one_shape_are_more_flexible_by_the_fourth_power_of_its_size(size: float) -> None:
    """E I goes with the fourth power of a beam's dimensions."""

    def typical(robot: gtpin.Robot) -> float:
        return float(basis("link_compliance", "arm", nominal(robot)).sigma[0])

    assert typical(parallelogram(size)) == pytest.approx(typical(parallelogram()) / size**4, rel=1e-9)


def test_links_of_a_large_robot_have_the_size_that_is_documented() -> None:
    at = nominal(parallelogram(3.0))
    assert basis("link_compliance", "arm", at).sigma[0] == pytest.approx(1e-5)
