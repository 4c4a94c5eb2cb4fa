"""Numbers, sites, effects and reasons in words, which are made in one place."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace
from typing import get_args

import pinocchio
import pytest

import gtpin
from gtpin import load_robot
from gtpin.calibration.observability import Remedy
from gtpin.diagnosis.result import Gap
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.drive_errors import Linearity
from gtpin.effects.effect import Effect
from gtpin.effects.untestable import Kind, Untestable, as_untestable
from gtpin.estimate import Estimate
from gtpin.report.calibration_text import grouped
from gtpin.report.page import provenance, versions
from gtpin.report.phrases import REASONS, clause, parameter, reason_words, sentence, size_words
from gtpin.report.sections.causes import meaning
from gtpin.report.verdict import beyond_noise
from gtpin.report.words import chance, coordinate_words, covariate_unit, joined, percent, quantity, site_words, typeset


@pytest.mark.parametrize(
    ("value", "unit", "sigma", "told"),
    [
        (2.5e-5, "m", 9.0e-7, "25.00 ± 0.90 µm"),
        (1.2e-3, "m", None, "1.20 mm"),
        (-8.0e-5, "m", 1.3e-4, "−80 ± 130 µm"),
        (3.64e-5, "1/K", 3.6e-6, "(36.4 ± 3.6)·10⁻⁶/K"),
        (5.6e-8, "m/N", 1.1e-8, "56 ± 11 nm/N"),
        (1.0e-4, "m/m", 2.0e-6, "100.0 ± 2.0 µm/m"),
        (12.0, "K", 0.1, "12.00 ± 0.10 K"),
        (0.0, "m", None, "0 m"),
        (float("nan"), "m", None, "not known"),
    ],
)
def test_a_quantity_shows_the_digits_that_its_sigma_allows(value, unit, sigma, told):
    written = quantity(value, unit, sigma)
    assert written.replace("\u00a0", " ") == told
    assert " " not in written.replace("not known", "")  # no line break parts a number from its unit


@pytest.mark.parametrize(
    ("written", "printed"),
    [
        ("-0.5", "−0.5"),
        ("+2.3 and -1.9 mm", "+2.3 and −1.9 mm"),
        ("(-.5, -1)", "(−.5, −1)"),
        ("approach1 = -1", "approach1 = −1"),
        ("1.2e-05", "1.2·10⁻⁵"),
        ("-3e+20", "−3·10²⁰"),
        ("next1-1, 0.5-0.7, 2026-01-31, -o, --seed, left-out", "next1-1, 0.5-0.7, 2026-01-31, -o, --seed, left-out"),
        ("run1e-5, 8468e-2b, 7e5", "run1e-5, 8468e-2b, 7e5"),
    ],
)
def test_hyphens_of_numbers_become_minus_signs_and_no_others(written, printed):
    assert typeset(written) == printed


@pytest.mark.slow
def test_a_dataset_that_was_not_read_is_told_by_the_digests_of_the_files_that_it_is_written_to(single, tmp_path):
    assert single.dataset.path is None
    single.dataset.write(tmp_path / "data")
    told = dict(provenance(single.dataset, load_robot("gantry_tau")).rows)
    for name in ("dataset.toml", "poses.csv"):
        assert told[name] == f"sha256 {hashlib.sha256((tmp_path / 'data' / name).read_bytes()).hexdigest()}"
    assert "not read from files" in told["dataset"]


@pytest.mark.parametrize("share", [1e-9, 0.004, 0.996, 1.0 - 1e-12])
def test_a_share_is_not_rounded_to_nothing_or_all(share):
    assert percent(share).replace("\u00a0", " ") in ("< 1 %", "> 99 %")


def test_a_probability_is_never_told_as_certain():
    assert "100" not in chance(1.0)
    assert chance(0.0) != percent(0.0)


def test_coordinates_and_sites_are_told_in_words():
    assert coordinate_words("q1,q3") == "q1 and q3"
    assert joined(["a", "b", "c"], "or") == "a, b or c"
    assert site_words("frame") == "the instrument"
    assert "the instrument, or" in clause(effects_by_id()["tracker_drift"], "frame")


@pytest.mark.parametrize(("robot", "unit"), [("gantry_tau", "m"), ("ur5", "rad")])
def test_commands_and_speeds_have_the_unit_of_their_actuator(robot, unit):
    units = {"q1": unit, "speed2": f"{unit}/s", "temp_link": "°C", "q9": "", "humidity": ""}
    assert {name: covariate_unit(name, load_robot(robot)) for name in units} == units


@pytest.mark.parametrize("robot", ["gantry_tau", "stewart"])
def test_every_effect_of_the_catalogue_has_a_clause_and_a_remedy_at_each_of_its_sites(robot):
    machine = load_robot(robot)
    for effect in effects_by_id().values():
        for site in effect.sites(machine):
            said = clause(effect, site)
            assert "{" not in said
            assert effect.clause
            assert effect.remedy.endswith(".")
            assert effect.remedy != Effect.remedy
            if effect.id in ("backlash", "link_compliance") and site != "arm":
                assert site in said


@pytest.mark.parametrize("effect", ["tracker_drift", "frame_shift"])
def test_a_motion_of_the_frame_is_told_as_one_of_the_instrument_or_of_the_robots_base(effect: str) -> None:
    found = effects_by_id()[effect]
    for words in (clause(found, "frame"), found.remedy):
        assert "instrument" in words or "tracker" in words
        assert "base" in words


def test_all_links_together_do_what_a_link_does_in_the_plural():
    assert clause(effects_by_id()["link_compliance"], "arm") == "all links stretch under load"
    assert clause(effects_by_id()["link_compliance"], "link1") == "link1 stretches under load"


def test_an_effect_of_a_users_own_without_a_clause_is_told_by_its_title_and_site():
    class HoseDrag(Linearity):
        id = "hose_drag"
        title = "a hose drags"
        clause = ""

    assert clause(HoseDrag(), "leg3") == "a hose drags at leg3"


def test_a_sentence_begins_with_a_capital_but_keeps_a_machines_own_names():
    assert sentence("the track of cart3 is not straight") == "The track of cart3 is not straight."
    assert sentence("cart2 has backlash") == "cart2 has backlash."


def test_versions_are_told_where_pinocchio_has_another_distribution(monkeypatch: pytest.MonkeyPatch) -> None:
    """conda's package, for one, need not be called ``pin``."""
    asked: list[str] = []
    monkeypatch.setattr("gtpin.report.page.version", lambda name: asked.append(name) or "1.2.3")
    told = dict(versions())
    assert "pin" not in asked
    assert told["pin"] == pinocchio.__version__
    assert told["gtpin"] == "1.2.3"


