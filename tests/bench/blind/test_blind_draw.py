"""What is drawn for a check."""

from collections import Counter

import numpy as np
import pytest

import gtpin
from gtpin.bench.blind.draw import POWER_NONCENTRALITY, SHARES, Draft, drafts, made, truth_of
from gtpin.bench.blind.truth import kind_of
from gtpin.effects.catalogue import OWN


def test_a_larger_check_begins_with_the_cases_of_a_smaller_one() -> None:
    assert list(drafts(300, 5))[:40] == list(drafts(40, 5))
    assert list(drafts(40, 6)) != list(drafts(40, 5))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sorts_of_cases_come_in_their_shares(seed: int) -> None:
    count = Counter(draft.kind for draft in drafts(1000, seed))
    assert sum(SHARES.values()) == pytest.approx(1.0)
    for kind, share in SHARES.items():
        assert abs(count[kind] - 1000 * share) <= 5


def test_every_effect_of_the_catalogue_has_its_cases() -> None:
    count = Counter(draft.effects[0] for draft in drafts(1000, 0) if draft.kind == "one")
    robot = gtpin.load_robot("gantry_tau")
    missing = {effect().id for effect in OWN if effect().sites(robot)} ^ set(count)
    assert not missing, "effects without an independent cause in bench/simulator/causes/kinds.py"
    assert max(count.values()) - min(count.values()) <= 1


def test_names_and_seeds_do_not_tell_the_sort() -> None:
    some = list(drafts(200, 0))
    assert [draft.name for draft in some] == [f"case{i:05d}" for i in range(200)]
    assert len({draft.seed for draft in some}) == 200


def test_effects_are_of_the_sort_that_is_asked_for() -> None:
    known = {effect.id for effect in OWN}
    for draft in drafts(400, 3):
        listed = sum(name in known for name in draft.effects)
        told = {"one": (1, 0), "power": (1, 0), "none": (0, 0), "unlisted": (0, 1), "two": (2, 0), "three": (3, 0)}
        told |= {"known_and_unlisted": (1, 1), "rough": (0, 0)}
        assert (listed, len(draft.effects) - listed) == told[draft.kind]
        assert len(set(draft.effects)) == len(draft.effects)


@pytest.mark.slow
def test_a_case_and_what_is_sealed_of_it_come_from_the_seed_alone() -> None:
    draft = Draft("x", "power", 7, ("backlash",), 60)
    case, again = made(draft), made(draft)
    truth = truth_of(case, "power")
    assert truth == truth_of(again, "power")
    np.testing.assert_array_equal(case.dataset.position, again.dataset.position)
    (effect,) = truth.effects
    assert effect.effect == "backlash"
    assert effect.energy is not None
    assert POWER_NONCENTRALITY[0] * 0.9 < effect.energy < POWER_NONCENTRALITY[1] * 1.1
    assert effect.displacement is not None
    assert len(effect.displacement) == len(case.dataset)
    assert len(np.unique(case.dataset.visits)) == 60
    assert truth.poses is not None
    np.testing.assert_array_equal(truth.poses.T, case.truth.T)


def test_the_sort_of_somebody_elses_case_follows_from_its_effects() -> None:
    assert kind_of([]) == "none"
    assert kind_of(["backlash"]) == "one"
    assert kind_of(["hose"]) == "unlisted"
    assert kind_of(["hose", "backlash"]) == "known_and_unlisted"
    assert kind_of(["linearity", "backlash", "rack_step"]) == "three"
    assert kind_of(["hose", "chain"]) == "many"


def test_another_machine_has_the_effects_that_its_parts_can_have() -> None:
    some = list(drafts(400, 0, "stewart"))
    named = {effect for draft in some for effect in draft.effects}
    assert {draft.robot for draft in some} == {"stewart"}
    assert not named & {"straightness", "cart_rotation", "cart_compliance", "cable_chain", "guide_whip"}
    assert {"linearity", "zero_shift", "link_compliance", "hose_drag"} <= named
    assert made(next(draft for draft in some if draft.kind == "one")).dataset.robot == "stewart"


@pytest.mark.slow
def test_cases_of_other_instruments_have_the_same_kinds_and_a_truth_without_sigma() -> None:
    plain, other = list(drafts(20, 4)), list(drafts(20, 4, instruments=("range",)))
    assert [(d.kind, d.effects, d.seed) for d in plain] == [(d.kind, d.effects, d.seed) for d in other]
    case = made(Draft("x", "one", 7, ("backlash",), 30, instruments=("range", "plane")))
    truth = truth_of(case, "one")
    (effect,) = truth.effects
    assert truth.sigma is None
    assert effect.displacement is not None
    assert len(effect.displacement) == len(case.dataset) == sum(len(read.stop) for read in case.dataset.read)
    assert truth.poses is None  # of readings alone, nobody knows where the base is
    assert {one.name: np.shape(one.values) for one in truth.readings} == {"wire": (120, 1), "bed": (5, 1)}
    seen = truth_of(made(Draft("x", "none", 7, (), 30, instruments=("tracker",))), "none")
    assert seen.poses is not None
    assert seen.readings == ()
    touched = truth_of(made(Draft("x", "none", 7, (), 12, instruments=("plane",))), "none")
    assert touched.poses is None
    assert {one.name: np.shape(one.values) for one in touched.readings} == {"bed": (2, 1)}


@pytest.mark.slow
def test_rough_cases_of_other_instruments_can_be_made() -> None:
    case = made(Draft("x", "rough", 11, instruments=("socket", "tilt")))
    assert {read.described["name"] for read in case.dataset.read} == {"cup", "level"}
