"""What of several effects is named, by the diagnosis and by a rival that knows their forms: a table of docs/blind.md.

The cases are the first ones with two and with three effects of ``gtpin blind --cases 2000 --seed SEED``. Those with an
effect whose energy is 63 or less are left out. The record is of a sealed check: ``python examples/blind/pairs.py DIR ...``
writes it from folders of checks. ``python examples/pages/refresh.py --measure pairs`` makes and diagnoses the cases again,
without seals.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pandas as pd
from joblib import Parallel, delayed
from limit import Limit

import gtpin
from gtpin.bench.blind.draw import Draft, drafts, made, truth_of
from gtpin.bench.blind.folder import CheckFolder
from gtpin.bench.blind.judged import VISIBLE, Judged, Statement
from gtpin.bench.blind.score import Rate, mean, rate
from gtpin.bench.blind.truth import Truth, opened, read_manifest
from gtpin.data import Dataset
from gtpin.threads import in_one_thread

CASES, SEED = 2000, 1795444570
THREES = 30
RECORD = Path(__file__).parents[2] / "docs" / "figures" / "pairs.csv"
KINDS = ("two", "three")
METHODS = {
    "diagnosis": "diagnosis",
    "textbook": "all pairs, textbook forms, prior odds of the diagnosis",
    "known": "all pairs, true forms known, prior odds of the diagnosis",
    "known_flat": "all pairs, true forms known, flat prior odds",
}


def jobs(machines: int) -> list[dict[str, object]]:
    """The first cases with two effects, and with three."""
    every = list(_drafts())
    kinds = (("two", machines), ("three", min(machines, THREES)))
    return [{"case": d.name} for kind, count in kinds for d in [d for d in every if d.kind == kind][:count]]


def _drafts() -> Iterator[Draft]:
    return drafts(CASES, SEED, without=("measurement_delay",))  # newer than the record


def measured(case: str) -> list[dict[str, object]]:
    """What is said of one case."""
    draft = next(draft for draft in _drafts() if draft.name == case)
    made_case = made(draft)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)  # of poses that large effects make look like gross errors
        try:
            said = Statement.of(gtpin.diagnose(made_case.dataset).to_json())
        except gtpin.GtpinError:  # a diagnosis that fails names nothing
            said = Statement(verdict="none")
    return scored(made_case.dataset, truth_of(made_case, draft.kind), said)


@in_one_thread
def scored(dataset: Dataset, truth: Truth, said: Statement) -> list[dict[str, object]]:
    """A row for the diagnosis and each rival; none for a case with an effect that need not be found."""
    if any((effect.energy or 0.0) <= VISIBLE for effect in truth.effects):
        return []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        known = Limit.of(dataset, truth)
        statements = {
            "diagnosis": said,
            "textbook": known.without_forms().statement("diagnosis"),
            "known": known.statement("diagnosis"),
            "known_flat": known.statement("flat"),
        }
    rows: list[dict[str, object]] = []
    for method, statement in statements.items():
        one = Judged(name="", kind=truth.kind, truth=truth.effects, said=statement)
        rows.append(
            {
                "kind": truth.kind,
                "method": method,
                "true": " ".join(sorted(one.names)),
                "verdict": statement.verdict,
                "named": " ".join(sorted(statement.names)),
                "false": len(one.false_names),
                "f1": one.f1,
                "class_f1": one.class_f1,
            }
        )
    return rows


def table(records: pd.DataFrame) -> str:
    """The rows of the page."""
    two, three = (records["kind"] == kind for kind in KINDS)
    columns: dict[str, tuple[pd.Series, Callable[[pd.DataFrame], Rate]]] = {
        "two, E > 63 of each: F1 of the set": (two, lambda some: mean(some["f1"])),
        "F1 of the classes": (two, lambda some: mean(some["class_f1"])),
        "both named, nothing else": (two, lambda some: rate(some["f1"] == 1.0)),
        "a false cause named": (two, lambda some: rate(some["false"] > 0)),
        "three, E > 63 of each: F1 of the set": (three, lambda some: mean(some["f1"])),
    }
    lines = ["| | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for method, words in METHODS.items():
        mine = records["method"] == method
        cells = [_cell(measure(records[mine & rows])) for rows, measure in columns.values()]
        lines.append(f"| {words} | {' | '.join(cells)} |")
    counts = [int((rows & (records["method"] == "diagnosis")).sum()) for rows, _ in columns.values()]
    lines.append("| cases | " + " | ".join(map(str, counts)) + " |")
    return "\n".join(lines)


def _cell(found: Rate) -> str:
    if found.value is None:
        return "–"
    return f"{found.value:.3f}" + ("" if found.low is None else f" ({found.low:.3f}..{found.high:.3f})")


def _of_check(folder: CheckFolder, name: str, digest: str) -> list[dict[str, object]]:
    """The rows of one case of a check, its seal opened."""
    outcome = folder.outcome(name)
    said = Statement.of(outcome.diagnosis) if outcome and outcome.diagnosis else Statement(verdict="none")
    truth = opened(folder.sealed(name), digest)
    if truth.kind not in KINDS:
        return []
    return [{"case": name, **row} for row in scored(Dataset.read(folder.case(name)), truth, said)]


def main(checks: Sequence[Path]) -> None:
    """Write the record from checks' folders."""
    folders = map(CheckFolder, checks)
    cases = [(folder, *case) for folder in folders for case in read_manifest(folder.manifest).items()]
    found = Parallel(n_jobs=-1)(delayed(_of_check)(*case) for case in cases)
    rows = sorted((row for some in found for row in some), key=lambda row: (KINDS.index(str(row["kind"])), row["case"]))
    pd.DataFrame(rows).to_csv(RECORD, index=False)


if __name__ == "__main__":
    main([Path(folder) for folder in sys.argv[1:]])
