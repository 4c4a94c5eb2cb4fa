"""Every figure of a score against arithmetic by hand."""

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from handmade import cause, diagnosis, judged

from gtpin.bench.blind.judged import Judged, Shrunk, Statement
from gtpin.bench.blind.page import failure, instrument_table, score_page
from gtpin.bench.blind.score import confusion, figures, matched_filter, mean, power, rate, score, tenths

LINEARITY = ("linearity@cart1", 500.0, 100.0)


def figure(cases: list[Judged], name: str) -> tuple[float | None, int]:
    (found,) = [f for f in figures(cases) if f.name == name]
    return found.rate.value, found.rate.of


def one(name: str, told: dict[str, Any], **more: Any) -> Judged:
    return judged(name, "one", [LINEARITY], told, **more)


RIGHT = one("right", diagnosis("explained", cause("linearity@cart1")))
AMBIGUOUS = one("ambiguous", diagnosis("ambiguous", cause("linearity@cart1", 0.7, straightness_AT_cart1=0.3)))
OTHER = one("other", diagnosis("ambiguous", cause("straightness@cart1", 0.7, linearity_AT_cart1=0.3), site="cart2"))
BESIDE = one("beside", diagnosis("explained", cause("linearity@cart1"), cause("backlash@cart2")))
UNKNOWN = one("unknown", diagnosis("unknown", cause("linearity@cart1")))
MISSED = one("missed", diagnosis("none"))
FAILED = Judged(name="failed", kind="one", truth=RIGHT.truth, error="no")
SINGLES = [RIGHT, AMBIGUOUS, OTHER, BESIDE, UNKNOWN, MISSED, FAILED]


def test_strict_is_the_cause_alone_with_its_site_and_no_unknown() -> None:
    assert [c.strict for c in SINGLES] == [True, True, False, False, False, False, False]
    assert figure(SINGLES, "cause and site right, nothing else named, D > 63") == (2 / 7, 7)
    assert score(SINGLES)["strict"] == 2 / 7


def test_the_class_is_that_of_all_causes_together() -> None:
    assert [c.in_class for c in SINGLES] == [True, True, True, True, True, False, False]
    assert figure(SINGLES, "class holds the truth, E > 63") == (5 / 7, 7)
    assert figure(SINGLES, "members of the class, E > 63") == ((1 + 2 + 2 + 2 + 1) / 5, 5)


def test_a_failed_case_is_never_right() -> None:
    assert figure(SINGLES, "detected, E > 63") == (5 / 7, 7)
    null = Judged(name="n", kind="none", error="no")
    assert figure([null], "no effect: silent") == (0.0, 1)
    told = score([*SINGLES, null])
    assert told["failed"] == 2 / 8
    assert told["failures"] == ["failed", "n"]
    assert failure(FAILED) == "no"


def test_effects_count_only_where_their_energy_allows() -> None:
    weak = judged("weak", "one", [("linearity@cart1", 40.0, 10.0)], diagnosis("none"))
    said = diagnosis("explained", cause("straightness@cart1", 0.96))
    cases = [RIGHT, weak, judged("twin", "one", [("linearity@cart1", 900.0, 3.0)], said)]
    assert figure(cases, "detected, E > 63") == (1.0, 2)
    assert figure(cases, "cause and site right, nothing else named, D > 63") == (1.0, 1)
    assert figure(cases, "no false name with confidence, D <= 63") == (0.5, 2)
    unmeasured = judged("unmeasured", "one", [("linearity@cart1", None, None)], diagnosis("none"))
    assert figure([unmeasured], "detected, E > 63") == (None, 0)


def test_where_is_right_if_its_leading_site_is_the_effects() -> None:
    assert figure([RIGHT, OTHER], "site that leads where right, D > 63") == (0.5, 2)
    nowhere = diagnosis("none")
    nowhere["where"]["site"] = {"cart1": 0.0, "frame": 0.0}
    assert Statement.of(nowhere).site == ""


def test_a_stranger_in_the_class_is_an_effect_that_leaves_much() -> None:
    near = AMBIGUOUS.model_copy(update={"left": {"linearity@cart1": 5.0, "straightness@cart1": 62.0}})
    far = AMBIGUOUS.model_copy(update={"left": {"linearity@cart1": 90.0, "straightness@cart1": 64.0}})
    assert figure([near, far], "class with a member that leaves more than 63, E > 63") == (0.5, 2)


