"""The figures that pages print are those of the records, and the records are what the code as it is measures."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t

from gtpin.blind.judged import Judged
from gtpin.diagnosis import priors
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.inference.readmit_outliers import MOST_POSES
from gtpin.diagnosis.planning import discrimination as splitting
from gtpin.diagnosis.planning.measurement_conditions import SESSIONS
from gtpin.diagnosis.planning.settling import DRAWN, PROMISED
from gtpin.effects.drives import SLOWEST_LINE
from gtpin.effects.rack_periodic import LEAST_TURNS

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples" / "pages"))

import figures  # noqa: E402  (the scripts of examples are no package)
import refresh  # noqa: E402

AGAIN = {
    "false_alarms": 3,
    "missing_covariates": 3,
    "mistakes": 8,
    "next_experiment": 4,
    "closed_loop": 2,
    "noise_floor": 4,
    "imitators": 1,
    "priors": 1,
    "instruments": 6,
    "closed_circle": 1,
    "health": 2,
    "pairs": 2,
    "forms": 2,
}
"""Jobs that are measured again, spread over all; a whole measurement takes minutes."""
NEEDS = {"closed_circle": "mujoco"}
"""Packages that the script of a figure needs and gtpin does not."""
SAME = 0.75
"""Share of the rows measured again that must be as recorded: rounding may tip a weak case, a change of the code tips many."""


@pytest.mark.parametrize("page", refresh.pages(), ids=lambda page: page.name)
def test_a_page_shows_what_its_records_hold(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert refresh.refreshed(text) == text, "run python examples/pages/refresh.py"


def test_every_figure_is_on_a_page() -> None:
    shown = {found[2] for page in refresh.pages() for found in refresh.BLOCK.finditer(page.read_text(encoding="utf-8"))}
    assert shown == set(refresh.TABLES)


@pytest.mark.parametrize("figure", figures.FIGURES, ids=lambda figure: figure.name)
def test_some_of_a_figures_records_are_measured_again_alike(figure: figures.Figure) -> None:
    if figure.name in NEEDS:
        pytest.importorskip(NEEDS[figure.name])
    records = figure.records()
    jobs = figure.module().jobs(figure.machines)
    chosen = [jobs[i] for i in np.unique(np.linspace(0, len(jobs) - 1, AGAIN[figure.name]).astype(int))]
    same = []
    for job in chosen:
        rows = records[np.logical_and.reduce([records[key].astype(str) == str(value) for key, value in job.items()])]
        found = pd.DataFrame(figures.rows_of(figure, job))
        assert len(rows) == len(found), f"{figure.name}: {job}"
        same += [alike(a, b) for a, b in zip(rows.to_dict("records"), found.to_dict("records"), strict=True)]
    assert np.mean(same) >= SAME, f"measure them again: python examples/pages/refresh.py --measure {figure.name}"


def alike(recorded: dict[str, object], found: dict[str, object]) -> bool:
    """Whether two rows agree: words to the letter but for sentences, numbers to 2 %."""
    for name, value in found.items():
        if name == "words":  # sentences, for people who read the record
            continue
        if isinstance(value, float):
            if not np.isclose(float(str(recorded[name])), value, rtol=0.02, atol=0.01):
                return False
        elif str(recorded[name]) != str(value):
            return False
    return True


def test_the_first_sealed_cases_come_out_as_the_page_of_the_blind_check_says(tmp_path: Path) -> None:
    record = json.loads((figures.RECORDS / "blind.json").read_text(encoding="utf-8"))
    seed = str(record["check"]["seed"])
    command = [sys.executable, "-m", "gtpin", "blind", "-o", str(tmp_path / "check"), "--cases", "12", "--seed", seed]
    ran = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert ran.returncode == 0, ran.stderr
    cases = json.loads((tmp_path / "check" / "judged.json").read_text(encoding="utf-8"))
    judged = [Judged.model_validate(case) for case in cases]
    singles = [case for case in judged if case.kind == "one"]
    assert len(singles) > 2
    changed = [case.name for case in singles if case.strict != record["right"][case.name]]
    assert len(changed) <= 1, f"make docs/blind.md anew; these cases come out otherwise: {changed}"


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
    ("docs/diagnosis.md", "(glossary.md#probability-temperature) of {} to", priors.PRIORS.temperature),
    ("docs/diagnosis.md", "The share is {} % at the same site over the same coordinates", 100 * priors.PRIORS.same),
    ("docs/diagnosis.md", "{} % for related hypotheses", 100 * priors.PRIORS.related),
    ("docs/diagnosis.md", "or both depend on load), {} % for all others", 100 * priors.PRIORS.other),
    ("docs/diagnosis.md", "With more than {} poses, the search uses", f"{MOST_POSES:,}"),
    ("docs/next_experiment.md", "gain: below {} nats, only", splitting.HOPELESS),
    ("docs/next_experiment.md", "below {} %, how many rounds", 100 * PROMISED),
    ("docs/next_experiment.md", "with {} simulated", DRAWN),
    ("docs/next_experiment.md", "in {} further sessions", SESSIONS),
    ("docs/next_experiment.md", "below {} nat, the round and what", splitting.LEAST),
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
