"""What the causes do to an arm: each by its property."""

from dataclasses import replace

import numpy as np
import pytest
from plant_machines import a_plant, cause, nominal

from gtpin.bench.simulator.case import make_case
from gtpin.bench.simulator.causes.kinds import ARM_CATALOGUE, ARM_UNLISTED, CATALOGUE, kind
from gtpin.bench.simulator.causes.without_rods import _beam
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.situation import ALUMINIUM, ArmSituation
from gtpin.bench.simulator.visits import VirtualVisits

ARM = nominal("seven")[1]
PLANT = a_plant("seven", 70)
CONTRACT = {
    "encoder_scale linearity rack_periodic zero_shift backlash servo_lag cross_coupling joint_compliance bearing_compliance "
    "axis_motion joint_clearance": ARM.sites,
    "link_compliance thermal_links": ("arm", *ARM.link_sites),
    "tracker_drift frame_shift tracker_scale measurement_delay": ("frame",),
    "target_offset target_drift target_shift": ("platform",),
}
TURNING = [site for site, slides in zip(ARM.sites, ARM.slides, strict=True) if not slides]


def changed(visits: VirtualVisits, **fields: object) -> Response:
    return Response(PLANT.machine, replace(visits, **fields), PLANT.station)


def travel(name: str, site: str, plant: Response = PLANT, seed: int = 0) -> np.ndarray:
    return cause("seven", name, site, seed)(plant.ideal).travel[:, ARM.sites.index(site)]


def test_the_contract_s_effects_are_there_at_the_contract_s_sites() -> None:
    wanted = {name: sites for names, sites in CONTRACT.items() for name in names.split()}
    assert {k.name: k.sites(ARM) for k in ARM_CATALOGUE} == wanted
    assert not {k.name for k in ARM_UNLISTED} & ({*wanted} | {k.name for k in CATALOGUE})
    assert len(ARM_UNLISTED) >= 8


@pytest.mark.parametrize("site", ["pan", "wrist3"])
def test_backlash_changes_side_with_the_approach_where_friction_is_stronger_than_the_load(site: str) -> None:
    visits = PLANT.visits
    light = {"payload": 0.0 * visits.payload, "force": 0.0 * visits.force}
    mirrored = changed(visits, before=2.0 * visits.q - visits.before, **light)
    one, other = travel("backlash", site, changed(visits, **light)), travel("backlash", site, mirrored)
    np.testing.assert_allclose(one, -other, atol=2e-5)
    assert (one * visits.approach[:, ARM.sites.index(site)] < 0.0).mean() > 0.95


def test_backlash_of_a_joint_that_gravity_loads_harder_than_friction_is_on_the_load_s_side() -> None:
    c = ARM.sites.index("shoulder")
    sides = []
    for seed in range(12):
        visits = PLANT.visits
        side = travel("backlash", "shoulder", changed(visits, before=visits.q - 1e-9), seed)  # no move, no friction
        load = PLANT.ideal.load(c)
        clear = np.abs(load) > 0.5 * PLANT.machine.usual_load(c)
        sides.append((side * load > 0.0)[clear].mean())
    assert min(sides) > 0.99


def test_clearance_is_on_the_load_s_side_and_a_vertical_axis_under_gravity_alone_shows_none() -> None:
    load, gap = PLANT.ideal.load(ARM.sites.index("elbow")), travel("joint_clearance", "elbow")
    assert (np.sign(gap) == np.sign(load)).all()
    visits = PLANT.visits
    level = replace(PLANT.machine, twists=0.0 * PLANT.machine.twists)
    still = Response(level, replace(visits, force=0.0 * visits.force), PLANT.station)
    assert np.abs(still.ideal.load(0)).max() < 1e-9
    assert np.abs(travel("joint_clearance", "pan", still)).max() < 1e-12