def test_false_alarms_are_anything_that_is_not_none() -> None:
    silent = judged("s", "none", [], diagnosis("none"))
    alarm = judged("a", "none", [], diagnosis("unknown"))
    told = score([silent, silent, silent, alarm])
    assert told["false_alarm"] == 0.25
    assert figure([silent, silent, silent, alarm], "no effect: silent") == (0.75, 4)


def test_unlisted_effects_are_recognised_or_misnamed() -> None:
    hose, weaker = [("hose@platform", 900.0, 300.0)], [("hose@platform", 900.0, 200.0)]
    seen = judged("s", "unlisted", hose, diagnosis("unknown"), listed=False)
    blamed = judged("b", "unlisted", hose, diagnosis("explained", cause("backlash@cart1")), listed=False)
    unsure = judged("u", "unlisted", weaker, diagnosis("ambiguous", cause("backlash@cart1", 0.6)), listed=False)
    cases = [seen, blamed, unsure]
    assert figure(cases, "outside the catalogue: unknown, where others leave more than 250") == (0.5, 2)
    assert figure(cases, "outside the catalogue: unknown, all") == (1 / 3, 3)
    assert figure(cases, "outside the catalogue: a cause named with confidence, all") == (1 / 3, 3)
    assert figure(cases, "outside the catalogue: any cause named, all") == (2 / 3, 3)
    assert (score(cases)["unknown_recognised"], score(cases)["unknown_misnamed"]) == (1 / 3, 2 / 3)


def test_an_effect_taken_out_is_judged_as_one_that_nobody_knows() -> None:
    unknown = Statement.of(diagnosis("unknown"))
    blamed = Statement.of(diagnosis("explained", cause("straightness@cart1")))
    good = RIGHT.model_copy(update={"without": unknown, "without_left": 300.0})
    bad = RIGHT.model_copy(update={"without": blamed, "without_left": 260.0})
    weak = RIGHT.model_copy(update={"without": blamed, "without_left": 10.0})
    broken = RIGHT.model_copy(update={"without_error": "no", "without_left": 300.0})
    cases = [good, bad, weak, broken, RIGHT]
    assert figure(cases, "taken out of the catalogue: unknown, where others leave more than 250") == (1 / 3, 3)
    assert figure(cases, "taken out of the catalogue: any cause named, all") == (0.5, 4)
    assert score(cases)["by_effect"]["linearity"]["taken_out_unknown"] == 0.25


def test_sets_are_scored_by_f1() -> None:
    truth = [("linearity@cart1", 500.0, 100.0), ("backlash@cart2", 500.0, 100.0)]
    half = judged("h", "two", truth, diagnosis("explained", cause("linearity@cart1")))
    site = judged("w", "two", truth, diagnosis("explained", cause("linearity@cart1"), cause("backlash@cart3")))
    whole = judged("a", "two", truth, diagnosis("explained", cause("backlash@cart2"), cause("linearity@cart1")))
    assert [c.f1 for c in (half, site, whole)] == [2 * 1 / (1 + 2), 2 * 1 / (2 + 2), 1.0]
    assert figure([half, site, whole], "two effects: F1 of the set")[0] == pytest.approx((2 / 3 + 0.5 + 1.0) / 3)
    assert [c.class_f1 for c in (half, site, whole)] == [2 * 1 / (1 + 2), 2 * 1 / (2 + 2), 1.0]
    assert judged("n", "two", truth, diagnosis("none")).class_f1 == 0.0
    weak = judged("k", "two", [truth[0], ("backlash@cart2", 40.0, 9.0)], diagnosis("none"))
    assert figure([half, site, whole, weak], "two effects, E > 63 of each: F1 of the set")[1] == 3
    three = judged("t", "three", [*truth, ("servo_lag@cart1", 90.0, 80.0)], diagnosis("none"))
    assert score([half, three])["set_f1"] == pytest.approx(1 / 3)