def test_a_gap_that_is_small_beside_the_noise_is_told_in_lengths() -> None:
    small = Gap(before=41e-6, after=40.2e-6, floor=40e-6, explained_fraction=0.8, interval=(0.64, 0.96))
    # sqrt(41^2 - 40^2) = 9 um; powers of 0.64 and 0.96 are sqrt(0.64) = 0.8 and sqrt(0.96) = 0.98 of it.
    assert (
        " ".join(beyond_noise(small).split())
        == "Beyond noise the gap is 9.00 µm; the causes explain 7.20 µm to 8.82 µm of it (95 %)."
    )
    assert beyond_noise(replace(small, before=80e-6)) == ""
    assert beyond_noise(replace(small, before=39e-6)) == ""


def test_every_kind_of_reason_has_words() -> None:
    assert set(REASONS) == set(get_args(Kind))


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        (Untestable("missing", "speed2"), "the covariate speed2 is missing"),
        (Untestable("unusable", "session"), "the values of the covariate session can't be used: a warning says why"),
        (Untestable("constant", "session"), "the covariate session does not vary"),
        (Untestable("too_few_commands", "q3"), "the commands of cart3 are too few, or too close together"),
        (Untestable("absorbed"), "geometric calibration absorbs it"),
        (Untestable("small"), "even many times its typical size would not show above the noise"),
        (None, ""),
    ],
)
def test_words_name_the_covariate_and_the_site(reason: Untestable | None, words: str) -> None:
    assert reason_words(reason, "cart3") == words


