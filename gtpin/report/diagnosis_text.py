"""A short summary of a diagnosis for a terminal."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table

from gtpin.diagnosis.inference.findings import Cause, Member
from gtpin.diagnosis.result import Diagnosis
from gtpin.estimate import Estimate
from gtpin.report.gap_words import beyond_noise, gap_words
from gtpin.report.not_tested import could_be, may_hide, not_recorded
from gtpin.report.verdict import assumed, questions, verdict
from gtpin.report.words import chance, percent, quantity

SHOWN = 6
"""Number of parameters listed per cause; the report lists all."""


def diagnosis_summary(diagnosis: Diagnosis) -> RenderableType:
    """Verdict, causes with class and probability, and the gap before and after."""
    parts: list[RenderableType] = [verdict(diagnosis).headline]
    if diagnosis.causes:
        parts.append(_causes(diagnosis))
    hints = (*not_recorded(diagnosis), *could_be(diagnosis), *may_hide(diagnosis))
    return Group(*parts, *hints, *questions(diagnosis), *_gap(diagnosis), *assumed(diagnosis), *_untestable(diagnosis))


def _others(cause: Cause) -> list[Member]:
    return [m for m in cause.members if (m.effect, m.site) != (cause.effect, cause.site)]


def _causes(diagnosis: Diagnosis) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("cause", no_wrap=True)
    table.add_column("probability", justify="right", no_wrap=True)
    table.add_column("parameters")
    table.add_column("explains of the gap", justify="right", no_wrap=True)
    for cause in diagnosis.causes:
        values = [_value(name, estimate) for name, estimate in cause.parameters.items()]
        more = [f"and {len(values) - SHOWN} more"] if len(values) > SHOWN else []
        name = f"{cause.effect} at {cause.site}"
        table.add_row(name, chance(cause.probability), "\n".join(values[:SHOWN] + more), percent(cause.shrinkage))
        for member in _others(cause):
            table.add_row(f"  or {member.effect} at {member.site}", chance(member.probability))
    return table


def _value(name: str, estimate: Estimate) -> str:
    return f"{name.replace('_', ' ')} {quantity(estimate.value, estimate.unit, estimate.sigma)}"


def _gap(diagnosis: Diagnosis) -> list[str]:
    gap = diagnosis.gap
    size = gap_words(gap)
    before, after, noise = size.before, size.after, size.floor
    what = size.what[:1].upper() + size.what[1:]
    left_out = "sessions" if gap.hold_out == "session" else "poses"
    if not diagnosis.causes:
        return [f"{what} on left-out {left_out}, RMS: {before}, of which noise is {noise}."]
    lines = [
        f"{what} on left-out {left_out}, RMS: {before} by geometry alone -> {after} with the causes; "
        f"noise floor {noise}."
    ]
    if gap.shrinkage is not None and gap.interval is not None:
        low, high = (percent(value) for value in gap.interval)
        lines.append(
            f"Explained fraction of the gap's power beyond noise: {percent(gap.shrinkage)} (95 %: {low} to {high})."
        )
    small = beyond_noise(gap)
    return [*lines, small] if small else lines


def _untestable(diagnosis: Diagnosis) -> list[str]:
    count = sum(not candidate.testable for candidate in diagnosis.candidates)
    if not count:
        return []
    return [
        f"{count} of {len(diagnosis.candidates)} candidates can't be tested with these data; the report gives the reasons."
    ]