def test_probabilities_are_held_against_how_often_they_were_right() -> None:
    cases = [RIGHT] * 3 + [one("wrong", diagnosis("explained", cause("backlash@cart1", 0.91)))]
    ((_, said, right),) = tenths(cases)
    assert said == pytest.approx((3 * 0.99 + 0.91) / 4)
    assert right.value == 0.75
    low, high = tenths([AMBIGUOUS], members=True)
    assert (low[0], low[1], low[2].value) == (0.3, 0.3, 0.0)
    assert (high[0], high[1], high[2].value) == (0.7, 0.7, 1.0)
    assert figure(cases, "probabilities: farthest off of the tenths that have 30 causes") == (None, 0)
    value, _ = figure(cases * 8, "probabilities: farthest off of the tenths that have 30 causes")
    assert value == pytest.approx(0.97 - 0.75)


def test_stated_probabilities_have_proper_scores_and_risk_against_coverage() -> None:
    wrong = one("wrong", diagnosis("explained", cause("backlash@cart1", 1.0)))
    cases = [AMBIGUOUS, wrong, MISSED, UNKNOWN]  # 0.7 and 0.99 true, 1.0 false, and nothing
    brier, _ = figure(cases, "Brier score of the named causes")
    assert brier == pytest.approx((0.3**2 + 1.0 + 0.01**2) / 3)
    log, of = figure(cases, "log score of the named causes, nats")
    assert of == 3
    assert log == pytest.approx(-(np.log(0.7) + np.log(0.99) + np.log(1e-3)) / 3)
    assert figure(cases, "risk of causes of 0.9 or more") == (0.5, 2)
    assert figure(cases, "risk of causes of 0.5 or more") == (pytest.approx(1 / 3), 3)
    assert figure(cases, "coverage of causes of 0.5 or more, one effect, E > 63") == (0.75, 4)
    assert figure(cases, "coverage of causes of 0.99 or more, one effect, E > 63") == (0.5, 4)


def test_shrinkage_is_held_against_the_true_poses() -> None:
    shrunk = Shrunk(before=1e-4, after=5e-5)  # three quarters of the power
    cases = [RIGHT]
    for share, interval in ((0.70, (0.6, 0.8)), (0.90, (0.8, 0.95))):
        said = diagnosis("explained", cause("linearity@cart1"), explained_fraction=share, interval=interval)
        cases.append(one("x", said, shrunk=shrunk))
    assert figure(cases, "shrinkage said less realised, absolute")[0] == pytest.approx(0.10)
    assert figure(cases, "shrinkage said less realised")[0] == pytest.approx(0.05)
    assert figure(cases, "95 % interval of shrinkage covers") == (0.5, 2)
    assert score(cases)["shrinkage_error"] == pytest.approx(0.10)


def test_parameters_are_covered_within_their_sigmas() -> None:
    close = RIGHT.model_copy(update={"parameters": (("size", 2.0, 0.5, 2.9), ("size", 2.0, 0.5, 3.1))})
    assert figure([close], "95 % intervals of parameters cover") == (0.5, 2)


def test_rough_data_count_where_the_covariate_is_there() -> None:
    told = diagnosis("ambiguous", cause("linearity@cart1"))
    seen = judged("s", "rough", [LINEARITY], told)
    lacking = judged("l", "rough", [LINEARITY], diagnosis("none"), testable=False)
    unlisted = judged("u", "rough", [("hose@platform", 500.0, 300.0)], told, listed=False)
    assert figure([seen, lacking, unlisted], "rough data: class holds the truth, E > 63, covariate there") == (1.0, 1)


def test_confusion_counts_leading_causes_and_verdicts() -> None:
    assert confusion(SINGLES) == {"linearity": {"failed": 1, "linearity": 4, "none": 1, "straightness": 1}}


def test_power_counts_by_poses_and_energy() -> None:
    found = judged("f", "power", [("linearity@cart1", 20.0, 5.0)], diagnosis("unknown"), planned=60)
    lost = judged("l", "power", [("linearity@cart1", 30.0, 5.0)], diagnosis("none"), planned=60)
    other = judged("o", "power", [("linearity@cart1", 30.0, 5.0)], diagnosis("none"), planned=120)
    first, second = power([found, lost, other], (60, 120))
    assert (first["poses"], first["start"], first["end"], first["found"]["value"]) == (60, 16.0, 32.0, 0.5)
    assert (second["poses"], second["found"]["value"]) == (120, 0.0)
    assert first["energy"] == pytest.approx(600**0.5)


