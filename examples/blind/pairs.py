"""What of several effects is named, by the diagnosis and by a rival that knows their forms: a table of docs/blind.md.

The cases are those with two and with three effects of ``gtpin blind --cases 2000 --seed SEED``, and the first of those without
one, as far as they were made. The record is of their sealed
check: ``python examples/blind/pairs.py DIR ...`` writes it from the folders of checks. ``python examples/pages/refresh.py
--measure pairs`` makes and diagnoses the cases again, without seals.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pandas as pd
from joblib import Parallel, delayed

import gtpin
from gtpin.blind.draw import Draft, drafts, made, truth_of
from gtpin.blind.judged import VISIBLE, Judged
from gtpin.blind.limit import Limit
from gtpin.blind.rates import Rate, mean, rate
from gtpin.blind.statement import Statement
from gtpin.blind.truth import Truth
from gtpin.data import Dataset
from gtpin.threads import in_one_thread

CASES, SEED = 2000, 1795444570
RECORD = Path(__file__).parents[2] / "docs" / "figures" / "pairs.csv"
METHODS = {
    "diagnosis": "diagnosis",
    "textbook": "all pairs, textbook forms, prior odds of the diagnosis",
    "known": "all pairs, true forms known, prior odds of the diagnosis",
    "flat": "all pairs, true forms known, flat prior odds",
}


def jobs(machines: int) -> list[dict[str, object]]:
    """The first cases with two effects, and three of ten as many with three effects, and without one."""
    every = list(_drafts())
    kinds = (("two", machines), ("three", 3 * machines // 10), ("none", 3 * machines // 10))
    return [{"case": d.name} for kind, count in kinds for d in [d for d in every if d.kind == kind][:count]]


def _drafts() -> Iterator[Draft]:
    return drafts(CASES, SEED)


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
    """A row for the diagnosis and each rival."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        rival = Limit.of(dataset, truth)
        statements = {
            "diagnosis": said,
            "textbook": rival.without_forms().statement("diagnosis"),
            "known": rival.statement("diagnosis"),
            "flat": rival.statement("flat"),
        }
    visible = bool(truth.effects) and all((effect.energy or 0.0) > VISIBLE for effect in truth.effects)
    rows: list[dict[str, object]] = []
    for method, statement in statements.items():
        one = Judged(name="", kind=truth.kind, truth=truth.effects, said=statement)
        rows.append(
            {
                "kind": truth.kind,
                "visible": visible,
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
    visible = records["visible"].astype(str) == "True"
    two, three = (records["kind"] == kind for kind in ("two", "three"))
    columns: dict[str, tuple[pd.Series, Callable[[pd.DataFrame], Rate]]] = {
        "two, E > 63 of each: F1 of the set": (two & visible, lambda some: mean(some["f1"])),
        "F1 of the classes": (two & visible, lambda some: mean(some["class_f1"])),
        "both named, and nothing else": (two & visible, lambda some: rate(some["f1"] == 1.0)),
        "three: F1 of the set": (three, lambda some: mean(some["f1"])),
        "three, E > 63 of each": (three & visible, lambda some: mean(some["f1"])),
        "a false cause named": (two | three, lambda some: rate(some["false"] > 0)),
        "no effect: nothing named": (records["kind"] == "none", lambda some: rate(some["named"] == "")),
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
    return f"{found.value:.3f}" + ("" if found.low is None else f" ({found.low:.3f} .. {found.high:.3f})")


def _of_check(folder: Path, name: str, said: Statement | None) -> list[dict[str, object]]:
    truth = Truth.model_validate_json((folder / "sealed" / f"{name}.json").read_bytes())
    rows = scored(Dataset.read(folder / "cases" / name), truth, said or Statement(verdict="none"))
    return [{"case": name, **row} for row in rows]


def main(folders: list[Path]) -> None:
    """Write the record from checks' folders."""
    found = [
        (folder, Judged.model_validate(case))
        for folder in folders
        for case in json.loads((folder / "judged.json").read_bytes())
    ]
    several = sorted(
        ((folder, case) for folder, case in found if case.kind in ("two", "three", "none")),
        key=lambda one: (("two", "three", "none").index(str(one[1].kind)), one[1].name),
    )
    rows = Parallel(n_jobs=-1)(delayed(_of_check)(folder, case.name, case.said) for folder, case in several)
    pd.DataFrame([row for some in rows for row in some]).to_csv(RECORD, index=False)


if __name__ == "__main__":
    main([Path(folder) for folder in sys.argv[1:]])
