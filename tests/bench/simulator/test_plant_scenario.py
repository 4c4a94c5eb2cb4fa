"""Scenario files make the machines that they describe, or say in a line what is wrong."""

from pathlib import Path

import numpy as np
import pytest

from gtpin.bench.simulator import simulate_scenario
from gtpin.bench.simulator.case import read_scenario
from gtpin.bench.simulator.causes.kinds import CATALOGUE, UNLISTED
from gtpin.errors import GtpinError

FOLDER = Path(__file__).parents[3] / "examples" / "scenarios"
FILES = sorted(FOLDER.glob("*.toml"))


def test_there_is_one_for_each_effect_for_none_for_two_and_for_an_unknown_one() -> None:
    names = {file.stem for file in FILES}
    assert names == {k.name for k in CATALOGUE} | {"no_effect", "two_effects", "unknown"}
    assert read_scenario(FOLDER / "unknown.toml").effect[0].id in {k.name for k in UNLISTED}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_each_example_is_a_machine_with_what_it_says(file: Path) -> None:
    said, case = read_scenario(file), simulate_scenario(file)
    assert {(e.id, e.site) for e in said.effect} == {(t.effect, t.site) for t in case.effects}
    assert len(set(case.dataset.pose)) == said.poses
    assert len(case.commands) == said.held_out
    for truth in case.effects:
        asked = next(e for e in said.effect if e.id == truth.effect)
        assert asked.energy is None or truth.noncentrality == pytest.approx(asked.energy, rel=2e-3)
        assert asked.amplitude is None or truth.amplitude == asked.amplitude
        assert truth.noncentrality > 63.0 or truth.effect == "target_offset"


def test_options_take_precedence_over_the_file() -> None:
    file = FOLDER / "linearity.toml"
    case, other = simulate_scenario(file, seed=5, poses=30), simulate_scenario(file, seed=6, poses=30)
    assert len(set(case.dataset.pose)) == 30
    assert not np.array_equal(case.dataset.q, other.dataset.q)


def test_what_is_left_out_is_drawn_so_that_effects_can_show(tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text('[[effect]]\nid = "zero_shift"\n[covariates]\nrest = 1.0\n')
    case = simulate_scenario(file, poses=40)
    assert len(set(case.dataset.covariates["session"])) >= 2
    assert not case.dataset.covariates["speed1"].any()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("poses = 1", "poses"),
        ("pose = 10", "known here"),
        ("[noise]\nsigma = 1.0", "position_sigma"),
        ("[noise]\nposition_sigma = -1.0", "position_sigma"),
        ("[noise]\nposition_sigma = nan", "position_sigma"),
        ("[covariates]\nrest = 2.0", "rest"),
        ('[[effect]]\nsite = "cart1"', "id"),
        ('[[effect]]\nid = "magic"', "magic"),
        ('[[effect]]\nid = "backlash"\nsite = "arm"', "cart1"),
        ('[[effect]]\nid = "backlash"\nenergy = 1.0\namplitude = 1.0', "one of them"),
        ('[[effect]]\nid = "backlash"\nenergy = -1.0', "energy"),
        ('[[effect]]\nid = "backlash"\nperiods = [3]', "periods"),
        ('robot = "ur5"\n[[effect]]\nid = "backlash"\nperiods = [3]', "periods"),
        ('[[effect]]\nid = "rack_periodic"\nperiods = [0]', "periods"),
        ('robot = "nobody"', "nobody"),
        ('robot = "../nobody.urdf"', "nobody.urdf"),
        ("poses = 9\nseed = x", "row 2"),
        ("seed = [[[", "TOML"),
        ("effect = 3", "effect"),
    ],
)
def test_what_can_not_be_is_one_line_that_says_what_and_where(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "scenario.toml"
    file.write_text(text)
    with pytest.raises(GtpinError) as error:
        simulate_scenario(file)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(GtpinError, match="missing"):
        simulate_scenario(tmp_path / "none.toml")
