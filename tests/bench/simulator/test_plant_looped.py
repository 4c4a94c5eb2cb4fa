"""Machines that are no rods: what effects do to them, by closed postures, virtual work, and Pinocchio."""

from dataclasses import replace

import numpy as np
import pytest
from plant_machines import LOOPED, ROBOTS, a_plant, nominal

import gtpin
from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.causes.kinds import ARM_CATALOGUE, kind, listed, unlisted
from gtpin.bench.simulator.poses import VirtualPoses
from gtpin.bench.simulator.simulate import TrueRobot
from gtpin.bench.simulator.situation import ArmSituation
from gtpin.bench.simulator.tree import TreeFrame
from gtpin.errors import UnreachableError
from gtpin.kinematics.kinematics import Kinematics

NAMES = tuple(ROBOTS)


def by_pinocchio(machine: ArmMachine) -> Kinematics:
    """The package's kinematics of the same geometry."""
    geometry = gtpin.Geometry.nominal(gtpin_robot(machine))
    places = [*(f"placement[{machine.robot.joints[j].name}]" for j in machine.robot.placed), "platform"]
    twists = dict(zip(places, [*machine.twists, machine.tool], strict=True))
    twists |= {f"anchor[{end}]": off for end, off in zip(machine.robot.ends, machine.ends, strict=True)}
    values = [
        twists[name.rpartition(".")[0]][["x", "y", "z", "rx", "ry", "rz"].index(name.rpartition(".")[2])]
        for name in geometry.names
    ]
    return Kinematics(geometry.with_values(np.array(values)))


def gtpin_robot(machine: ArmMachine) -> gtpin.Robot:
    return next(nominal(name)[0] for name in NAMES if nominal(name)[1] is machine.robot)


@pytest.mark.parametrize("name", NAMES)
def test_a_machine_without_effects_has_all_deviations_of_its_geometry(name: str) -> None:
    geometry = gtpin.Geometry.nominal(nominal(name)[0])
    drawn = geometry.tolerance * np.random.default_rng(1).standard_normal(len(geometry.values))
    geometry = geometry.with_values(geometry.values + drawn)
    q = a_plant(name).visits.q[:4]
    assert off(TrueRobot(geometry).predict(q), Kinematics(geometry).forward(q)) < 1e-9


def off(found: VirtualPoses, expected: object) -> float:
    return float(np.abs(found.minus(VirtualPoses(expected.T, expected.R))).max())  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", LOOPED)
def test_the_contract_s_effects_are_at_commanded_joints_and_links_that_reach_to_another(name: str) -> None:
    robot, arm = nominal(name)
    links = tuple(arm.link_sites[c] for c in range(arm.n_actuators))
    wanted = {k.name for k in ARM_CATALOGUE} - ({"cross_coupling"} if arm.n_actuators == 1 else set())
    assert {k.name for k in listed(arm)} == wanted
    assert kind("joint_compliance", arm).sites(arm) == robot.sites
    assert kind("link_compliance", arm).sites(arm) == ("arm", *links)
    assert kind("worn_pin", arm) in unlisted(arm)
    followers = {robot.model.names[j] for j in robot.moving_joints} - set(robot.sites)
    assert set(kind("worn_pin", arm).sites(arm)) == followers


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_poses_of_a_drawn_machine_are_pinocchio_s_and_so_are_their_derivatives(name: str) -> None:
    plant = a_plant(name)
    machine, q = plant.machine, plant.visits.q[:8]
    theirs = by_pinocchio(machine)
    found = machine.predict(q)
    assert off(found, theirs.forward(q)) < 1e-9
    own = machine.by_tolerance(q, found)
    geometry = theirs.geometry
    placed = [*(f"placement[{machine.robot.joints[j].name}]" for j in machine.robot.placed), "platform"]
    ends = [f"anchor[{end}]" for end in machine.robot.ends]
    order = [f"{place}.{axis}" for place in placed for axis in ("x", "y", "z", "rx", "ry", "rz")]
    order += [f"{end}.{axis}" for end in ends for axis in "xyz"]
    theirs_by = theirs.geometry_jacobian(q, theirs.forward(q)) * geometry.tolerance
    np.testing.assert_allclose(own, theirs_by[:, :, [geometry.names.index(name) for name in order]], atol=2e-7)


@pytest.mark.parametrize("name", NAMES)
def test_a_drive_bears_what_the_energy_of_all_weights_and_of_the_push_changes_by(name: str) -> None:
    plant = a_plant(name)
    machine, visits = plant.machine, plant.visits
    now, step = plant.ideal, 1e-5

    def work(q: np.ndarray) -> np.ndarray:
        at = ArmSituation.of(machine, replace(visits, q=q), near=now.bodies)
        centres = at.bodies.p + np.einsum("njik,jk->nji", at.bodies.R, machine.centres)
        weights = np.einsum("nji,i,j->n", centres, machine.robot.gravity, machine.masses)
        on_tool = visits.payload[:, None] * machine.robot.gravity + visits.force
        return np.asarray(weights + np.einsum("ni,ni->n", at.tcp.T, on_tool))

    for c in range(machine.n_carts):
        h = step * np.eye(machine.n_carts)[c]
        slope = (work(visits.q + h) - work(visits.q - h)) / (2.0 * step)
        # What play takes up across the plane of a drawn machine's loop costs no work only to first order.
        scale = machine.usual_load(c)
        np.testing.assert_allclose(now.load(c), slope, atol=(1e-6 if name == "spatial" else 2e-5) * scale)


