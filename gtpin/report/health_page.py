"""The page of a check against an earlier model, and the files that ``gtpin diagnose --against`` writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gtpin.diagnosis.result import HealthCheck
from gtpin.model.model_folder import write_model
from gtpin.output.json_text import json_text
from gtpin.report.drawing import drawing
from gtpin.report.experiments import FOLDER
from gtpin.report.files import DIAGNOSIS
from gtpin.report.gap_words import gap_words
from gtpin.report.health_words import advice, error_of, floor_words, headline, power_words, unseen
from gtpin.report.page import Table, render
from gtpin.report.provenance import provenance
from gtpin.report.reasons import reason_words
from gtpin.report.verdict import BADGES
from gtpin.report.words import chance, percent, quantity, whole
from gtpin.threads import in_one_thread

CHECK = DIAGNOSIS
"""Names of the files of a check's folder: those of a diagnosis, so that one replaces the other."""
CONTENTS = (
    ("changes", "The changes"),
    ("evidence", "Evidence"),
    ("power", "What such poses show"),
    ("unseen", "What they don't show"),
    ("provenance", "Provenance"),
)
CHANGED = {"none": ("no change", "good"), "explained": ("changed", "accent")}
"""Badges of verdicts for which a check uses other words than a diagnosis."""
SHOWN = 12
"""Largest number of candidates in the table of evidence."""


@in_one_thread
def write_check(check: HealthCheck, folder: Path) -> dict[str, object]:
    """Write ``baseline/``, ``model/``, ``diagnosis.json`` and ``report.html``; return the content of the JSON."""
    result = check.to_json()
    write_model(check.baseline, folder / "baseline")
    write_model(check.model, folder / "model")
    (folder / FOLDER).mkdir()  # a check proposes no experiments: an older diagnosis's are removed
    (folder / "diagnosis.json").write_text(json_text(result), encoding="utf-8")
    (folder / "report.html").write_text(health_page(check), encoding="utf-8")
    return result


def health_page(check: HealthCheck) -> str:
    """The whole report of a check as one self-contained HTML file."""
    robot, dataset = check.model.robot, check.dataset
    badge, tone = CHANGED.get(check.verdict, BADGES[check.verdict])
    return render(
        "health.html",
        title=f"{robot.name}: {badge}",
        contents=[item for item in CONTENTS if item[0] != "changes" or check.causes],
        provenance=provenance(dataset, robot, check.seed),
        robot=robot.name,
        poses=check.poses,
        badge=badge,
        tone=tone,
        headline=headline(check),
        advice=advice(check),
        sketch=drawing(check.baseline, np.median(dataset.q, axis=0), causes=[c.site for c in check.causes]),
        numbers=_numbers(check),
        changes=_changes(check),
        evidence=_evidence(check),
        threshold=whole(f"{check.threshold:.1f}"),
        false_alarm=percent(check.false_alarm),
        power=power_words(check),
        share=percent(check.power),
        smallest=_smallest(check),
        unseen=unseen(check),
        untested=_untested(check),
    )


def _numbers(check: HealthCheck) -> list[tuple[str, str]]:
    size = gap_words(check.gap)
    found = [(str(check.poses), "poses"), (size.before, f"{error_of(check).lower()} of the earlier model, RMS")]
    if check.causes:
        found.append((size.after, "with the changes"))
    return [*found, (size.floor, floor_words(check))]


def _changes(check: HealthCheck) -> Table:
    rows = []
    for cause in check.causes:
        for name, e in cause.parameters.items():
            low, high = e.interval
            value = quantity(e.value, e.unit, e.sigma)
            between = whole(f"{quantity(low, e.unit)} to {quantity(high, e.unit)}")
            rows.append([cause.effect, cause.site, chance(cause.probability), name.replace("_", " "), value, between])
        rows += [
            [f"or {m.effect}", m.site, chance(m.probability), "", "", ""]
            for m in cause.members
            if (m.effect, m.site) != (cause.effect, cause.site)
        ]
    return Table(("change", "site", "probability", "parameter", "by how much", "95 %"), rows)


def _evidence(check: HealthCheck) -> Table:
    tested = [c for c in check.candidates if c.testable][:SHOWN]
    return Table(
        ("change", "site", "gain in log evidence (nats)"), [[c.effect, c.site, f"{c.log_evidence:.1f}"] for c in tested]
    )


def _smallest(check: HealthCheck) -> Table:
    rows = [
        [s.effect, s.site, s.parameter.replace("_", " "), "none" if s.value is None else quantity(s.value, s.unit)]
        for s in check.smallest
    ]
    return Table(("change", "site", "parameter", "smallest"), rows)


def _untested(check: HealthCheck) -> Table:
    rows = [[c.effect, c.site, reason_words(c.reason, c.site)] for c in check.candidates if not c.testable]
    return Table(("change", "site", "why not"), rows)
