"""The figures that pages print are those of the records, and the numbers that they say of the code are the code's own."""

import json
import sys
from pathlib import Path

import pytest
from scipy.stats import t

from gtpin.diagnosis import discrimination as splitting
from gtpin.diagnosis import evidence, gap, joint_fit, noise, periodic_lines, priors, scan, search
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.discrimination import PROMISED, SIMULATED
from gtpin.diagnosis.trials import SESSIONS
from gtpin.effects.rack import LEAST_TURNS
from gtpin.effects.smooth import SLOWEST_LINE
from gtpin.report import residual_plots
from gtpin.report.geometry import CLEAR

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples" / "pages"))

import refresh  # noqa: E402  (the scripts of examples are no package)


@pytest.mark.parametrize("page", refresh.pages(), ids=lambda page: page.name)
def test_a_page_shows_what_its_records_hold(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert refresh.refreshed(text) == text, "run python examples/pages/refresh.py"


def test_what_the_text_says_of_planted_causes_is_in_their_record() -> None:
    record = json.loads((ROOT / "docs" / "figures" / "planted.json").read_text(encoding="utf-8"))
    last, before = record["sealed"], record["earlier"]["60 of 2026-11-30"]
    assert last["all"]["kept"][1] == 0
    silent, of = last["all"]["silent"]
    by_energy = ["{} of {}".format(*last[f"E {energy}"]["named"]) for energy in (100, 300, 1000, 3000)]
    said = (
        f"from 100 to 3000: {', '.join(by_energy[:-1])} and {by_energy[-1]}.",
        f"New causes of 0.9 or more, in {of - silent} of {of}:",
        "of the causes that were certain before, {} of {} were still".format(*before["ur10"]["kept"]),
        "what the residuals had along it in {} of {} named cases".format(*last["all"]["right sum"]),
    )
    text = (ROOT / "docs" / "blind.md").read_text(encoding="utf-8")
    assert [words for words in said if words not in text] == []


def test_what_the_text_says_of_machines_of_another_author_is_in_their_record() -> None:
    found = json.loads((ROOT / "docs" / "figures" / "independent.json").read_text(encoding="utf-8"))
    verdicts, silent = found["verdicts"], found["innocent"]
    assert sum(verdicts.values()) == found["datasets"]
    said = (
        f"| false cause of 0.9 or more | {found['false 0.9']} |",
        f"| false cause of 0.5 or more | {found['false 0.5']} |",
        f"| true cause of 0.5 or more | {found['true 0.5']} |",
        f"| true cause in a class | {found['in a class']} |",
        "| `unknown`; `ambiguous`; `explained`; `none` | {unknown}; {ambiguous}; {explained}; {none} |".format(
            **verdicts
        ),
        f"{silent[0]} of {silent[1]} machines without an effect",
        f"Beside `unknown`, {found['beside unknown, false 0.5']} of {verdicts['unknown']} have a false cause",
    )
    text = (ROOT / "docs" / "blind.md").read_text(encoding="utf-8")
    assert [words for words in said if words not in text] == []


def test_every_figure_is_on_a_page() -> None:
    shown = {found[2] for page in refresh.pages() for found in refresh.BLOCK.finditer(page.read_text(encoding="utf-8"))}
    assert shown == set(refresh.TABLES)


WORDS = {3: "three", 4: "four", 5: "five"}
P = priors.PRIORS
CONSTANTS = {
    "diagnosis": (
        f"each with a probability of {100 * priors.SURE:g} % or more",
        f"gain: below {splitting.NONE_EXPECTED:g} nats, only",
        f"below {100 * PROMISED:g} %, how many rounds",
        f"with {SIMULATED} simulated",
        f"in {SESSIONS} further sessions",
        f"below {splitting.LEAST_EXPECTED:g} nat, the round and what",
        f"`--false-alarm` (default {FALSE_ALARM:g})",
        f"{P.silent:g} times the noise floor on left-out poses, or {P.excess:g} times the noise in the",
        f"with causes also {100 * P.core_leaves:g} % of the gap",
        f"per degree of freedom exceeds {P.misfit:g}, the noise",
        f"by a factor of {P.understated:g} (without eight repeated visits: the residuals alone, by {P.understated_once:g})",
        f"{t.ppf(0.975, 1) * 1.5**0.5:.0f} standard deviations wide to either side",
    ),
    "report": (
        f"each has a probability of {100 * priors.SURE:g} % or more",
        f"differ most from nominal (by more than {WORDS[int(CLEAR)]} sigmas)",
    ),
    "glossary": (
        f"at least {100 * priors.CLASS_SHARE:g} % of the probability of the likeliest",
        f"The temperature, {P.temperature:g} to ",
        f"ln s ~ N(0, {P.scale_spread:g}²)",
    ),
    "speed": (
        f"A diagnosis searches on at most {noise.MOST_POSES:,} poses",
        f"Plots show at most {residual_plots.MOST:,} poses",
    ),
    "statistics": (
        f"else `other` ({100 * P.same:g}, {100 * P.related:g} and {100 * P.other:g} %)",
        f"a smooth function has parts with up to {SLOWEST_LINE:g} periods a turn",
        f"at least {LEAST_TURNS:g} periods in the joint's range of commands where the joint has no",
        f"out of {len(evidence.SCALES)} between {evidence.SCALES[0]:.2g} and {evidence.SCALES[-1]:g}",
        f"have at least {scan.ALIKE:g} of its gain",
        f"those with at least {scan.LIKELY:g} of the largest such gain",
        f"more than {noise.FEW_POSES:,} poses a long model is searched on {noise.FEW_POSES:,} of them",
        f"until that gains less than {periodic_lines.LINES_CONVERGED:g} nats",
        f"68 % of {2 * joint_fit.PARAMETER_DRAWS} draws from the posterior",
        f"has {gap.INTERVAL_DRAWS} draws: coefficients from their posterior, {gap.PREDICTED_POSES} poses",
        f"each of the {WORDS[search.BEAM]} best single hypotheses",
        f"at most {WORDS[search.MOST_TERMS]} members",
        f"{WORDS[gap.BLOCK_POSES]} neighbouring poses",
    ),
}
"""Numbers that a page of the docs says of the code, with the code's own in them."""


@pytest.mark.parametrize(("page", "phrase"), [(page, one) for page, some in CONSTANTS.items() for one in some])
def test_a_constant_on_a_page_is_the_codes(page: str, phrase: str) -> None:
    assert phrase in " ".join((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8").split())


def test_every_time_on_the_page_of_speed_is_of_a_benchmark_that_exists() -> None:
    import speed

    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "benchmarks").glob("test_*.py"))
    pairs = (*speed.RATIOS.values(), *speed.ARM_RATIOS.values())
    named = {*speed.ROWS, *speed.ARM_ROWS, *(name for pair in pairs for name in pair)}
    assert named == {name for name in named if f"def {name}(" in code}
    times = json.loads(speed.RECORD.read_text(encoding="utf-8"))["benchmarks"]
    assert named <= set(times)
    found = speed.ratios(times)
    assert found["a closed posture by `fsolve` over one of many in one call"] > 15.0
    assert found["`least_squares` over the calibration of 61 poses"] > 20.0
    assert found["`least_squares` over the calibration of 200 poses of an arm"] > 2.0


def test_recorded_times_of_arms_are_within_the_goals_but_for_the_one_that_the_page_names() -> None:
    import speed

    rows = json.loads(speed.RECORD.read_text(encoding="utf-8"))["arm_commands"]
    for row in (*rows["plain"], *rows["hard"]):
        assert row["poses"] in speed.ARM_POSES
        assert row["calibrate_s"] < 20.0
        assert max(row["calibrate_gb"], row["diagnose_gb"]) < 4.0
    assert max(row["diagnose_s"] for row in rows["plain"]) < 120.0
    page = (ROOT / "docs" / "speed.md").read_text(encoding="utf-8")
    over = max(row["diagnose_s"] for row in rows["hard"]) > 120.0
    assert ("diagnosis with five causes is above its goal" in page) == over