@pytest.mark.parametrize("name", LOOPED)
def test_what_followers_bear_about_their_own_axes_is_nothing(name: str) -> None:
    now = a_plant(name).ideal
    for j in now.machine.robot.passive:
        assert np.abs(now._along(j, *now._loads)).max() < 1e-9


@pytest.mark.parametrize("name", LOOPED)
def test_loads_of_the_joints_are_the_package_s_by_recursive_newton_and_euler(name: str) -> None:
    robot, arm = nominal(name)
    machine, visits = ArmMachine.of(arm), a_plant(name).visits
    now = ArmSituation.of(machine, visits)
    kinematics = Kinematics(gtpin.Geometry.nominal(robot))
    theirs = kinematics.loads(visits.q, kinematics.forward(visits.q), visits.force, visits.payload).joints
    for j, joint in enumerate(arm.joints):
        force, moment = now.carried_by(j)
        expected = theirs[:, robot.model.getJointId(joint.name) - 1]
        seat = now.bodies.seats[:, j]
        np.testing.assert_allclose(np.einsum("nji,nj->ni", seat, force), expected[:, :3], atol=1e-7)
        np.testing.assert_allclose(np.einsum("nji,nj->ni", seat, moment), expected[:, 3:], atol=1e-7)


@pytest.mark.parametrize("name", LOOPED)
def test_a_joint_that_is_off_is_one_that_is_commanded_or_placed_elsewhere(name: str) -> None:
    plant = a_plant(name)
    machine, q, near = plant.machine, plant.visits.q, plant.ideal.bodies
    for c, j in enumerate(machine.robot.counted):
        travel, shifted = machine.unbent(len(q)), machine.unbent(len(q))
        travel.travel[:, c] = 1e-3
        at = machine.bodies(q, travel, near)[0].at(machine.seen)
        assert off(at, machine.predict(q + 1e-3 * np.eye(machine.n_carts)[c])) < 1e-10
        shift = np.array([1e-3, -2e-3, 5e-4])
        shifted.axis[:, c, :3] = shift
        joint = machine.true.joints[j]
        other = (*machine.true.joints[:j], replace(joint, p=joint.p + joint.R @ shift), *machine.true.joints[j + 1 :])
        at = machine.bodies(q, shifted, near)[0].at(machine.seen)
        elsewhere = replace(machine.true, joints=other)
        assert off(at, ArmMachine.of(elsewhere).predict(q)) < 1e-10


def test_what_sits_beside_a_link_s_end_moves_with_it_as_one_body() -> None:
    """The column of the parallelogram carries two joints: between them nothing changes, and the plate tilts as it does."""
    plant = a_plant("parallelogram")
    machine, q, near = plant.machine, plant.visits.q, plant.ideal.bodies
    turn = np.array([1e-3, 2e-3, -5e-4])
    bent = machine.unbent(len(q))
    bent.tip[:, 0] = np.concatenate([[1e-4, -2e-4, 3e-4], turn])
    names = [joint.name for joint in machine.true.joints]
    found, bending = machine.bodies(q, bent, near)
    a, b, plate = names.index("shoulder"), names.index("follow"), names.index("top")
    np.testing.assert_allclose(
        np.linalg.norm(found.p[:, a] - found.p[:, b], axis=1),
        np.linalg.norm(near.p[:, a] - near.p[:, b], axis=1),
        atol=1e-12,
    )
    column = near.R[:, names.index("waist")]
    tilted = found.at(TreeFrame(plate, np.eye(3), np.zeros(3)), bending).minus(
        near.at(TreeFrame(plate, np.eye(3), np.zeros(3)))
    )
    np.testing.assert_allclose(tilted[:, 3:], column @ turn, atol=1e-5)


def test_deviations_that_open_the_loops_are_one_line() -> None:
    plant = a_plant("spatial")
    torn = plant.machine.unbent(len(plant.visits))
    torn.axis[:, 0, :3] = 3.0
    with pytest.raises(UnreachableError, match="open the loops"):
        plant.ideal.settled_by(torn)
    far = {"placement[rocker_joint]": np.array([5.0, 0.0, 0.0, 0.0, 0.0, 0.0])}
    assert not ArmMachine.of(nominal("spatial")[1], far).predict(np.array([[0.1]])).reached.any()


@pytest.mark.parametrize("name", LOOPED)
def test_commands_are_all_over_the_ranges_where_the_loops_lead_the_tcp_well(name: str) -> None:
    machine, q = a_plant(name, 200).machine, a_plant(name, 200).visits.q
    half = (machine.robot.upper - machine.robot.lower) / 2.0
    assert (np.abs(q - (machine.robot.upper + machine.robot.lower) / 2.0) <= half).all()
    assert (np.ptp(q, axis=0) > half).all()
    home = np.linalg.norm(machine.command_jacobian(home_q := machine.robot.home_q[None], machine.predict(home_q)))
    assert (np.linalg.norm(machine.command_jacobian(q, machine.predict(q)), axis=(1, 2)) <= 1.5 * home).all()
    assert (np.abs(machine.places(q)) <= 0.8 + 1e-9).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_drawn_machine_moves_as_its_jacobian_by_the_commands_says(name: str) -> None:
    plant = a_plant(name)
    machine, q, step = plant.machine, plant.visits.q[:5], 1e-5
    found = machine.command_jacobian(q, machine.predict(q))
    theirs = by_pinocchio(machine)
    np.testing.assert_allclose(found, theirs.command_jacobian(q, theirs.forward(q))[:, :6], atol=1e-6)
    for c in range(machine.n_carts):
        h = step * np.eye(machine.n_carts)[c]
        slope = machine.predict(q + h).minus(machine.predict(q - h)) / (2.0 * step)
        np.testing.assert_allclose(found[:, :, c], slope, atol=1e-6)