def test_what_is_right_is_no_failure_and_what_is_not_has_a_reason() -> None:
    assert [failure(c) is None for c in SINGLES] == [True, True, False, False, False, False, False]
    assert "straightness@cart1 named instead" in str(failure(OTHER))
    assert "backlash@cart2 named in addition" in str(failure(BESIDE))
    weak = judged("w", "one", [("linearity@cart1", 40.0, 10.0)], diagnosis("none"))
    assert "E <= 63" in str(failure(weak))
    hose = judged("h", "unlisted", [("hose@platform", 900.0, 300.0)], diagnosis("unknown"), listed=False)
    assert failure(hose) is None


def test_nothing_to_count_gives_no_fraction() -> None:
    told = score([])
    fractions = "strict in_class class_size site false_alarm unknown_recognised unknown_misnamed set_f1 shrinkage_error"
    assert all(told[name] is None for name in (*fractions.split(), "interval_coverage", "failed"))
    assert told["cases"] == 0


# ------------------------------------------------------------------------------------- instruments that can't show all

BOTH_SEEN = [("linearity@cart1", 500.0, 100.0), ("backlash@cart2", 500.0, 100.0)]
ONE_SEEN = [("linearity@cart1", 500.0, 100.0), ("straightness@cart2", 40.0, 5.0)]
NONE_SEEN = [("target_offset@platform", 0.0, 0.0), ("straightness@cart2", 63.0, 5.0)]
WIRE, BED = ("range",), ("plane",)


def two(name: str, truth: list[tuple[str, float | None, float | None]], *named: str, **more: Any) -> Judged:
    told = diagnosis("explained" if named else "none", *(cause(one) for one in named))
    return judged(name, "two", truth, told, **{"instruments": WIRE, **more})


def test_an_effect_that_is_not_visible_counts_neither_as_missing_nor_as_false() -> None:
    assert two("a", ONE_SEEN, "linearity@cart1").visible_f1 == 1.0
    assert two("b", ONE_SEEN, "linearity@cart1", "straightness@cart2").visible_f1 == 1.0
    assert two("c", ONE_SEEN, "straightness@cart2").visible_f1 == 0.0
    assert two("d", ONE_SEEN, "linearity@cart1", "backlash@cart3").visible_f1 == 2 * 1 / (2 + 1)
    assert two("e", [("linearity@cart1", None, None)], "backlash@cart3").not_visible == frozenset()


def test_where_all_effects_are_visible_the_set_is_scored_as_ever() -> None:
    both = ["linearity@cart1", "backlash@cart2"]
    for named in ([], both[:1], both, ["backlash@cart3", "linearity@cart1"]):
        case = two("x", BOTH_SEEN, *named)
        assert case.visible_f1 == case.f1


def test_sets_of_instruments_are_scored_over_what_can_be_seen_and_the_rest_is_counted() -> None:
    cases = [
        two("a", ONE_SEEN, "linearity@cart1"),
        two("b", NONE_SEEN),
        two("c", BOTH_SEEN, "linearity@cart1"),
        two("f", BOTH_SEEN).model_copy(update={"said": None, "error": "no"}),
    ]
    told = score(cases)
    assert told["set_f1_visible"] == pytest.approx((1.0 + 2 / 3 + 0.0) / 3)  # nothing can be found in b
    assert told["not_visible"] == {"effects": 8, "not_visible": 3}
    assert told["set_f1"] == pytest.approx((2 / 3 + 0.0 + 2 / 3 + 0.0) / 4)  # the contract's: of all effects
    assert figure(cases, "two effects: F1 of those with E > 63") == (pytest.approx((1.0 + 2 / 3) / 3), 3)
    (plain,) = [f for f in figures(cases) if f.name == "two effects: F1 of the set"]
    assert plain.least is None


