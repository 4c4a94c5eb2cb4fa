"""The plant makes cases of every shipped machine: closed, in balance, each effect where the machine can have it."""

from functools import cache

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.build import known_robot
from gtpin.bench.simulator.causes.kinds import kind, listed, unlisted
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.visits import plan
from gtpin.kinematics.kinematics import Kinematics
from gtpin.kinematics.posture import rod_forces

NAMES = sorted(set(gtpin.robot_names()) - {"gantry_tau"})
STATION = np.array([1.5, -7.0, 0.3])
GUIDES = {"straightness", "cart_rotation", "cart_compliance"}


@cache
def plant_of(name: str) -> Response:
    rng = np.random.default_rng(0)
    machine = RodMachine.draw(known_robot(name), rng)
    return Response(
        machine, plan(machine, 60, 10, SimulatedConditions(sessions=3, push=150.0, warming=1.5), rng), STATION
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_each_effect_that_a_machine_can_have_moves_its_poses_and_leaves_it_closed(name: str) -> None:
    plant, robot = plant_of(name), known_robot(name)
    active = []
    for k in (*listed(robot), *unlisted(robot)):
        site = k.sites(robot)[-1]
        cause = k.at(robot, site, np.random.default_rng(1))
        size = np.sqrt((plant.displacement([(cause, 1.0)]) ** 2).sum(axis=1).mean())
        assert 2e-8 < size < 2e-3, (k.name, site)
        active.append((cause, 1.0))
    now, deviation = plant.settled(active)
    ends = plant.machine.ends(plant.visits.q, deviation)
    joints = now.poses.T[:, None] + ends.P @ np.swapaxes(now.poses.R, 1, 2)
    assert np.abs(np.linalg.norm(joints - ends.C, axis=2) - ends.L).max() < 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_guideways_err_only_where_there_are_any(name: str) -> None:
    robot = known_robot(name)
    carried = {rod.carrier for rod in robot.rods}
    sliding = [s for i, s in enumerate(robot.sites) if i in carried and not robot.revolute[i]]
    levers = any(sum(rod.carrier == robot.sites.index(site) for rod in robot.rods) > 1 for site in sliding)
    names = {k.name for k in listed(robot)}
    assert GUIDES - names == (set() if levers else {"cart_rotation"} if sliding else GUIDES)
    if sliding:
        assert list(kind("straightness", robot).sites(robot)) == sliding
    else:
        with pytest.raises(gtpin.GtpinError, match="straightness can't be on"):
            kind("straightness", robot)
    assert kind("linearity", robot).sites(robot) == robot.sites


@pytest.mark.parametrize("name", gtpin.robot_names())
def test_forces_are_those_of_the_package_s_statics_where_masses_are_nominal(name: str) -> None:
    robot = known_robot(name)
    geometry = gtpin.Geometry.nominal(robot)
    masses = [sum(robot.model.inertias[j].mass for j in _bodies(robot, i)) for i in range(6)]
    plate = robot.tcp_placement.inverse() * robot.model.inertias[robot.tcp_joint]
    machine = RodMachine(geometry, float(plate.mass), np.array(plate.lever), np.array(masses))
    plant = Response(machine, plan(machine, 40, 5, SimulatedConditions(push=100.0), np.random.default_rng(2)), STATION)
    visits = plant.visits
    own, there = Kinematics(geometry), plant.ideal.poses
    poses = own.forward(visits.q)
    np.testing.assert_allclose(there.T, poses.T, rtol=0, atol=1e-11)
    expected = rod_forces(own, visits.q, poses, visits.force, visits.payload)
    np.testing.assert_allclose(plant.ideal.forces, expected, rtol=1e-7, atol=1e-6)


def _bodies(robot: gtpin.Robot, rod: int) -> list[int]:
    model, joint = robot.model, robot.rods[rod].joint_id
    return [j for j in range(1, model.njoints) if joint in model.supports[j]]


@pytest.mark.parametrize("name", NAMES)
def test_drives_press_where_the_principle_of_virtual_work_says(name: str) -> None:
    """Work of the tool's push on the platform's motion by one drive is that of the rods against the drive."""
    plant = plant_of(name)
    now, machine = plant.ideal, plant.machine
    push = np.random.default_rng(3).standard_normal((len(now), 6)) * [100, 100, 100, 10, 10, 10]
    motion = machine.command_jacobian(now.q, now.poses)
    forces = now.held(push)
    for cart in range(machine.n_carts):
        mine = machine.driver == cart
        work = np.einsum("ni,ni->n", push, motion[:, :, cart]) / machine.scale[mine][0]
        if machine.robot.revolute[cart]:
            lever = now.ends.C[:, mine] - machine.robot.actuators[cart].origin
            arm = np.linalg.norm(np.cross(machine.tracks[cart], lever), axis=2).mean(axis=1)
            pressing = now.pressing(cart, forces) * arm
        else:
            pressing = now.pressing(cart, forces)
        np.testing.assert_allclose(work, pressing, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_commands_lie_in_the_ranges_and_move_the_tcp_all_over(name: str) -> None:
    plant = plant_of(name)
    q, robot = plant.visits.q, plant.machine.robot
    assert ((q >= robot.lower) & (q <= robot.upper)).all()
    assert (np.ptp(q, axis=0) > 0.4 * (robot.upper - robot.lower)).all()
    assert plant.ideal.poses.reached.all()
    assert (np.abs(plant.ideal.places) <= 1.3 * 0.8).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_case_can_be_made_and_its_energy_is_what_was_asked(name: str) -> None:
    case = make_case(4, effects=[("linearity", None)], noncentrality=500.0, poses=60, held_out=10, robot=name)
    (truth,) = case.effects
    assert truth.noncentrality == pytest.approx(500.0, rel=2e-3)
    assert case.dataset.robot == name
    assert truth.site in known_robot(name).sites


def test_what_a_machine_can_not_have_is_one_line() -> None:
    for effects in ([("straightness", None)], [("cart_rotation", "leg1")]):
        with pytest.raises(gtpin.GtpinError, match="can't be") as error:
            make_case(0, effects=effects, robot="stewart")
        assert "\n" not in str(error.value)
