"""The records of the pages' figures are what the code as it is measures."""

import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import gtpin
from gtpin.bench.blind.draw import Draft, drafts, made, truth_of
from gtpin.bench.blind.judged import Judged, Statement

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples" / "pages"))

import figures  # noqa: E402  (the scripts of examples are no package)

pytestmark = pytest.mark.slow

AGAIN = {
    "false_alarms": 3,
    "missing_covariates": 3,
    "mistakes": 8,
    "next_experiment": 4,
    "closed_loop": 2,
    "noise_floor": 4,
    "imitators": 1,
    "priors": 8,
    "instruments": 6,
    "closed_circle": 1,
    "health": 2,
    "unlisted": 2,
    "certificate": 3,
    "pairs": 2,
    "forms": 2,
}
"""Jobs that are measured again, spread over all; a whole measurement takes minutes."""
NEEDS = {"closed_circle": "mujoco"}
"""Packages that the script of a figure needs and gtpin does not."""
SAME = 0.75
"""Share of the rows measured again that must be as recorded: rounding may tip a weak case, a change of the code tips many."""


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


RECORD = Path(__file__).parents[2] / "docs" / "figures" / "blind.json"
CASES = 12
"""Of these first cases, those with one effect are made and diagnosed again."""


def judged(draft: Draft, folder: Path) -> Judged:
    """What is said of a case: the page counts it as right by that and the truth alone."""
    case = made(draft)
    case.dataset.write(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of poses that a large effect makes look like gross errors
        said = Statement.of(gtpin.diagnose(gtpin.Dataset.read(folder)).to_json())
    return Judged(name=draft.name, kind=draft.kind, truth=truth_of(case, draft.kind).effects, said=said)


def test_the_first_sealed_cases_come_out_as_the_page_of_the_blind_check_says(tmp_path: Path) -> None:
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    drawn = drafts(CASES, int(record["check"]["seed"]), without=("measurement_delay",))  # newer than the record
    singles = [draft for draft in drawn if draft.kind == "one"]
    assert len(singles) > 2
    found = [judged(draft, tmp_path / draft.name) for draft in singles]
    changed = [case.name for case in found if case.strict != record["right"][case.name]]
    assert len(changed) <= 1, f"make docs/blind.md anew; these cases come out otherwise: {changed}"