def test_an_effect_of_a_users_own_may_give_its_reason_in_words_of_its_own() -> None:
    assert reason_words(as_untestable("the {hose} was off"), "cart1") == "the {hose} was off"
    assert as_untestable("") is None
    assert as_untestable(None) is None
    assert as_untestable(Untestable("one_sign")) == Untestable("one_sign")


@pytest.mark.parametrize("effect", sorted(effects_by_id()))
def test_every_effect_of_the_catalogue_says_its_equation_and_its_parameters(effect):
    for robot in (gtpin.load_robot("gantry_tau"), gtpin.load_robot("ur5")):
        told = meaning(effects_by_id()[effect], robot)
        assert "=" in told[0]
        parameters = next(part for part in told if "Parameters:" in part)
        assert "<code>" in parameters
        assert not any("`" in part or "Typical size" in part for part in told)
        assert not (robot.rods and any("robot without rods" in part[:50] for part in told))


def test_an_effect_without_a_description_of_its_own_says_nothing_of_another():
    assert meaning(type("Silent", (Linearity,), {"id": "silent"})(), gtpin.load_robot("ur5")) == ()


def test_directions_that_nothing_shows_are_one_sentence():
    tilt = Remedy("tilts", "", 12)
    assert grouped(("a", "b", "c"), (None, tilt, None)) == (
        "b",
        "2 other directions hardly move the platform at these poses: no usual measurement would determine them.",
    )
    assert grouped(("a", "b"), (None, tilt)) == ("a", "b")


def test_what_turns_has_periods_a_turn_and_what_slides_has_millimetres():
    half = Estimate(math.pi / 12.0, math.pi / 1200.0, "rad")
    assert size_words({"period": half, "amplitude": Estimate(4.1e-4, 5e-5, "rad")}) == "24 a turn, 410\u00a0µrad"
    vague = Estimate(3.51, 2.2, "rad")  # 1.79 +- 1.12 a turn
    assert size_words({"period": vague, "amplitude": Estimate(4.1e-4, 5e-5, "rad")}).startswith("2 a turn")
    assert parameter("period", half.value, "rad", half.sigma) == ("periods a turn", "24.00\u00a0±\u00a00.24")
    assert parameter("period", 0.0125, "m") == ("period", "12.5\u00a0mm")
    assert quantity(2.7183, "kg", 0.004, alone=True) == "2.72\u00a0kg"
    assert quantity(2.7183, "kg", 0.6, alone=True) == "2.7\u00a0kg"


def test_a_value_that_is_rounding_is_zero() -> None:
    assert quantity(1.46e-33, "m") == "0\u00a0m"
    assert quantity(-1e-20, "rad", 5e-4) == "0\u00a0±\u00a0500\u00a0µrad"
    assert quantity(2e-13, "1/N") != quantity(0.0, "1/N")


def test_a_coupling_is_told_by_the_drive_that_it_goes_with() -> None:
    assert parameter("end_to_end[2]", -3e-4, "rad")[0] == "2nd other drive"
    assert parameter("end_to_end", -3e-4, "rad")[0] == "end to end"
    said = size_words({"end_to_end[1]": Estimate(-3e-4, 1e-5, "rad")})
    assert said == "1st other drive −300\u00a0µrad"


def test_of_a_shift_the_largest_component_is_in_the_headline():
    shift = {f"shift_{axis}": Estimate(v, 5e-6, "m") for axis, v in zip("xyz", (-3.3e-5, 8e-6, 4.2e-5), strict=True)}
    assert size_words(shift | {"turn_x": Estimate(1.0, 1.0, "rad")}) == "shift z 42\u00a0µm"


def test_the_number_of_a_line_is_told_from_its_value() -> None:
    """Not ``periods a turn 2 175.1``, which reads as 2175.1."""
    assert parameter("period_2", 2.0 * math.pi / 175.0, "rad")[0] == "periods a turn (2)"
    assert parameter("amplitude_3", 1e-5, "rad")[0] == "amplitude (3)"
