"""What each cause does to machines of every kind, on rods, open chains and loops."""

from dataclasses import replace

import numpy as np
import pytest
from plant_machines import LOOPED, ROBOTS, a_plant, cause, plant_robot

from gtpin.bench.simulator.arm import Arm
from gtpin.bench.simulator.causes.kinds import listed, unlisted
from gtpin.bench.simulator.machine import Deviation
from gtpin.robot.chain import Chain

NAMES = ("gantry_tau", *ROBOTS)
KINDS = {name: [*listed(plant_robot(name)), *unlisted(plant_robot(name))] for name in NAMES}
PLACES = [(name, k.name, site) for name in NAMES for k in KINDS[name] for site in k.sites(plant_robot(name))]
POSES = {"gantry_tau": 90, "seven": 70}
SMALL = ("joint_compliance", "joint_clearance", "link_compliance", "whip")
"""On axes that are nearly vertical, or nearly in line with the load, these hardly feel gravity."""


@pytest.mark.parametrize(("name", "effect", "site"), PLACES)
def test_each_cause_moves_the_tcp_by_a_physical_amount(name: str, effect: str, site: str) -> None:
    moved = a_plant(name, POSES.get(name, 50)).displacement([(cause(name, effect, site), 1.0)])
    assert np.isfinite(moved).all()
    if (effect, site) == ("cart_rotation", "cart1"):  # a cart with one joint turns about that joint
        assert np.abs(moved).max() < 1e-12
    elif name in LOOPED:
        assert np.abs(moved).max() < 5e-3
    else:
        lever = 1.0 if name == "gantry_tau" else 0.1
        size = np.sqrt((moved[:, :3] ** 2).sum(axis=1).mean() + lever**2 * (moved[:, 3:] ** 2).sum(axis=1).mean())
        assert (1e-8 if name == "seven" and effect in SMALL else 1e-6) < size < 1e-3


@pytest.mark.parametrize(("name", "effect", "site"), PLACES)
def test_each_cause_stays_at_its_site_and_is_repeatable(name: str, effect: str, site: str) -> None:
    once, again, other = (cause(name, effect, site, seed)(a_plant(name).ideal) for seed in (1, 1, 2))
    assert all(np.array_equal(getattr(once, f), getattr(again, f)) for f in vars(once))
    assert any(not np.array_equal(getattr(once, f), getattr(other, f)) for f in vars(once))
    if name in LOOPED or effect in {k.name for k in listed(plant_robot(name))}:
        assert not elsewhere(once, plant_robot(name), site)


def elsewhere(deviation: Deviation, robot: Chain | Arm, site: str) -> list[str]:
    """Fields with deviations at other sites than this one."""
    links, pins = (robot.link_sites, robot.pin_sites) if isinstance(robot, Arm) else (robot.rod_sites, ())
    owners = dict.fromkeys(("travel", "shift", "turn", "axis"), robot.sites)
    owners |= dict.fromkeys(("length", "tip"), links if site != "arm" else ())
    found = []
    for field, names in owners.items():
        others, values = [i for i, name in enumerate(names) if name != site], getattr(deviation, field)
        if values.shape[1] and values[:, others].any():
            found.append(field)
    wholes = {"frame": ("frame",), "scale": ("frame",), "target": ("platform",), "joint": ("platform",)}
    wholes["seat"] = ("frame", *pins)
    return found + [field for field, at in wholes.items() if site not in at and getattr(deviation, field).any()]


@pytest.mark.parametrize("name", NAMES)
def test_causes_without_size_move_nothing(name: str) -> None:
    causes = [(cause(name, effect, site), 0.0) for robot, effect, site in PLACES if robot == name]
    assert np.abs(a_plant(name).displacement(causes)).max() < (1e-15 if name == "seven" else 1e-12)


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("gantry_tau", [("cart_compliance", "cart1", 3.0), ("link_compliance", "arm", 3.0)]),
        ("parallelogram", [("joint_compliance", "shoulder", 3.0), ("link_compliance", "arm", 2.0)]),
    ],
)
def test_forces_and_deflections_agree_where_the_machine_comes_to_rest(
    name: str, wanted: list[tuple[str, str, float]]
) -> None:
    active = [(cause(name, effect, site), size) for effect, site, size in wanted]
    now, deviation = a_plant(name, POSES.get(name, 50)).settled(active)
    again = sum((c(now) * a for c, a in active), now.unbent())
    for field in vars(deviation):
        atol = 1e-12 if name == "gantry_tau" else 1e-11
        np.testing.assert_allclose(getattr(again, field), getattr(deviation, field), atol=atol)


@pytest.mark.parametrize(("name", "site"), [("gantry_tau", "cart2"), ("seven", "shoulder")])
def test_servo_lag_is_nothing_at_rest_and_behind_the_motion(name: str, site: str) -> None:
    plant, number = a_plant(name, POSES[name]), plant_robot(name).sites.index(site)
    speed, lag = plant.visits.speed[:, number], cause(name, "servo_lag", site)(plant.ideal).travel[:, number]
    assert (lag[speed == 0.0] == 0.0).all()
    assert np.corrcoef(speed, lag)[0, 1] < -0.9


@pytest.mark.parametrize("name", ["gantry_tau", "seven"])
def test_late_positions_are_those_of_about_a_millisecond_before(name: str) -> None:
    plant = a_plant(name, POSES[name])
    moved = plant.displacement([(cause(name, "measurement_delay", "frame"), 1.0)])
    now, visits = plant.ideal, plant.visits
    before = type(now).of(now.machine, replace(visits, q=visits.q - 1e-3 * visits.speed)).poses.T - now.poses.T
    still = (visits.speed == 0.0).all(axis=1)
    assert still.any()
    assert np.abs(moved[still]).max() < 1e-12
    share = np.einsum("ni,ni->n", moved[~still, :3], before[~still]) / (before[~still] ** 2).sum(axis=1)
    np.testing.assert_allclose(share, 1.0, atol=0.2)
    assert np.abs(moved[:, 3:]).max() < 1e-12


@pytest.mark.parametrize("name", ["gantry_tau", "seven"])
def test_thermal_effects_are_nothing_before_it_gets_warm(name: str) -> None:
    cool = a_plant(name, POSES[name], warming=0.0).ideal
    links = cause(name, "thermal_links", "arm")(cool)
    assert not links.length.any()
    assert not links.tip.any()
    assert name == "seven" or not cause(name, "thermal_track", "cart2")(cool).travel.any()
