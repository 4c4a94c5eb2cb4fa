"""The machine: its closed chain, its forces, what its effects do."""

import numpy as np
import pytest
from plant_machines import a_plant, cause, plant_robot

from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.causes.kinds import CATALOGUE, UNLISTED
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.rod_machine import RodMachine

ROBOT = plant_robot("gantry_tau")
PLACES = [(k.name, site) for k in (*CATALOGUE, *UNLISTED) for site in k.sites(ROBOT)]


PLANT = a_plant("gantry_tau", 90)


def travel(name: str, plant: Response, seed: int = 0) -> np.ndarray:
    return cause("gantry_tau", name, "cart2", seed)(plant.ideal).travel[:, 1]


def test_every_effect_of_the_contract_is_there_and_ten_that_are_not() -> None:
    assert len(UNLISTED) >= 8
    assert not {k.name for k in CATALOGUE} & {k.name for k in UNLISTED}


def test_the_chain_is_closed_with_every_effect_on() -> None:
    active = [(cause("gantry_tau", name, site), 1.0) for name, site in PLACES]
    now, deviation = PLANT.settled(active)
    ends = PLANT.machine.ends(PLANT.visits.q, deviation)
    for i in range(6):
        seat = ends.C[:, i]
        joint = now.poses.T + np.einsum("nij,nj->ni", now.poses.R, ends.P[:, i])
        assert np.abs(np.linalg.norm(joint - seat, axis=1) - ends.L[:, i]).max() < 1e-13


def test_masses_are_off_nominal_by_some_per_cent() -> None:
    masses = np.array([RodMachine.draw(ROBOT, np.random.default_rng(s)).rod_masses for s in range(50)]) / 4.1
    assert 0.02 < masses.std() < 0.06


@pytest.mark.parametrize("name", ["backlash", "cable_chain", "guide_whip"])
def test_what_goes_by_the_approach_changes_sign_with_it(name: str) -> None:
    visits = PLANT.visits
    mirrored = Response(PLANT.machine, visits.take(np.arange(len(visits))), PLANT.station)
    object.__setattr__(mirrored.visits, "before", 2.0 * visits.q - visits.before)
    object.__setattr__(mirrored.visits, "speed", -visits.speed)
    one, other = (cause("gantry_tau", name, "cart2")(plant.ideal) for plant in (PLANT, mirrored))
    change = one.shift[:, 1] - other.shift[:, 1] + one.travel[:, [1]] - other.travel[:, [1]]
    along = change @ np.linalg.svd(change)[2][0]
    signs = np.sign(along[np.abs(along) > 1e-9]) * visits.approach[np.abs(along) > 1e-9, 1]
    assert abs(signs.mean()) == 1.0


def test_backlash_is_much_the_same_either_side_and_smaller_under_load() -> None:
    gap = travel("backlash", PLANT) * PLANT.visits.approach[:, 1]
    assert np.abs(np.sign(gap).mean()) == 1.0
    assert 8e-6 < np.abs(gap).mean() < 20e-6


@pytest.mark.parametrize("name", ["encoder_scale", "backlash", "servo_lag", "thermal_track", "zero_shift"])
def test_effects_follow_their_textbook_form_but_for_some_per_cent(name: str) -> None:
    visits, q = PLANT.visits, PLANT.visits.q[:, 1]
    warm = visits.day.frame_at(visits.time) - visits.day.frame[0]
    textbook = {
        "encoder_scale": [q],
        "backlash": [visits.approach[:, 1]],
        "servo_lag": [visits.speed[:, 1]],
        "thermal_track": [warm, warm * q],
        "zero_shift": [1.0 * (visits.session == s) for s in range(3)],
    }
    columns = np.array(textbook[name]).T
    shares = []
    for seed in range(12):
        error = travel(name, PLANT, seed)
        left = error - columns @ np.linalg.lstsq(columns, error)[0]
        shares.append((left @ left) / (error @ error))
    assert np.median(shares) > 1e-4
    assert max(shares) < 0.15


def test_compliance_does_nothing_that_geometry_does_not_where_the_load_does_not_change() -> None:
    stiff = PLANT.displacement([(cause("gantry_tau", "link_compliance", "arm"), 1.0)])
    machine, visits = PLANT.machine, PLANT.visits
    weightless = RodMachine(machine.geometry, 0.0, machine.plate_center, np.zeros(6))
    unloaded = visits.take(np.arange(len(visits)))
    object.__setattr__(unloaded, "payload", np.zeros(len(visits)))
    object.__setattr__(unloaded, "force", np.zeros((len(visits), 3)))
    light = Response(weightless, unloaded, PLANT.station).displacement(
        [(cause("gantry_tau", "link_compliance", "arm"), 1.0)]
    )
    assert np.abs(light).max() < 1e-12
    assert np.abs(stiff[:, :3]).max() > 1e-5


def test_zero_shifts_hold_through_a_session() -> None:
    shifts, session = travel("zero_shift", PLANT), PLANT.visits.session
    means = [shifts[session == s].mean() for s in range(3)]
    within = max(np.ptp(shifts[session == s]) for s in range(3))
    assert np.ptp(means) > 3.0 * within


def test_two_effects_together_do_what_they_do_one_by_one() -> None:
    both = [(cause("gantry_tau", "linearity", "cart1"), 1.0), (cause("gantry_tau", "tracker_drift", "frame"), 1.0)]
    apart = sum(PLANT.displacement([one]) for one in both)
    np.testing.assert_allclose(PLANT.displacement(both), apart, atol=2e-8)


def test_held_out_truth_is_the_machine_s_own_pose_with_its_effects() -> None:
    case = make_case(2, effects=[("encoder_scale", "cart2")], noncentrality=3000.0)
    off = case.truth.minus(case.machine.predict(case.commands.q))
    steep = np.polyfit(case.commands.q[:, 1], off[:, 0], 1)[0]
    assert abs(steep) > 1e-5
    assert np.abs(off[:, :3]).max() < 2e-3
