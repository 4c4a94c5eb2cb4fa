"""The figures that pages print are those of the records, and the numbers that they say of the code are the code's own."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from gtpin.diagnosis import priors
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.inference.settle import MOST_POSES
from gtpin.diagnosis.planning import discrimination as splitting
from gtpin.diagnosis.planning.expected_bayes_factor import DRAWN, PROMISED
from gtpin.diagnosis.planning.measurement_conditions import SESSIONS
from gtpin.effects.rack import LEAST_TURNS
from gtpin.effects.smooth import SLOWEST_LINE
from gtpin.report import residual_plots

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples" / "pages"))

import refresh  # noqa: E402  (the scripts of examples are no package)


@pytest.mark.parametrize("page", refresh.pages(), ids=lambda page: page.name)
def test_a_page_shows_what_its_records_hold(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert refresh.refreshed(text) == text, "run python examples/pages/refresh.py"


def test_every_figure_is_on_a_page() -> None:
    shown = {found[2] for page in refresh.pages() for found in refresh.BLOCK.finditer(page.read_text(encoding="utf-8"))}
    assert shown == set(refresh.TABLES)


CONSTANTS = (
    (
        "docs/diagnosis.md",
        "by more than {} % of the gain in log evidence of the smooth terms",
        100 * priors.PRIORS.departure,
    ),
    ("docs/diagnosis.md", "({} % where they act at the site of a named cause", 100 * priors.PRIORS.modulation),
    ("docs/diagnosis.md", "at least {} % of the leader's probability belongs to the class", 100 * priors.CLASS_SHARE),
    ("docs/diagnosis.md", "each with a probability of {} % or more", 100 * priors.SURE),
    ("docs/report.md", "each has a probability of {} % or more", 100 * priors.SURE),
    ("docs/diagnosis.md", "(glossary.md#probability-temperature) of {} or more", priors.PRIORS.temperature),
    ("docs/diagnosis.md", "The share is {} % at the same site over the same coordinates", 100 * priors.PRIORS.same),
    ("docs/diagnosis.md", "{} % for related hypotheses", 100 * priors.PRIORS.related),
    ("docs/diagnosis.md", "or both depend on load), {} % for all others", 100 * priors.PRIORS.other),
    ("docs/diagnosis.md", "With more than {} poses, the search uses", f"{MOST_POSES:,}"),
    ("docs/diagnosis.md", "no form of their own: there, odds of {} to 1", f"{np.exp(priors.PRIORS.same_clock):.0f}"),
    ("docs/speed.md", "Plots show at most {} poses", f"{residual_plots.MOST:,}"),
    ("docs/diagnosis.md", "gain: below {} nats, only", splitting.HOPELESS),
    ("docs/diagnosis.md", "below {} %, how many rounds", 100 * PROMISED),
    ("docs/diagnosis.md", "with {} simulated", DRAWN),
    ("docs/diagnosis.md", "in {} further sessions", SESSIONS),
    ("docs/diagnosis.md", "below {} nat, the round and what", splitting.LEAST),
    ("docs/diagnosis.md", "`--false-alarm` (default {})", FALSE_ALARM),
    ("docs/diagnosis.md", "a smooth function has parts with up to {} periods a turn", SLOWEST_LINE),
    ("docs/diagnosis.md", "at least {} periods in the joint's range of commands where the joint has no", LEAST_TURNS),
    ("docs/diagnosis.md", "must gain more than {} nats (`line`", priors.PRIORS.line),
    ("docs/diagnosis.md", "{} standard deviations wide to either side", f"{t.ppf(0.975, 1) * 1.5**0.5:.0f}"),
)
"""Numbers that a page says of the code, and the code's own."""


@pytest.mark.parametrize(("page", "phrase", "value"), CONSTANTS)
def test_a_constant_on_a_page_is_the_codes(page: str, phrase: str, value: float | str) -> None:
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    assert phrase.format(value if isinstance(value, str) else f"{value:g}") in text


def test_every_time_on_the_page_of_speed_is_of_a_benchmark_that_exists() -> None:
    import speed

    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "benchmarks").glob("test_*.py"))
    pairs = (*speed.RATIOS.values(), *speed.ARM_RATIOS.values())
    named = {*speed.ROWS, *speed.ARM_ROWS, *(name for pair in pairs for name in pair)}
    assert named == {name for name in named if f"def {name}(" in code}
    times = json.loads(speed.RECORD.read_text(encoding="utf-8"))["benchmarks"]
    assert named <= set(times)
    found = speed.ratios(times)
    assert found["a closed posture by `fsolve` over one by Pinocchio"] > 1.0
    assert found["a closed posture by `fsolve` over one in arrays"] > 20.0
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
