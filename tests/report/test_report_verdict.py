"""The verdict in a sentence, honest in every case."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from gtpin.diagnosis.result import BestKnown, Considered, Correlate, Leader, Member
from gtpin.effects.untestable import Untestable
from gtpin.estimate import Estimate
from gtpin.report.calibration_text import cannot_judge
from gtpin.report.phrases import cause_rows
from gtpin.report.steps import calibration_steps, steps
from gtpin.report.verdict import could_be, nearest, verdict

pytestmark = pytest.mark.slow  # two diagnoses


def lacking(found, effect: str, column: str, probability: float = 0.0):
    """The candidates, of which the effect can only be tested at one site, and not there: a column is missing."""
    site = "cart2" if effect == "servo_lag" else "cart1"
    one = Considered(effect, site, 0.0, probability, False, Untestable("missing", column))
    return (*(c for c in found.candidates if (c.effect, c.site) != (effect, site)), one)


def words(found) -> str:
    said = verdict(found)
    return " ".join([said.headline, *said.advice]).replace("\u00a0", " ")


def test_noise_that_is_only_taken_from_the_residuals_is_not_said_to_be_found(none):
    lacks = replace(none.candidates[0], testable=False, reason=Untestable("missing", "approach1"))
    supposed = replace(none, noise_source="residuals", candidates=(lacks, *none.candidates[1:]))
    said = verdict(supposed)
    assert "Nothing but noise" not in said.headline
    assert f"{1e6 * none.gap.after:.3g}\u00a0µm" in said.headline
    assert "no other compensation" not in " ".join(said.advice)
    assert "(not recorded: approach" in " ".join(said.advice)


def test_without_positions_only_what_was_read_needs_no_compensation(none):
    """A fit of touches leaves directions of the geometry open that a tracker would show."""
    baseline = none.baseline
    plane = replace(baseline.by_instrument[0], name="bed", kind="plane")
    open_ = replace(baseline.observability, variance_reduction=0.0 * baseline.observability.variance_reduction)
    touched = replace(baseline, by_instrument=(plane,), observability=open_)
    said = " ".join(verdict(replace(none, baseline=touched)).advice)
    assert "The calibrated geometry explains the readings of bed. Positions can still be wrong" in said
    assert "no other compensation" not in said


def test_poses_that_are_too_few_for_the_geometry_are_said_to_be(findings):
    found = findings["none"]
    few = replace(found, noise_source="declared", gap=replace(found.gap, before=10.0 * found.gap.floor))
    said = verdict(few)
    assert said.badge == "too few poses"
    assert said.headline.startswith("These poses are too few")
    assert "is enough" not in " ".join(said.advice)
    assert steps(few)[0].words.startswith("Measure more poses")


def test_what_noise_seldom_leaves_is_not_called_noise_alone(findings):
    found = findings["none"]
    rare = replace(found, unexplained=replace(found.unexplained, p_value=0.004))
    said = verdict(rare)
    assert "0.4 %" in said.headline
    assert "only noise" not in said.headline
    assert "several times" in " ".join(said.advice)
    assert "no other compensation" not in " ".join(said.advice)
    assert "visit ten poses" in steps(rare)[0].words


def test_visits_that_agree_with_the_declared_noise_beside_the_causes_are_said_to(findings):
    found = replace(findings["explained"], noise_source="declared", noise_ratio=1.0)
    noise = found.baseline.noise
    larger = replace(noise, source="repeats", sigma=3.0 * noise.sigma, estimated=np.ones_like(noise.estimated))
    words = "repeated visits agree with the declared noise"
    assert words in " ".join(verdict(replace(found, baseline=replace(found.baseline, noise=larger))).advice)
    assert words not in " ".join(verdict(found).advice)


def test_a_cause_without_another_member_of_its_class_is_not_said_to_be_one_of_several(findings):
    found = findings["explained"]
    alone = replace(found.causes[0], probability=0.94, members=found.causes[0].members[:1])
    said = " ".join(verdict(replace(found, verdict="ambiguous", causes=(alone,))).advice)
    assert "members of a class" not in said
    assert "this cause, or another one" in said


def test_a_cause_is_named_with_its_site_and_what_it_does_to_the_gap(findings):
    found = findings["explained"]
    said = verdict(found)
    cause = found.causes[0]
    assert (cause.effect, cause.site) == ("rack_periodic", "cart2")
    period = cause.parameters["period"].value
    assert said.headline.startswith(f"cart2: periodic drive error, every {1e3 * period:.3g}\u00a0mm, ")
    beyond = np.sqrt(cause.explained_fraction * (found.gap.before**2 - found.gap.floor**2))
    assert said.headline.endswith(f"(certain; {1e6 * beyond:.1f}\u00a0µm of the gap).")
    assert said.badge == "1 certain"


def test_what_can_not_be_distinguished_is_named_with_its_probabilities(findings):
    said = verdict(findings["ambiguous"]).headline.replace("\u00a0", " ")
    assert re.match(
        r"Open, [\d.]+ µm of the gap: periodic drive error at cart2, every \S+ mm, \S+ µm \(60 %\) or smooth drive error at "
        r"cart2 \(40 %\)\.",
        said,
    )
    _, second = cause_rows(findings["ambiguous"])
    assert second[0].split() == ["or", "smooth", "drive", "error", "at", "cart2"]
    assert second[2] == "rms 12.34\u00a0±\u00a00.20\u00a0µm"


def test_the_words_for_the_members_of_a_class_follow_their_probabilities(findings):
    found = findings["ambiguous"]
    (cause,) = found.causes
    members = tuple(replace(m, probability=p) for m, p in zip(cause.members, (0.85, 0.1), strict=True))
    likely = replace(found, causes=(replace(cause, probability=0.85, members=members),))
    said = verdict(likely)
    assert re.search(
        r"of the gap: periodic drive error at cart2, every \S+ mm, \S+ µm \(85 %\); not excluded: smooth drive error at cart2 "
        r"\(10 %\)\.$",
        said.headline.replace("\u00a0", " "),
    )
    assert said.headline.startswith("Probable, ")
    assert "decide" not in " ".join(said.advice)


def test_an_unknown_cause_says_what_moves_with_what_and_warns_of_names(findings):
    said = verdict(findings["unknown"])
    assert re.match(
        r"Unknown, .*: an effect that is not in the catalogue displaces cart1 depending on q1 and q3\.", said.headline
    )
    assert "Don't compensate it as one of the known effects." in " ".join(said.advice)


def test_an_unknown_cause_that_goes_with_nothing_is_bound_to_no_site(findings):
    found = findings["unknown"]
    lost = replace(found, unexplained=replace(found.unexplained, correlates=()))
    assert "cart1" not in verdict(lost).headline
    assert "Don't compensate it as one of the known effects." in " ".join(verdict(lost).advice)


def test_places_of_an_unknown_cause_that_are_equally_probable_are_all_named(findings):
    found = findings["unknown"]
    first, second = found.unexplained.correlates
    scale = Correlate("frame", "time", 1e-18, "stretch", 0.4)
    several = replace(found, unexplained=replace(found.unexplained, correlates=(first, scale, second)))
    said = verdict(several).headline
    assert (
        "displaces cart1 depending on q1 and q3, or changes the scale of the instrument or the whole machine depending on time."
        in said
    )
    assert "platform" not in said


def test_an_unknown_cause_that_many_sites_explain_alike_has_no_place(findings):
    found = findings["unknown"]
    flat = {"cart1": 0.149, "link1": 0.148, "cart2": 0.145, "arm": 0.131, "link2a": 0.07}
    said = verdict(replace(found, where=replace(found.where, site=flat)))
    assert "These data do not show where it acts" in said.headline
    assert "cart1" not in said.headline
    assert "Motions of cart1, link1, cart2 or all links explain it about equally well" in " ".join(said.advice)


def test_a_column_that_no_effect_looks_at_is_named_where_something_is_unknown(findings):
    found = findings["unknown"]
    filled = np.linspace(0.0, 100.0, len(found.dataset))
    columns = {"tank": filled, "still": 0.0 * filled}
    read = replace(found, dataset=replace(found.dataset, covariates={**found.dataset.covariates, **columns}))
    assert "No effect looks at tank." in words(read)
    assert '[[driver]] with column = "tank", site = "cart1"' in words(read)
    assert "No effect looks at" not in words(found)


def test_where_no_sigma_is_declared_a_diagnosis_asks_for_it(findings):
    found = findings["explained"]
    noise = found.baseline.noise
    repeats = replace(noise, source="repeats", estimated=np.ones_like(noise.estimated))
    section = found.dataset.instrument.model_copy(update={"position_sigma": None, "orientation_sigma": None})
    bare = replace(found.baseline, noise=repeats, dataset=replace(found.baseline.dataset, instrument=section))
    assert "Declare the sigma in dataset.toml" in words(replace(found, baseline=bare))
    assert "Declare the sigma in dataset.toml" not in words(found)


def test_a_calibration_that_can_not_be_judged_is_followed_by_a_diagnosis(findings):
    found = findings["explained"].baseline
    noise = replace(found.noise, source="residuals", estimated=np.ones_like(found.noise.estimated))
    unjudged = replace(found, noise=noise)
    assert cannot_judge(unjudged)
    assert any("gtpin diagnose" in step.command for step in calibration_steps(unjudged))


def test_causes_that_are_sure_beside_an_unknown_one_are_told(findings):
    found = replace(findings["unknown"], causes=findings["explained"].causes)
    first, second = verdict(found).headline.splitlines()
    assert first.startswith("cart2: periodic drive error")
    assert second.startswith("Also unknown")
    assert verdict(found).badge == "1 certain, 1 unknown"


def test_a_gap_below_the_noise_claims_no_shrinkage(findings):
    found = findings["explained"]
    said = words(replace(found, gap=replace(found.gap, floor=2.0 * found.gap.before)))
    assert "can't be estimated well" in said
    assert "of the gap's power beyond noise" not in said


def test_what_was_not_recorded_is_asked_for_where_it_could_be_the_cause(findings):
    found = findings["explained"]
    cause = found.causes[0]
    members = (Member(cause.effect, cause.site, 0.5), Member("servo_lag", "cart2", 0.4, recorded=False))
    causes = (replace(cause, probability=0.5, members=members),)
    candidates = lacking(found, "servo_lag", "speed2", 0.4)
    doubtful = replace(found, verdict="ambiguous", causes=causes, candidates=candidates)
    advice = " ".join(verdict(doubtful).advice)
    assert "servo lag at cart2 can't be ruled out, because the covariate speed2 is missing" in advice
    assert "makes no difference" not in advice


def test_two_that_only_together_could_be_the_cause_are_said_together(findings):
    found = findings["explained"]
    cause = found.causes[0]
    drift, links = ("tracker_drift", "frame"), ("thermal_links", "arm")
    pair = (Member(*drift, 0.2, beside=links), Member(*links, 0.2, beside=drift))
    members = (Member(cause.effect, cause.site, 0.6), *pair)
    doubtful = replace(found, verdict="ambiguous", causes=(replace(cause, probability=0.6, members=members),))
    _, (said, chance, *_) = cause_rows(doubtful)
    both = "or drift over time (or of the base) at the instrument with thermal growth of links at all links"
    assert said.split() == both.split()
    assert chance == "40\u00a0%"


def test_what_could_be_the_cause_is_said_in_the_order_of_probability(findings):
    found = findings["explained"]
    cause, drift, links = found.causes[0], ("tracker_drift", "frame"), ("thermal_links", "arm")
    pair = (Member(*drift, 0.25, beside=links), Member(*links, 0.25, beside=drift))
    members = (Member(cause.effect, cause.site, 0.3), *pair, Member("backlash", "cart3", 0.15))
    doubtful = replace(found, verdict="ambiguous", causes=(replace(cause, probability=0.3, members=members),))
    rows = cause_rows(doubtful)
    assert [row[1] for row in rows] == [f"{percent}\u00a0%" for percent in (50, 30, 15, 5)][: len(rows)]
    assert rows[0][0].startswith("drift over time")
    assert rows[1][0].startswith("  or ")
    assert rows[1][3]  # what the cause explains stays beside it
    line = next(line for line in verdict(doubtful).headline.splitlines() if "Open" in line)
    assert line.index("drift over time") < line.index("others")
    two = replace(found, verdict="ambiguous", causes=(replace(cause, probability=0.3, members=members[:3]),))
    line = next(line for line in verdict(two).headline.splitlines() if "Open" in line)
    assert line.index("drift over time") < line.index(found.effect(cause.effect).title)


def test_three_that_only_together_could_be_the_cause_are_one_row(findings):
    found = findings["explained"]
    cause, sites = found.causes[0], ("cart1", "cart2", "cart3")
    each = [
        Member("cart_compliance", site, 0.1, beside=("cart_compliance", sites[(i + 1) % 3]))
        for i, site in enumerate(sites)
    ]
    members = (Member(cause.effect, cause.site, 0.7), *each)
    rows = cause_rows(replace(found, causes=(replace(cause, probability=0.7, members=members),)))
    assert [row[1] for row in rows] == ["70\u00a0%", "30\u00a0%"]
    assert all(site in rows[1][0] for site in sites)


def test_a_headline_has_two_lines_however_many_causes_there_are(findings):
    found = findings["explained"]
    cause = found.causes[0]
    more = tuple(replace(cause, site=site) for site in ("cart1", "cart2", "cart3"))
    first, second = verdict(replace(found, causes=more)).headline.splitlines()
    assert first.startswith("cart1: periodic drive error")
    assert second.startswith("Also periodic drive error at cart2 (")
    (only, unknown) = verdict(replace(findings["unknown"], causes=more)).headline.splitlines()
    assert all(site in only for site in ("cart1", "cart2", "cart3"))
    assert unknown.startswith("Also unknown")


def test_an_unknown_says_what_could_not_be_tested_and_would_account_for_it(findings):
    found = findings["unknown"]
    unexplained = replace(found.unexplained, could_be={("zero_shift", "cart1"): None})
    candidates = lacking(found, "zero_shift", "session")
    advice = " ".join(verdict(replace(found, candidates=candidates, unexplained=unexplained)).advice)
    assert "could be zero shift at cart1, which these data can't test: the covariate session is missing." in advice
    assert "could be" not in " ".join(verdict(found).advice)


def test_an_unknown_says_which_likely_cause_it_could_be(findings):
    found = findings["unknown"]
    likely = next(c for c in found.candidates if c.testable and c.reason is None)
    unexplained = replace(found.unexplained, could_be={(likely.effect, likely.site): 1e-4})
    advice = " ".join(verdict(replace(found, unexplained=unexplained)).advice)
    assert f"at {likely.site}; these data can't distinguish it from an effect that gtpin does not know." in advice


LEFT = {("tracker_drift", "frame"): 0.4, ("target_drift", "platform"): 0.45, ("backlash", "cart1"): 0.95}
"""Errors that mechanisms leave, as a share of the gap."""


def with_leaders(found, *best):
    leaders = tuple(Leader(*place, 100.0, share * found.gap.before) for place, share in LEFT.items())
    known = BestKnown(best, 0.4 * found.gap.before) if best else None
    return replace(found, unexplained=replace(found.unexplained, leaders=leaders, best_known=known))


def test_of_two_mechanisms_that_explain_nearly_as_much_both_are_named(findings):
    found = with_leaders(findings["unknown"], ("tracker_drift", "frame"))
    assert found.causes == ()
    said = nearest(found)
    assert "at the instrument, or drift of the tool or target at the platform." in said
    assert "backlash" not in said
    explained, whole = said.replace("\u00a0", " ").split("explains ")[1].split(" at left-out")[0].split(" of ")
    assert float(explained.split()[0]) == pytest.approx(np.sqrt(1.0 - 0.4**2) * float(whole.split()[0]), rel=0.01)


def test_a_named_cause_has_beside_it_what_could_be_in_its_place_and_not_what_comes_next(findings):
    cause = findings["explained"].causes[0]
    place, other = (cause.effect, cause.site), ("linearity", "cart2")
    alone = with_leaders(replace(findings["unknown"], causes=(cause,)), place)
    assert nearest(alone).endswith("periodic drive error at cart2.")
    members = (Member(*place, 0.6), Member(*other, 0.4))
    open_ = with_leaders(replace(findings["unknown"], causes=(replace(cause, members=members),)), place)
    assert nearest(open_).endswith("periodic drive error at cart2, or smooth drive error at cart2.")
    two = with_leaders(open_, place, ("backlash", "cart1"))
    assert "(or smooth drive error at cart2) and backlash" in nearest(two)


def test_where_no_mechanism_comes_near_the_first_is_told_and_not_called_possible(findings):
    found = findings["unknown"]
    first = Leader("backlash", "cart1", 1.0, 0.99 * found.gap.before)
    far = replace(
        found, unexplained=replace(found.unexplained, leaders=(first,), could_be={("backlash", "cart1"): 1e-5})
    )
    assert nearest(far).startswith("No known mechanism comes near: backlash")
    assert could_be(far) == []
    assert "not in the catalogue" in verdict(far).headline


def test_silence_is_not_called_good_where_scatter_may_hide_what_could_not_be_tested(findings):
    found = findings["none"]
    noise = replace(found.baseline.noise, repeatability=2.0 * found.baseline.noise.position_sigma)
    others = tuple(c for c in found.candidates if c.effect not in ("backlash", "servo_lag"))
    candidates = lacking(replace(found, candidates=others), "backlash", "approach1")
    scattered = replace(found, baseline=replace(found.baseline, noise=noise), candidates=candidates)
    said = verdict(scattered)
    assert said.tone == "warn"
    assert "no other compensation" not in " ".join(said.advice)
    assert "backlash (or friction wind-up) could not be tested: record approach1" in " ".join(said.advice)
    recorded = replace(scattered, candidates=others)
    assert verdict(recorded).tone == verdict(found).tone == "good"


def test_periods_without_a_common_gear_are_said_to_be_a_rough_drive(findings):
    found = findings["explained"]
    lines = {"period": 1.4, "period_2": 0.9, "period_3": 0.62}
    parameters = {name: Estimate(value, 0.01, "rad") for name, value in lines.items()}
    parameters |= {name.replace("period", "amplitude"): Estimate(4e-4, 1e-5, "rad") for name in lines}
    cause = replace(found.causes[0], effect="rack_periodic", site="cart2", parameters=parameters)
    gear, rough = (words(replace(found, causes=(replace(cause, nature=one),))) for one in ("mechanism", "profile"))
    assert "cart2: periodic drive error" in gear
    assert "rough" not in gear
    assert "cart2: rough drive, 490 µrad RMS, 3 periods without a common gear" in rough
    assert "Compensate by the curve" in rough


def test_a_machine_that_does_not_repeat_is_not_called_good(findings):
    found = findings["none"]
    sigma = found.baseline.noise.position_sigma
    noise = replace(found.baseline.noise, repeatability=5.0 * sigma)
    loose = replace(found, baseline=replace(found.baseline, noise=noise), gap=replace(found.gap, floor=8.0 * sigma))
    said = verdict(loose)
    assert said.tone == "warn"
    assert "scatter between repeated visits" in said.headline
    assert "no other compensation" not in " ".join(said.advice)
