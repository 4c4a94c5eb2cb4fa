"""The machine: its closed chain, its forces, what its effects do."""

import numpy as np
import pytest

from gtpin.bench.simulator import make_case
from gtpin.bench.simulator.build import known_robot
from gtpin.bench.simulator.causes.kinds import CATALOGUE, UNLISTED, kind
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.visits import plan

ROBOT = known_robot("gantry_tau")
STATION = np.array([1.5, -7.0, 0.3])
EVERYTHING = SimulatedConditions(sessions=3, push=150.0, warming=1.5)
PLACES = [(k.name, site) for k in (*CATALOGUE, *UNLISTED) for site in k.sites(ROBOT)]


def a_plant(seed: int = 0, conditions: SimulatedConditions = EVERYTHING, poses: int = 90) -> Response:
    rng = np.random.default_rng(seed)
    machine = RodMachine.draw(ROBOT, rng)
    return Response(machine, plan(machine, poses, 10, conditions, rng), STATION)


PLANT = a_plant()


def cause(name: str, site: str, seed: int = 0):
    return kind(name, ROBOT).at(ROBOT, site, np.random.default_rng(seed))


def travel(name: str, plant: Response, seed: int = 0) -> np.ndarray:
    return cause(name, "cart2", seed)(plant.ideal).travel[:, 1]


def test_every_effect_of_the_contract_is_there_and_ten_that_are_not() -> None:
    assert len(CATALOGUE) == 20
    assert len(UNLISTED) >= 8
    assert not {k.name for k in CATALOGUE} & {k.name for k in UNLISTED}


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_each_effect_at_each_site_moves_poses_by_a_physical_amount(name: str, site: str) -> None:
    moved = PLANT.displacement([(cause(name, site), 1.0)])
    if (name, site) == ("cart_rotation", "cart1"):  # a cart with one joint turns about that joint
        assert np.abs(moved).max() < 1e-12
        return
    size = np.sqrt((moved**2).sum(axis=1).mean())
    assert 1e-6 < size < 1e-3
    assert np.isfinite(moved).all()


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_what_an_effect_does_is_repeatable_and_another_machine_s_is_another(name: str, site: str) -> None:
    once, again, other = (cause(name, site, seed)(PLANT.ideal) for seed in (1, 1, 2))
    differs = [not np.array_equal(getattr(once, f), getattr(other, f)) for f in vars(once)]
    assert all(np.array_equal(getattr(once, f), getattr(again, f)) for f in vars(once))
    assert any(differs)


def test_the_chain_is_closed_with_every_effect_on() -> None:
    active = [(cause(name, site), 1.0) for name, site in PLACES]
    now, deviation = PLANT.settled(active)
    ends = PLANT.machine.ends(PLANT.visits.q, deviation)
    for i in range(6):
        seat = ends.C[:, i]
        joint = now.poses.T + np.einsum("nij,nj->ni", now.poses.R, ends.P[:, i])
        assert np.abs(np.linalg.norm(joint - seat, axis=1) - ends.L[:, i]).max() < 1e-13


def test_forces_and_deflections_agree_where_the_machine_comes_to_rest() -> None:
    active = [(cause("cart_compliance", "cart1"), 3.0), (cause("link_compliance", "arm"), 3.0)]
    now, deviation = PLANT.settled(active)
    again = sum((c(now) * a for c, a in active), now.unbent())
    for name in vars(deviation):
        np.testing.assert_allclose(getattr(again, name), getattr(deviation, name), atol=1e-12)


def test_masses_are_off_nominal_by_some_per_cent() -> None:
    masses = np.array([RodMachine.draw(ROBOT, np.random.default_rng(s)).rod_masses for s in range(50)]) / 4.1
    assert 0.02 < masses.std() < 0.06


@pytest.mark.parametrize("name", ["backlash", "cable_chain", "guide_whip"])
def test_what_goes_by_the_approach_changes_sign_with_it(name: str) -> None:
    visits = PLANT.visits
    mirrored = Response(PLANT.machine, visits.take(np.arange(len(visits))), STATION)
    object.__setattr__(mirrored.visits, "before", 2.0 * visits.q - visits.before)
    object.__setattr__(mirrored.visits, "speed", -visits.speed)
    one, other = (cause(name, "cart2")(plant.ideal) for plant in (PLANT, mirrored))
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


def test_servo_lag_is_nothing_at_rest_and_behind_the_motion() -> None:
    speed, lag = PLANT.visits.speed[:, 1], travel("servo_lag", PLANT)
    assert (lag[speed == 0.0] == 0.0).all()
    assert np.corrcoef(speed, lag)[0, 1] < -0.9


def test_compliance_does_nothing_that_geometry_does_not_where_the_load_does_not_change() -> None:
    stiff = PLANT.displacement([(cause("link_compliance", "arm"), 1.0)])
    machine, visits = PLANT.machine, PLANT.visits
    weightless = RodMachine(machine.geometry, 0.0, machine.plate_center, np.zeros(6))
    unloaded = visits.take(np.arange(len(visits)))
    object.__setattr__(unloaded, "payload", np.zeros(len(visits)))
    object.__setattr__(unloaded, "force", np.zeros((len(visits), 3)))
    light = Response(weightless, unloaded, STATION).displacement([(cause("link_compliance", "arm"), 1.0)])
    assert np.abs(light).max() < 1e-12
    assert np.abs(stiff[:, :3]).max() > 1e-5


def test_thermal_effects_are_nothing_before_it_gets_warm_and_zero_shifts_hold_through_a_session() -> None:
    cool = a_plant(conditions=SimulatedConditions(warming=0.0, sessions=3))
    assert (cause("thermal_links", "arm")(cool.ideal).length == 0.0).all()
    assert (travel("thermal_track", cool) == 0.0).all()
    shifts = travel("zero_shift", cool)
    means = [shifts[cool.visits.session == s].mean() for s in range(3)]
    within = max(np.ptp(shifts[cool.visits.session == s]) for s in range(3))
    assert np.ptp(means) > 3.0 * within


def test_each_site_s_effect_stays_at_its_site() -> None:
    for k in CATALOGUE:
        for site in k.sites(ROBOT):
            deviation = cause(k.name, site)(PLANT.ideal)
            for number, name in enumerate(ROBOT.sites):
                if name != site:
                    assert not deviation.travel[:, number].any()
                    assert not deviation.shift[:, number].any()
                    assert not deviation.turn[:, number].any()
            for number, name in enumerate(ROBOT.rod_sites):
                assert site in (name, "arm") or not deviation.length[:, number].any()
            assert site == "frame" or not (deviation.frame.any() or deviation.scale.any())
            assert site == "platform" or not (deviation.target.any() or deviation.joint.any())


def test_two_effects_together_do_what_they_do_one_by_one() -> None:
    both = [(cause("linearity", "cart1"), 1.0), (cause("tracker_drift", "frame"), 1.0)]
    apart = sum(PLANT.displacement([one]) for one in both)
    np.testing.assert_allclose(PLANT.displacement(both), apart, atol=2e-8)


def test_held_out_truth_is_the_machine_s_own_pose_with_its_effects() -> None:
    case = make_case(2, effects=[("encoder_scale", "cart2")], noncentrality=3000.0)
    off = case.truth.minus(case.machine.kinematics.predict(case.commands.q))
    steep = np.polyfit(case.commands.q[:, 1], off[:, 0], 1)[0]
    assert abs(steep) > 1e-5
    assert np.abs(off[:, :3]).max() < 2e-3