def test_a_check_by_a_tracker_alone_has_no_figures_of_instruments() -> None:
    cases = [*SINGLES, two("a", ONE_SEEN, "linearity@cart1", instruments=None)]
    told = score(cases)
    assert not {"set_f1_visible", "not_visible", "by_instrument"} & set(told)
    (plain,) = [f for f in figures(cases) if f.name.startswith("two effects: F1")]
    assert (plain.name, plain.least) == ("two effects: F1 of the set", 0.95)
    assert ">By instrument<" not in score_page(told, cases)
    assert failure(cases[-1]) == "missing straightness@cart2"


def test_each_instrument_has_its_own_rates_with_wilsons_bounds() -> None:
    wire = [case.model_copy(update={"instruments": WIRE, "name": f"w{case.name}"}) for case in SINGLES]
    weak = judged("weak", "one", [("linearity@cart1", 40.0, 10.0)], diagnosis("none"), instruments=BED)
    shrunk, wrong = Shrunk(before=2.0, after=1.0), diagnosis("explained", cause("straightness@cart1"))
    near = judged("near", "one", [("linearity@cart1", 90.0, 10.0)], wrong, instruments=BED, shrunk=shrunk)
    gap = diagnosis("explained", cause("linearity@cart1"), explained_fraction=0.5)
    both = one("both", gap, instruments=("plane", "range"), shrunk=shrunk)
    silent = judged("silent", "none", [], diagnosis("none"), instruments=BED)
    plain = judged("plain", "none", [], diagnosis("unknown"))
    rows = score([*wire, weak, near, silent, both, plain])["by_instrument"]
    counts = {name: row["cases"] for name, row in rows.items()}
    assert counts == {"plane": 3, "plane + range": 1, "range": 7, "tracker": 1}
    for key, hits in (("detected", 5), ("in_class", 5), ("strict", 2)):
        assert rows["range"][key] == asdict(rate(i < hits for i in range(7)))
    assert rows["plane"]["detected"] == asdict(rate([True]))
    assert rows["plane"]["in_class"] == asdict(rate([False]))
    assert rows["plane"]["strict"]["of"] == 0  # no D above 63
    assert rows["plane"]["silent"] == asdict(rate([True]))
    assert rows["tracker"]["silent"] == asdict(rate([False]))
    assert rows["plane"]["false_with_confidence"] == asdict(rate([True, False, False]))
    assert rows["plane + range"]["shrinkage_error"]["value"] == pytest.approx(0.25)  # 0.5 said, 0.75 realised


def test_the_page_of_a_check_by_instruments_has_their_table_and_says_what_could_not_be_seen() -> None:
    cases = [two("a", ONE_SEEN, "linearity@cart1"), two("b", BOTH_SEEN, "linearity@cart1", instruments=BED)]
    told = score(cases)
    table = instrument_table(told)
    assert [row[0] for row in table.rows] == ["plane", "range"]
    assert [row[-1] for row in table.rows] == ["0 of 2", "1 of 2"]
    assert all(len(row) == len(table.head) for row in table.rows)
    assert ">By instrument<" in score_page(told, cases)
    assert failure(cases[0]) == "not visible (E <= 63) straightness@cart2"
    assert failure(cases[1]) == "missing backlash@cart2"


@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    # Newcombe, Statistics in Medicine 17, 1998, table I: method 3.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_bounds_of_a_rate_are_wilsons(hits: int, of: int, low: float, high: float) -> None:
    found = rate([True] * hits + [False] * (of - hits))
    assert found.value == hits / of
    assert found.low == pytest.approx(low, abs=5e-5)
    assert found.high == pytest.approx(high, abs=5e-5)


def test_a_rate_of_no_case_is_not_known() -> None:
    assert asdict(rate([])) == {"value": None, "low": None, "high": None, "of": 0}
    assert mean([]).value is None


def test_a_mean_has_bounds_of_its_standard_error() -> None:
    found = mean([1.0, 2.0, 3.0])  # standard deviation 1, of three
    assert found.value == 2.0
    assert found.high == pytest.approx(2.0 + 1.96 / 3**0.5, abs=1e-4)
    assert mean([4.0]).low is None


def test_a_matched_filter_finds_95_in_100_at_the_energy_that_the_design_says() -> None:
    assert matched_filter(15.8) == pytest.approx(0.95, abs=0.001)
    assert matched_filter(0.0) == pytest.approx(0.01)
