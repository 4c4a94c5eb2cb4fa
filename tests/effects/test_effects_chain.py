"""Effects at joints and links of robots without rods: signatures, signs, units, and what can't be tested."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from effect_places import (
    ARM,
    ARM_FIT,
    EFFECTS,
    active,
    arm_points,
    arm_with,
    basis,
    drawn,
    given,
    moved,
    nominal_at,
    operating_points,
    setting,
    some,
)
from urdfs import joint, robot_of

import gtpin
from gtpin.effects.chain_motions import joint_frame
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.untestable import Untestable

G, LENGTH = 9.81, 0.8


def of_beam(axis: str = "0 0 1", payload: float = 0.0, mass: float = 0.0, warmer: float = 0.0) -> OperatingPoints:
    """One turning joint at the base's origin that carries a horizontal link along x, tool at its end; at two poses.

    The payload is twice as large at the second pose, and the link warmer.
    """
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    heavy = f'<inertial><origin xyz="{LENGTH / 2.0} 0 0"/><mass value="{mass}"/>{inertia}</inertial>'
    hinge = joint("hinge", "base", "rod", axis=axis, limit=3.0, body=heavy if mass else "")
    robot = robot_of("beam", hinge, joint("end", "rod", "tool0", f"{LENGTH} 0 0", kind="fixed"))
    told = {"payload": np.array([payload, 2.0 * payload]), "temp_link": np.array([20.0, 20.0 + warmer])}
    return nominal_at(robot, np.zeros((2, 1)), told)


@pytest.mark.parametrize(
    ("effect", "axis", "columns"),
    [
        ("joint_compliance", "0 1 0", [0]),
        ("joint_compliance", "0 -1 0", [0]),
        ("bearing_compliance", "0 0 1", [0, 2]),
    ],
)
def test_a_payload_pulls_a_horizontal_arm_down_by_compliance_moment_and_lever(
    effect: str, axis: str, columns: list[int]
) -> None:
    """Whatever the direction of a horizontal axis; about a vertical axis it is the bearing that tilts."""
    payload, compliance = 5.0, 2e-5
    at = of_beam(axis, payload)
    c = given(effect, "hinge", dict.fromkeys(columns, compliance), at)
    turn = compliance * np.array([payload, 2.0 * payload]) * G * LENGTH
    down = moved(at, active(effect, "hinge", c, at.references))[:, 2]
    np.testing.assert_allclose(down, -LENGTH * np.sin(turn), rtol=1e-4)


def test_the_last_link_bends_under_a_payload_as_a_cantilever_does() -> None:
    payload, flexibility = 5.0, 1.2e-5
    at = of_beam(payload=payload)
    found = moved(at, active("link_compliance", "rod", np.array([flexibility, 0.0, 0.0]), at.references))
    force = G * np.array([payload, 2.0 * payload])
    np.testing.assert_allclose(found[:, 2], -force * LENGTH**3 / 3.0 * flexibility, rtol=1e-6)  # F l^3 / (3 E I)
    # A tip that hangs down along -z is turned about +y where the beam is along +x.
    np.testing.assert_allclose(found[:, 4], force * LENGTH**2 / 2.0 * flexibility, rtol=1e-6)  # F l^2 / (2 E I)


def test_a_beams_own_weight_bends_it_as_an_evenly_spread_load_does() -> None:
    mass, flexibility = 4.0, 1.2e-5
    at = of_beam(mass=mass)
    found = moved(at, active("link_compliance", "rod", np.array([flexibility, 0.0, 0.0]), at.references))[:, 2]
    expected = -(mass * G / LENGTH) * LENGTH**4 / 8.0 * flexibility  # w l^4 / (8 E I)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_a_warm_link_is_longer_by_its_expansion() -> None:
    at = of_beam(warmer=10.0)
    found = moved(at, active("thermal_links", "rod", given("thermal_links", "rod", {0: 1.2e-5}, at), at.references))
    np.testing.assert_allclose(found[:, 0], [0.0, LENGTH * 1.2e-5 * 10.0], rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("site", ARM.sites)
def test_the_motion_of_an_axis_is_the_same_after_a_turn(site: str) -> None:
    at = arm_points(5, seed=2, fixed=ARM_FIT.references)
    turned = at.q.copy()
    turned[:, ARM.sites.index(site)] += 2.0 * np.pi
    again = OperatingPoints(at.kinematics, turned, at.poses, at.covariates, ARM_FIT.references)
    c = some("axis_motion", site, at)
    one, other = (basis("axis_motion", site, where).displacement(where) @ c for where in (at, again))
    np.testing.assert_allclose(other, one, rtol=0, atol=1e-12)
    assert np.ptp(one, axis=0).max() > 1e-6


def test_the_axis_of_a_joint_does_not_turn_the_joint_itself() -> None:
    at = arm_points(5, seed=2, fixed=ARM_FIT.references)
    for site in ARM.sites:
        frame = joint_frame(at, site)
        ((index, twist),) = basis("axis_motion", site, at).placements
        assert index == frame.index
        np.testing.assert_allclose(np.einsum("nim,i->nm", twist[:, 3:], frame.axis), 0.0, atol=1e-15)


@pytest.mark.parametrize(
    "name", ["encoder_scale", "linearity", "zero_shift", "backlash", "joint_clearance", "cross_coupling"]
)
def test_travel_of_a_turning_joint_is_told_in_radians(name: str) -> None:
    found = EFFECTS[name].parameters_at(ARM, "elbow", some(name, "elbow", ARM_FIT), setting(name, ARM_FIT.references))
    assert {unit for _, unit in found.values()} <= {"rad", "rad/rad"}


def test_sliding_joints_have_units_of_length_and_motions_of_a_slide() -> None:
    slide = arm_with('name="elbow" type="revolute"', 'name="elbow" type="prismatic"')
    at = operating_points(30, kinematics=drawn(slide))
    units = {
        name: EFFECTS[name].parameters_at(slide, "elbow", some(name, "elbow", at), None)
        for name in ("linearity", "joint_compliance", "axis_motion")
    }
    assert {unit for _, unit in units["linearity"].values()} == {"m"}
    assert {unit for _, unit in units["joint_compliance"].values()} == {"m/N"}
    assert {name: unit for name, (_, unit) in units["axis_motion"].items()} == {"straightness": "m", "rotation": "rad"}


@pytest.mark.parametrize("name", ["joint_compliance", "joint_clearance"])
def test_a_vertical_first_joint_carries_nothing_under_gravity_alone(name: str) -> None:
    kinematics = gtpin.Model(gtpin.Geometry.nominal(ARM)).kinematics
    alone = operating_points(20, kinematics=kinematics, without=("fx", "fy", "fz"))
    assert EFFECTS[name].untestable(alone, "waist") == Untestable("no_load")
    assert EFFECTS[name].untestable(alone, "shoulder") in (None, Untestable("one_sign"))
    assert EFFECTS[name].untestable(operating_points(20, kinematics=kinematics), "waist") is None  # pushed at


def test_without_masses_and_loads_no_effect_of_loads_can_be_tested() -> None:
    light = arm_with(r"<inertial>.*?</inertial>", "")
    at = operating_points(20, kinematics=drawn(light), without=("fx", "fy", "fz", "payload"))
    for name in ("joint_compliance", "bearing_compliance", "joint_clearance", "link_compliance"):
        for site in EFFECTS[name].sites(light):
            assert EFFECTS[name].untestable(at, site) == Untestable("no_masses"), (name, site)


def test_a_load_that_keeps_its_sign_shows_no_play() -> None:
    at = of_beam("0 1 0", 5.0)
    assert EFFECTS["joint_clearance"].untestable(at, "hinge") == Untestable("one_sign")


def test_effects_of_a_chain_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    references = ARM_FIT.references
    at = arm_points(9, seed=3, fixed=references)
    effects = tuple(
        active(name, site, some(name, site, at), references)
        for name, site in (
            ("joint_compliance", "shoulder"),
            ("bearing_compliance", "waist"),
            ("axis_motion", "elbow"),
            ("link_compliance", "arm"),
            ("linearity", "wrist1"),
            ("thermal_links", "forearm"),
        )
    )
    model = gtpin.Model(at.kinematics.geometry, effects=effects)
    gtpin.write_model(model, tmp_path / "model")
    again = gtpin.read_model(tmp_path / "model")
    one, other = (m.predict(at.q, at.covariates) for m in (model, again))
    np.testing.assert_allclose(other.minus(one), 0.0, rtol=0, atol=1e-12)


def test_a_link_whose_joints_meet_in_one_point_bends_about_its_root() -> None:
    robot = gtpin.load_robot("panda")
    q = np.random.default_rng(3).uniform(robot.lower, robot.upper, (5, robot.n_actuators))
    at = nominal_at(robot, q)
    flexibility = 1.2e-5
    found = moved(at, active("link_compliance", "panda_link5", np.array([flexibility, 0.0, 0.0]), at.references))
    model = robot.model
    joint = model.getJointId("panda_joint5")
    length = 2.0 * np.linalg.norm(model.inertias[joint].lever)
    data = model.createData()
    for i in range(len(q)):
        # Weights of everything beyond the link, and 3/8 of its own at the end of the beam (OWN_WEIGHT).
        pin.forwardKinematics(model, data, robot.with_commands(robot.neutral, q[i]))
        here = data.oMi[joint]
        moment, force = np.zeros(3), 3.0 / 8.0 * model.inertias[joint].mass * model.gravity.linear
        for k in model.subtrees[joint]:
            if k != joint:
                weight = model.inertias[k].mass * model.gravity.linear
                moment += np.cross(data.oMi[k].act(model.inertias[k].lever) - here.translation, weight)
                force = force + weight
        centre = here.rotation @ model.inertias[joint].lever
        # From the side of the centre of mass to the joint.
        u = -np.sign(centre @ here.rotation[:, 2]) * here.rotation[:, 2]
        bent = moment - u * (u @ moment)
        turn = flexibility * (bent * length + np.cross(u, force - u * (u @ force)) * length**2 / 2.0)
        across = force - u * (u @ force)
        shift = flexibility * (across * length**3 / 3.0 + np.cross(bent, u) * length**2 / 2.0)
        np.testing.assert_allclose(found[i, 3:], turn, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(
            found[i, :3], shift + np.cross(turn, at.poses.T[i] - here.translation), rtol=1e-5, atol=2e-11
        )
