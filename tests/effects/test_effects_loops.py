"""Effects in a robot with a loop that is no rod: a link that carries more than one joint moves them all, and bears them all."""

import numpy as np
import pinocchio as pin
import pytest
from chain_places import robot_of
from effect_places import active, basis, moved

import gtpin
from gtpin.effects.chain_motions import OWN_WEIGHT, tip_loads
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links_at
from gtpin.kinematics.chain_kinematics import ChainKinematics
from gtpin.kinematics.posture import home

EXPANSION, GROWTH = 2e-5, 10.0


def _link(name: str, mass: float, centre: str) -> str:
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    return f'<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>{inertia}</inertial></link>'


def _hinge(name: str, parent: str, child: str, xyz: str, axis: str) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
    )


def parallelogram(size: float = 1.0) -> gtpin.Robot:
    """A column that turns; on it a parallelogram that keeps its plate level; all ``size`` times as large."""
    masses = {"column": "0 0.05 0.2", "crank": "0 0.02 0.25", "rocker": "0 0 0.25", "plate": "0.1 0 0.05"}
    hinges = (
        ("waist", "base", "column", "0 0 0", "0 0 1"),
        ("shoulder", "column", "crank", "0.1 0 0.3", "0 1 0"),
        ("follow", "column", "rocker", "-0.1 0 0.3", "0 1 0"),
        ("top", "crank", "plate", "0 0 0.5", "0 1 0"),
    )

    def sized(xyz: str) -> str:
        return " ".join(str(size * float(word)) for word in xyz.split())

    return robot_of(
        '<robot name="parallelogram"><link name="base"/>'
        + "".join(_link(name, 3.0 * size**3, sized(centre)) for name, centre in masses.items())
        + "".join(_hinge(name, parent, child, sized(xyz), axis) for name, parent, child, xyz, axis in hinges)
        + f'<link name="tool0"/><joint name="flange" type="fixed"><parent link="plate"/><child link="tool0"/>'
        f'<origin xyz="{sized("0.3 0 0.1")}"/></joint>'
        f'<loop_joint name="pin" type="spherical"><link1 link="plate" xyz="{sized("-0.2 0 0")}"/>'
        f'<link2 link="rocker" xyz="{sized("0 0 0.5")}"/></loop_joint>'
        '<gtpin><actuator joint="waist"/><actuator joint="shoulder"/><platform link="tool0"/></gtpin></robot>'
    )


def operating_points(kinematics: ChainKinematics, count: int = 6) -> OperatingPoints:
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.6, 0.6, (count, 2))
    told = {
        "temp_link": 20.0 + GROWTH * rng.uniform(0.5, 1.0, count),
        "payload": rng.uniform(0.0, 3.0, count),
        "time": np.arange(count, dtype=float),
        "fx": rng.normal(0.0, 20.0, count),
        "fy": rng.normal(0.0, 20.0, count),
        "fz": rng.normal(0.0, 20.0, count),
    }
    return OperatingPoints(kinematics, q, kinematics.forward(q), told)


def test_a_column_that_grows_lifts_both_joints_that_stand_on_it() -> None:
    at = operating_points(ChainKinematics(gtpin.Geometry.nominal(parallelogram())))
    c = np.array([EXPANSION, 0.0, 0.0])
    found = moved(at, active("thermal_links", "column", c, at.references))
    growth = EXPANSION * (at.covariate("temp_link") - 20.0)
    way = np.column_stack([0.1 * np.cos(at.q[:, 0]), 0.1 * np.sin(at.q[:, 0]), np.full(len(at), 0.3)])
    np.testing.assert_allclose(found[:, :3], growth[:, None] * way, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, 3:], 0.0, atol=1e-12)


def test_a_column_bears_all_that_stands_on_it() -> None:
    robot = parallelogram()
    at = operating_points(ChainKinematics(gtpin.Geometry.nominal(robot)))
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
        return float(
            basis("link_compliance", "arm", operating_points(ChainKinematics(gtpin.Geometry.nominal(robot)))).sigma[0]
        )

    assert typical(parallelogram(size)) == pytest.approx(typical(parallelogram()) / size**4, rel=1e-9)


def test_links_of_a_large_robot_have_the_size_that_is_documented() -> None:
    at = operating_points(ChainKinematics(gtpin.Geometry.nominal(parallelogram(3.0))))
    assert basis("link_compliance", "arm", at).sigma[0] == pytest.approx(1e-5)
