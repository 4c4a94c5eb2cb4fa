"""Diagnoses that are quick enough for every run of the tests: a large hidden cause is named (on rods: test_why.py)."""

from pathlib import Path

import pytest

import gtpin
from gtpin.bench.simulator import build_measured, make_case
from gtpin.bench.simulator.case import drawn_recipe

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")


def test_a_large_cause_of_an_arm_is_named() -> None:
    effect, site = "joint_compliance", "shoulder_lift_joint"
    case = make_case(71, effects=[(effect, site)], noncentrality=3000.0, poses=60, background=False, robot="ur5")
    found = gtpin.diagnose(case.dataset)
    assert any((m.effect, m.site) == (effect, site) for cause in found.causes for m in cause.members)


def test_a_large_cause_is_named_from_distances(tmp_path: Path) -> None:
    recipe = drawn_recipe(71, effects=[("backlash", "cart2")], noncentrality=3000.0, poses=60, background=False)
    build_measured(recipe, ["range"]).write_dataset(tmp_path / "set")
    found = gtpin.diagnose(gtpin.Dataset.read(tmp_path / "set"))
    assert any((m.effect, m.site) == ("backlash", "cart2") for cause in found.causes for m in cause.members)
