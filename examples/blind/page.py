"""Keeps the scores of a finished blind check for docs/blind.md, and adds a full run to the log of all of them.

python examples/blind/page.py docs DIR               # of the check in DIR

Writes ``blind.json`` in docs/figures, from which pages take their sealed scores, and tables as CSV beside it. Then
``python examples/pages/refresh.py`` writes the pages.
"""

from __future__ import annotations

import csv
import datetime
import io
import json
import sys
from pathlib import Path
from typing import Any

from gtpin.bench.blind.judged import Judged
from gtpin.bench.blind.page import effect_table, failure_table, headline, reliability_table
from gtpin.report.page import Table

FULL = 1000
"""Cases from which a run is a full one."""
LOG = "figures/blind_runs.csv"
RECORD = "figures/blind.json"
FAILURES = "figures/blind_failures.csv"
EFFECTS = "figures/blind_effects.csv"
PROBABILITIES = "figures/blind_probabilities.csv"
POWER = "figures/blind_power.csv"
KEPT = ("cases", "check", "failures", "figures")
"""Of ``score.json``, what other pages need; with it goes which single effects were named right, and nothing else."""
LOG_HEAD = """\
date,command,plant,diagnosis,manifest,reached,"strict, D > 63","class, E > 63",false alarms,failed
"""


def files(folder: Path) -> dict[str, str]:
    """The tables of a check that are files beside the page: every failure, and scores by effect, probability, energy."""
    result, cases = _read(folder)
    tables = {
        FAILURES: failure_table(cases),
        EFFECTS: effect_table(result),
        PROBABILITIES: reliability_table(result),
        POWER: _power(result["power"]),
    }
    return {name: _csv(table) for name, table in tables.items()}


def _csv(table: Table) -> str:
    written = io.StringIO()
    csv.writer(written, lineterminator="\n").writerows(row for row in (table.head, *table.rows) if row)
    return written.getvalue()


def logged(log: Path, folder: Path, day: datetime.date) -> None:
    """Add a full run to the log, unless it is there."""
    result, _ = _read(folder)
    about = result["check"]
    text = log.read_text(encoding="utf-8") if log.exists() else LOG_HEAD
    manifest, diagnosis = about["manifest"][:12], about["diagnosis"][:12]
    if result["cases"] < FULL or (manifest in text and diagnosis in text):
        return
    found = {row["figure"]: row["value"] for row in result["figures"]}
    numbers = [
        found["cause and site right, nothing else named, D > 63"],
        found["class holds the truth, E > 63"],
        result["false_alarm"],
        result["failed"],
    ]
    cells = [f"{day:%Y-%m-%d}", f"`{_command(about)}`", str(about["plant"])[:12], diagnosis, manifest, headline(result)]
    cells += ["–" if value is None else f"{value:.3f}" for value in numbers]
    log.write_text(text + _csv(Table((), [cells])), encoding="utf-8")


def _read(folder: Path) -> tuple[dict[str, Any], list[Judged]]:
    result = json.loads((folder / "score.json").read_text(encoding="utf-8"))
    cases = json.loads((folder / "judged.json").read_text(encoding="utf-8"))
    return result, [Judged.model_validate(case) for case in cases]


def _command(about: dict[str, Any]) -> str:
    if about["seed"] is None:
        return "gtpin blind -o DIR --from FOLDER"
    return f"gtpin blind -o DIR --cases {about['cases']} --seed {about['seed']}"


def _power(told: list[dict[str, Any]]) -> Table:
    rows = []
    for row in told:
        found, span = row["found"], f"{row['start']:g} to {row['end']:g}"
        share = f"{found['value']:.2f} ({found['low']:.2f} .. {found['high']:.2f})"
        rows.append((str(row["poses"]), span, str(found["of"]), share, f"{row['limit']:.2f}"))
    return Table(("poses", "E", "cases", "detected (95 %)", "matched filter"), rows)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("give the folder of the pages and that of a check: python page.py docs DIR")
    docs, run = Path(sys.argv[1]), Path(sys.argv[2])
    result, cases = _read(run)
    kept = {key: result[key] for key in KEPT} | {"right": {c.name: c.strict for c in cases if c.kind == "one"}}
    (docs / RECORD).write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    for name, text in files(run).items():
        (docs / name).write_text(text, encoding="utf-8")
    logged(docs / LOG, run, datetime.datetime.now(datetime.UTC).date())
