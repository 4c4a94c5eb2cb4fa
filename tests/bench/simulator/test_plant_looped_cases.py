"""What causes do to machines that are no rods, each by its property, and the cases that are made of them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plant_machines import FIVE_BAR, LOOPED, a_plant, cause, nominal, urdf_file
from typer.testing import CliRunner

from gtpin.bench.blind.draw import drafts, made, truth_of
from gtpin.bench.simulator import draw_case, make_case
from gtpin.bench.simulator.build import build, known_robot, measure_at
from gtpin.bench.simulator.case import drawn_recipe
from gtpin.bench.simulator.causes.kinds import ARM_CATALOGUE, ARM_UNLISTED, kind, unlisted
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.recipe import SimulatedConditions
from gtpin.cli import app
from gtpin.data import Commands


def test_a_bearing_off_the_way_to_the_tcp_of_a_planar_loop_shows_nothing_whatever_it_does() -> None:
    """Its tilt moves the far link across the plane, where play takes it up."""
    for name in ("five_bar", "level"):
        plant = a_plant(name)
        one = cause(name, "bearing_compliance", "drive_right")
        assert np.abs(one(plant.ideal).axis).max() > 1e-6
        assert np.abs(plant.displacement([(one, 1.0)])).max() < 1e-6
        beside = plant.displacement([(cause(name, "bearing_compliance", "drive_left"), 1.0)])
        assert np.abs(beside).max() > 1e-5


def test_gravity_loads_the_drives_of_an_upright_loop_and_a_push_alone_those_of_a_level_one() -> None:
    for name, low, high in (("five_bar", 0.05, np.inf), ("level", 0.0, 2e-2)):
        plant = a_plant(name)
        still = replace(plant.visits, force=0.0 * plant.visits.force)
        at = Response(plant.machine, still, plant.station).ideal
        share = np.abs(at.load(0)).max() / plant.machine.usual_load(0)
        assert low <= share <= high
        assert np.abs(plant.ideal.load(0)).max() / plant.machine.usual_load(0) > 0.05


def test_a_base_that_tilts_turns_all_that_stands_on_it_about_its_origin() -> None:
    for name in LOOPED:
        now = a_plant(name).ideal
        turn = np.array([1e-4, -2e-4, 5e-5])
        moved = now.settled_by(now.tilted(np.ones(len(now)), turn)).poses.minus(now.poses)
        np.testing.assert_allclose(moved[:, :3], np.cross(turn, now.poses.T), atol=2e-7)
        np.testing.assert_allclose(moved[:, 3:], np.tile(turn, (len(now), 1)), atol=2e-7)


@pytest.mark.parametrize(("name", "site"), [(n, s) for n in LOOPED for s in nominal(n)[1].pin_sites])
def test_a_worn_pin_has_play_across_its_axis_on_the_side_of_its_force(name: str, site: str) -> None:
    plant, arm = a_plant(name), nominal(name)[1]
    now, j = plant.ideal, arm.pins[arm.pin_sites.index(site)]
    play = cause(name, "worn_pin", site)(now).seat[:, j]
    assert not play[:, 3:].any()
    assert np.abs(play[:, :3] @ arm.joints[j].axis).max() < 1e-18
    assert np.linalg.norm(play, axis=1).max() < 3e-5
    force = np.einsum("nji,nj->ni", now.bodies.seats[:, j], now.carried_by(j)[0])
    assert (np.einsum("ni,ni->n", play[:, :3], force) >= -1e-12).all()


def test_what_goes_by_a_load_is_pushed_in_a_machine_with_loops() -> None:
    arm = nominal("level")[1]
    for kinds in (ARM_CATALOGUE, ARM_UNLISTED):
        for one in kinds:
            assert ("force" in kind(one.name, arm).needs) == bool({"force", "payload"} & set(one.needs))
    recipe = drawn_recipe(3, effects=[("joint_compliance", "drive_left")], robot=str(FIVE_BAR))
    assert recipe.conditions.push > 0.0


@pytest.mark.slow
def test_a_machine_of_one_command_is_made_in_every_order_of_its_poses(tmp_path: Path) -> None:
    for order in ("random", "layers"):
        case = make_case(
            1, poses=30, held_out=5, conditions=SimulatedConditions(order=order), robot=urdf_file("spatial", tmp_path)
        )
        assert case.dataset.q.shape[1] == 1
        assert np.isfinite(case.truth.T).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five_bar", "seven"])
def test_a_check_draws_machines_with_their_own_effects_and_makes_them(name: str, tmp_path: Path) -> None:
    file = urdf_file(name, tmp_path)
    drawn, arm = list(drafts(400, 1, file)), known_robot(file)
    assert {draft.effects[0] for draft in drawn if draft.kind == "one"} == {k.name for k in ARM_CATALOGUE}
    assert {draft.effects[0] for draft in drawn if draft.kind == "unlisted"} == {k.name for k in unlisted(arm)}
    for wanted in ("one", "rough", "three", "known_and_unlisted"):
        case = made(next(draft for draft in drawn if draft.kind == wanted))
        for effect in truth_of(case, wanted).effects:
            assert len(effect.displacement or ()) == len(case.dataset)
            assert effect.site in {*arm.sites, *arm.link_sites, *arm.pin_sites, "arm", "platform", "frame"}


@pytest.mark.slow
def test_a_machine_with_loops_is_measured_again_after_its_day() -> None:
    case = build(
        drawn_recipe(2, effects=[("joint_compliance", "drive_right")], poses=40, held_out=10, robot=str(FIVE_BAR))
    )
    again = measure_at(case, Commands(case.commands.pose, case.commands.q))
    # Loads are others than in the day: the drive gives way by more or less, and the instrument has its noise.
    assert np.abs(again.position - case.truth.T).max() < 1e-3


@pytest.mark.slow
def test_a_scenario_hides_an_effect_in_a_five_bar(tmp_path: Path) -> None:
    scenario = tmp_path / "pin.toml"
    scenario.write_text(
        "poses = 30\n[[effect]]\nid = 'worn_pin'\nsite = 'elbow_left'\n[[effect]]\nid = 'backlash'\n", encoding="utf-8"
    )
    arguments = ["simulate", "--robot", str(FIVE_BAR), "--scenario", str(scenario), "-o", str(tmp_path / "data")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    truth = json.loads((tmp_path / "data.truth.json").read_text())["effects"]
    assert {(effect["effect"], effect["site"]) for effect in truth} > {("worn_pin", "elbow_left")}
    assert draw_case(1, poses=20, robot=str(FIVE_BAR)).dataset.q.shape[1] == 2