def test_compliance_goes_with_the_load_and_less_than_in_proportion() -> None:
    c = ARM.sites.index("elbow")
    load, wound = PLANT.ideal.load(c), travel("joint_compliance", "elbow")
    assert (np.sign(wound) == np.sign(load)).all()
    assert np.corrcoef(load, wound)[0, 1] > 0.95
    soft = np.abs(wound / load)
    heavy = np.abs(load) > np.quantile(np.abs(load), 0.8)
    light = np.abs(load) < np.quantile(np.abs(load), 0.2)
    assert soft[heavy].mean() < soft[light].mean()


def test_bearings_tilt_about_axes_across_their_own_and_not_about_it() -> None:
    for site in ARM.sites:
        c = ARM.sites.index(site)
        deviation = cause("seven", "bearing_compliance", site)(PLANT.ideal)
        tilt = deviation.axis[:, c, 3:]
        assert np.abs(tilt @ ARM.joints[ARM.counted[c]].axis).max() < 1e-18
        assert not deviation.axis[:, c, :3].any()
        assert np.abs(tilt).max() > 1e-6


@pytest.mark.parametrize("site", TURNING)
def test_an_axis_repeats_its_motion_after_a_turn(site: str) -> None:
    c, visits = ARM.sites.index(site), PLANT.visits
    turned = visits.q + 2.0 * np.pi * np.eye(ARM.n_actuators)[c]
    one, other = (cause("seven", "axis_motion", site)(p.ideal).axis for p in (PLANT, changed(visits, q=turned)))
    np.testing.assert_allclose(one, other, atol=1e-12)
    assert np.ptp(one[:, c, 3:], axis=0).max() > 1e-5
    assert np.abs(one[:, c, 3:] @ ARM.joints[ARM.counted[c]].axis).max() < 1e-18  # that would be its angle


def test_lines_are_one_to_three_and_of_one_to_a_hundred_periods_a_turn() -> None:
    q = np.linspace(-2.0, 2.0, 20_000)
    many = PLANT.visits.take(np.zeros(len(q), dtype=int))
    counts = []
    for seed in range(20):
        wave = cause("seven", "rack_periodic", "elbow", seed)(_at(many, q)).travel[:, ARM.sites.index("elbow")]
        spectrum = np.abs(np.fft.rfft((wave - wave.mean()) * np.hanning(len(q)), 8 * len(q)))
        rate = np.fft.rfftfreq(8 * len(q), q[1] - q[0]) * 2.0 * np.pi  # periods a turn
        strong = rate[spectrum > 0.25 * spectrum.max()]
        assert strong.max() < 103.0
        assert 3e-5 < wave.std() < 3e-4
        counts.append(1 + (np.diff(strong) > 2.0).sum())
    assert set(counts) <= {1, 2, 3}
    assert len(set(counts)) > 1


def test_a_periodic_error_has_the_lines_that_a_scenario_asks_for() -> None:
    q = np.linspace(-np.pi, np.pi, 400, endpoint=False)
    rng, elbow = np.random.default_rng(0), ARM.sites.index("elbow")
    asked = kind("rack_periodic", ARM).at(ARM, "elbow", rng, (7.0, 23.0))
    wave = asked(_at(PLANT.visits.take(np.zeros(len(q), dtype=int)), q)).travel[:, elbow]
    assert set(np.argsort(np.abs(np.fft.rfft(wave)))[-2:]) == {7, 23}


def _at(visits: VirtualVisits, q: np.ndarray) -> ArmSituation:
    """A situation in which only the elbow's command matters."""
    commands = np.zeros((len(q), ARM.n_actuators))
    commands[:, ARM.sites.index("elbow")] = q
    return ArmSituation(
        PLANT.machine,
        replace(visits, q=commands),
        *(vars(PLANT.ideal)[n] for n in ("bodies", "bending", "tcp", "poses")),
    )


def test_coupling_of_one_joint_is_with_others_and_needs_them_to_move() -> None:
    visits = PLANT.visits
    alone = np.tile(visits.q[:1], (len(visits), 1))
    alone[:, 4] = visits.q[:, 4]
    everywhere, still = travel("cross_coupling", "wrist1"), travel("cross_coupling", "wrist1", changed(visits, q=alone))
    assert still.std() < 0.4 * everywhere.std()


