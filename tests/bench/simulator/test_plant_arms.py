"""Open chains of the plant: where they are and what they carry, by Pinocchio and by the book."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from plant_machines import a_plant, nominal, urdf_file

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.poses import exp, log
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise
from gtpin.bench.simulator.tree import TreeFrame, moved, read_urdf

ROBOT, ARM = nominal("seven")


def test_a_body_s_mass_is_that_of_its_link_and_of_all_that_is_fixed_to_it() -> None:
    for joint in read_urdf(ROBOT.description.xml).joints:
        inertia = ROBOT.model.inertias[ROBOT.model.getJointId(joint.name)]
        assert joint.mass == pytest.approx(inertia.mass)
        np.testing.assert_allclose(joint.centre, inertia.lever, atol=1e-12)


def test_a_mimicking_joint_follows_and_one_that_is_not_commanded_rests() -> None:
    links = "".join(f'<link name="{name}"/>' for name in ("base", "a", "b", "c"))
    joint = '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/>'
    joint += '<origin xyz="1 0 0"/><axis xyz="0 0 1"/>{3}</joint>'
    xml = (
        f'<robot name="m">{links}'
        + joint.format("ja", "base", "a", "")
        + joint.format("jb", "a", "b", '<mimic joint="ja" multiplier="-2" offset="0.3"/>')
        + joint.format("jc", "b", "c", "")
        + "</robot>"
    )
    tree = read_urdf(xml)
    none, zeros = np.zeros((0, 3, 3)), np.zeros(3)
    arm = Arm(
        "m", tree.joints, tree.links["c"], (0,), (), (), (), none, none, zeros[:1], zeros, zeros, np.full(6, 5e-4)
    )
    machine = ArmMachine.of(arm)
    q = np.array([[0.4]])
    np.testing.assert_allclose(machine.bodies(q)[0].x, [[0.4, -0.5, 0.0]])
    angle = 0.4 - 0.5
    T = np.array([1.0 + np.cos(0.4) + np.cos(angle), np.sin(0.4) + np.sin(angle), 0.0])
    np.testing.assert_allclose(machine.predict(q).T[0], T, atol=1e-14)


def test_commands_keep_the_arm_in_front_of_its_base_above_the_floor_and_spread_it_out() -> None:
    plant = a_plant("seven", 300)
    robot, q, T = plant.machine.robot, plant.visits.q, plant.ideal.tcp.T
    middle, half = (robot.lower + robot.upper) / 2.0, (robot.upper - robot.lower) / 2.0
    assert (np.abs(q - middle) <= 0.6 * half + 1e-6).all()
    assert T[:, 2].min() > 0.0
    assert (np.abs(np.arctan2(T[:, 1], T[:, 0])) < 2.01).all()
    assert (np.ptp(q, axis=0) > 0.7 * 1.2 * half).all()
    assert (np.ptp(T, axis=0) > 0.5).all()


def test_payloads_and_pushes_are_those_of_the_robot_s_size() -> None:
    assert 3.0 <= ARM.capacity <= 5.0  # moves 21.2 kg
    drawn = [SimulatedConditions.draw(np.random.default_rng(s), ("force", "payload"), ARM.capacity) for s in range(30)]
    assert {max(c.payloads) for c in drawn} == {ARM.capacity}
    assert max(c.push for c in drawn) <= 250.0 * ARM.capacity / 20.0


@pytest.mark.slow
def test_a_free_frame_and_target_change_what_is_written_and_nothing_else(tmp_path: Path) -> None:
    file = urdf_file("seven", tmp_path)
    asked = {"effects": [("backlash", "elbow")], "noncentrality": 500.0, "poses": 60, "held_out": 10, "robot": file}
    plain, free = (make_case(3, noise=SimulatedNoise(free=f, free_target=f), **asked) for f in (False, True))
    assert free.dataset.instrument.frame == "free"
    assert free.dataset.instrument.target == "free"
    assert plain.dataset.instrument.target == "tcp"
    assert free.effects[0].noncentrality == pytest.approx(500.0, rel=2e-3)
    # One constant placement on either side of the TCP's poses: X_free = A X_plain B, effects apart.
    machine, q = free.machine, free.visits.q
    assert 0.0 < np.abs(machine.target.p).max() < 0.07
    bare = replace(machine, target=ArmMachine.of(machine.robot).target).predict(q)
    seen = machine.predict(q)
    B = np.swapaxes(bare.R, 1, 2) @ seen.R
    assert np.abs(B - B[0]).max() < 1e-12
    A = free.true.R @ np.swapaxes(seen.R, 1, 2)
    assert np.abs(log(A @ A[0].T)).max() < 5e-3  # the effects, the weak others and the repeatability
    assert np.abs(log(A)).max() > 0.01


@pytest.mark.slow
def test_a_case_of_an_arm_is_made_again_the_same_and_asks_for_what_it_can_have(tmp_path: Path) -> None:
    file = urdf_file("seven", tmp_path)
    one, again, other = (make_case(seed, robot=file, poses=50, held_out=10) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.dataset.position, again.dataset.position)
    assert one.dataset.position.shape != other.dataset.position.shape or (one.dataset.q != other.dataset.q).any()
    for effects in ([("straightness", None)], [("backlash", "tool0")], [("magic", None)]):
        with pytest.raises(gtpin.GtpinError):
            make_case(0, effects=effects, robot=file)
    with pytest.raises(gtpin.GtpinError, match="free target"):
        make_case(0, noise=SimulatedNoise(free_target=True), robot="gantry_tau")


@pytest.mark.parametrize("size", [1e-9, 5e-4, 0.9e-2, 1.1e-2, 1.0])
def test_a_placement_moves_by_the_exponential_of_its_twist(size: float) -> None:
    twist = size * np.array([0.3, -0.5, 0.2, 0.6, 0.1, -0.7])
    R, p = exp([0.2, 0.4, 1.0]), np.array([0.1, 0.2, -0.4])
    expected, found = pin.SE3(R, p) * pin.exp6(twist), moved(TreeFrame(-1, R, p), twist)
    np.testing.assert_allclose(found.R, expected.rotation, atol=1e-14)
    np.testing.assert_allclose(found.p, expected.translation, atol=1e-13)
