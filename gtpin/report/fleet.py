"""A table of several diagnoses, and its page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from gtpin.report.page import Lead, Section, Table, report
from gtpin.report.phrases import known_as
from gtpin.report.words import chance, counted, length

HEAD = ("dataset", "verdict", "causes", "error, RMS", "with the causes", "noise alone", "rows")


def fleet_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """A row for each dataset of ``fleet.json``: its diagnosis, or its error."""
    return Table(HEAD, [_cells(row) for row in rows], (3, 4, 5, 6), wide=(2,))


def fleet_page(rows: Sequence[Mapping[str, Any]]) -> str:
    """The table as one self-contained HTML file."""
    verdicts = Counter("failed" if row["error"] else row["verdict"] for row in rows)
    found = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.most_common())
    lead = Lead(f"Diagnoses of {counted(len(rows), 'dataset')}", f"{found}.")
    return report("diagnoses", lead, [Section("datasets", "Datasets", [fleet_table(rows)])])


def _cells(row: Mapping[str, Any]) -> list[str]:
    if row["error"]:
        return [row["folder"], "failed", row["error"], *[""] * 4]
    causes = "; ".join(f"{known_as(c['effect'], c['site'])} ({chance(c['probability'])})" for c in row["causes"])
    sizes = (row[key] for key in ("position_rms_before", "position_rms_after", "noise_floor"))
    return [
        row["folder"],
        row["verdict"],
        causes,
        *("" if s is None else length(s) for s in sizes),
        f"{row['rows']['used']:,}",
    ]