def test_links_grow_between_their_joints_and_the_last_to_the_tcp() -> None:
    now = PLANT.ideal
    day, time = now.visits.day, now.visits.time
    warm = day.link_at(time) - day.link[0]
    bodies, bending = PLANT.machine.bodies(now.q, cause("seven", "thermal_links", "arm")(now))
    cold = now.bodies
    ends = [*(bodies.p[:, j] for j in ARM.way[1:]), bodies.at(PLANT.machine.true.tcp, bending).T]
    before = [*(cold.p[:, j] for j in ARM.way[1:]), now.tcp.T]
    for place, j in enumerate(ARM.way):
        if place + 1 < len(ARM.way) and ARM.joints[ARM.way[place + 1]].slides:
            continue  # ends at a place that moves
        length = np.linalg.norm(before[place] - cold.p[:, j], axis=1)
        growth = np.linalg.norm(ends[place] - bodies.p[:, j], axis=1) - length
        slope = np.polyfit(warm * length, growth, 1)[0]
        assert slope == pytest.approx(ALUMINIUM, rel=0.25)


def test_a_link_bends_and_twists_as_a_chain_of_small_hinges_does() -> None:
    """The beam's closed form against the sum of 2,000 elastic hinges, without its root, at any load at its end."""
    now, machine, link = PLANT.ideal, PLANT.machine, 3
    j = ARM.counted[link]
    end, flexibility, twist = ARM.next_frame(j).p, 2e-5, 1.5
    force, moment = now.tip_load(link)
    force = force + np.einsum("nji,j->ni", now.bodies.R[:, j], 0.375 * machine.masses[j] * ARM.gravity)
    u, length, count = end / np.linalg.norm(end), float(np.linalg.norm(end)), 2000
    turn, shift = np.zeros_like(force), np.zeros_like(force)
    for s in (np.arange(count) + 0.5) * length / count:
        here = moment + np.cross((length - s) * u, force)
        along = np.outer(here @ u, u)
        bent = flexibility * length / count * (here - along + twist * along)
        turn, shift = turn + bent, shift + np.cross(bent, (length - s) * u)
    found = _beam(now, link, np.full(3, flexibility), twist, 0.0, 1.0)
    np.testing.assert_allclose(found[:, :3], shift, atol=1e-5 * np.abs(shift).max())
    np.testing.assert_allclose(found[:, 3:], turn, atol=1e-5 * np.abs(turn).max())


def test_a_loose_foot_lifts_to_one_side_and_a_creeping_joint_remembers() -> None:
    tilt = cause("seven", "loose_foot", "frame")(PLANT.ideal).axis[:, 0, 3:]
    along = tilt @ np.linalg.svd(tilt)[2][0]
    assert (along * np.sign(along.sum()) >= 0.0).all()
    crept = travel("creep", "shoulder")
    swapped = PLANT.visits.take(np.r_[np.arange(len(PLANT.visits))[::-1]])
    swapped = replace(swapped, time=PLANT.visits.time)
    back = cause("seven", "creep", "shoulder")(Response(PLANT.machine, swapped, PLANT.station).ideal).travel[::-1, 2]
    assert np.abs(crept - back).max() > 1e-5


EXCESS = {
    "thermal_links": 1e-4 / ALUMINIUM,  # unfilled plastics
    "tracker_scale": 1e-6 / 1.5e-7,  # the refractive index of air, 1/K, over what goes with the air at typical size
    "rack_periodic": 5e-4 / 1e-4,  # strain-wave gears, rad
}


@pytest.mark.parametrize("name", EXCESS)
def test_no_effect_is_larger_than_a_machine_can_have(name: str) -> None:
    assert kind(name, ARM).largest <= EXCESS[name] * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["thermal_links", "tracker_scale"])
def test_an_effect_that_can_t_reach_its_energy_has_its_largest_size(name: str) -> None:
    made = make_case(5, effects=[(name, None)], noncentrality=1e9, poses=40, held_out=5, robot="ur5")
    assert made.effects[0].amplitude == kind(name, ARM).largest
    assert made.effects[0].noncentrality < 1e9
