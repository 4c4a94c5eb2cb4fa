"""Untestable effects that matter for the verdict."""

from __future__ import annotations

from collections.abc import Iterable

from gtpin.diagnosis.inference.findings import Considered
from gtpin.diagnosis.planning.measurement_conditions import kind
from gtpin.diagnosis.result import Diagnosis
from gtpin.report.phrases import reason_words, sure_and_doubtful
from gtpin.report.quality import scatters
from gtpin.report.words import joined, site_words

LISTED = 3
"""Number of listed effects that could be the unknown cause."""


def may_hide(d: Diagnosis) -> list[str]:
    """A hint on effects that vary between visits and could not be tested because a covariate is missing; empty unless the
    verdict is ``none`` and visits scatter."""
    if d.verdict != "none" or not scatters(d.baseline):
        return []
    lacking = [c for c in d.candidates if d.effect(c.effect).between_visits and _is_missing(c)]
    effects = list(dict.fromkeys(c.effect for c in lacking))
    columns = list(
        dict.fromkeys(name for c in lacking for name in d.effect(c.effect).covariates(d.model.robot, c.site))
    )
    if not effects:
        return []
    return [
        f"{joined(effects)} could not be tested: record {joined(columns)}, or fill in what is known, and diagnose again."
    ]


def not_recorded(d: Diagnosis) -> list[str]:
    """Hints on members of classes that can't be ruled out because a covariate is missing, and on how to test them."""
    lacking = dict.fromkeys(
        (m.effect, m.site) for c in sure_and_doubtful(d.causes)[1] for m in c.members if not m.recorded
    )
    return [
        f"{joined(_names(rows), 'or')} can't be ruled out, because {reason}: record it, or fill in what is known of it"
        f"{_at_rest(rows)}, and diagnose again."
        for reason, rows in _by_reason(d, lacking).items()
    ]


def could_be(d: Diagnosis) -> list[str]:
    """Effects that would explain the unknown cause but are untestable because a covariate is missing."""
    return [
        f"It could be {joined(_names(rows), 'or')}, which these data can't test: {reason}."
        for reason, rows in _by_reason(d, d.unexplained.could_be[:LISTED]).items()
    ]


def _by_reason(d: Diagnosis, effects: Iterable[tuple[str, str]]) -> dict[str, list[Considered]]:
    """Effects at their sites, by the reason why they are untestable."""
    rows = {(c.effect, c.site): c for c in d.candidates if c.reason}
    found: dict[str, list[Considered]] = {}
    for effect in effects:
        if effect in rows:
            found.setdefault(reason_words(rows[effect].reason, rows[effect].site), []).append(rows[effect])
    return found


def _names(rows: Iterable[Considered]) -> list[str]:
    return [f"{c.effect} at {site_words(c.site)}" for c in rows]


def _at_rest(rows: Iterable[Considered]) -> str:
    speeds = any(c.reason is not None and kind(c.reason.covariate) == "speed" for c in rows)
    return " (0 if the machine stood still)" if speeds else ""


def _is_missing(c: Considered) -> bool:
    return c.reason is not None and c.reason.kind in ("missing", "unusable")
