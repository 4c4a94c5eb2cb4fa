"""Effects in a robot with a loop that is no rod: a link that carries more than one joint moves them all, and bears them all."""

import numpy as np
import pinocchio as pin
import pytest
from effect_places import basis, drawn, operating_points
from growing_links import parallelogram as urdf_of

import gtpin
from gtpin.effects.chain_motions import OWN_WEIGHT, tip_loads
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links_at
from gtpin.kinematics.posture import home
from gtpin.robot.description import RobotDescription


def parallelogram(size: float = 1.0) -> gtpin.Robot:
    return gtpin.Robot(RobotDescription.parse(urdf_of(size)))


def nominal(robot: gtpin.Robot) -> OperatingPoints:
    return operating_points(6, kinematics=gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics)


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


@pytest.mark.parametrize(("effect", "site"), [("cart_compliance", "cart1"), ("link_compliance", "arm")])
def test_light_robots_with_rods_deflect_as_far_under_their_usual_load_as_others(effect: str, site: str) -> None:
    def typical(robot: str, payload: float) -> tuple[float, float]:
        zeros = np.zeros(30)
        at = operating_points(kinematics=drawn(robot), payload=zeros + payload, fx=zeros, fy=zeros, fz=zeros)
        usual = float(np.sqrt((at.force**2).mean()))
        return float(basis(effect, site, at).sigma[0]), usual

    (size, force), (heavier, more) = typical("linear_delta", 0.0), typical("linear_delta", 4.0)
    assert more > 1.2 * force
    assert size * force == pytest.approx(heavier * more, rel=1e-6)
    assert typical("gantry_tau", 0.0)[0] == typical("gantry_tau", 20.0)[0] < heavier
