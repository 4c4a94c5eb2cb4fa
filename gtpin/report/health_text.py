"""A short summary of a check for a terminal."""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table

from gtpin.diagnosis.result import HealthCheck
from gtpin.report.health_words import advice, headline, power_words
from gtpin.report.words import chance, quantity


def health_summary(check: HealthCheck) -> RenderableType:
    """The changes, with class and probability, and the smallest changes that such poses show."""
    parts: list[RenderableType] = [headline(check)]
    if check.causes:
        parts.append(_changes(check))
    untested = sum(not c.testable for c in check.candidates)
    return Group(
        *parts,
        *advice(check),
        power_words(check),
        f"{untested} of {len(check.candidates)} candidates can't be told by these poses; the report gives the reasons.",
    )


def _changes(check: HealthCheck) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("change", no_wrap=True)
    table.add_column("probability", justify="right", no_wrap=True)
    table.add_column("by how much")
    for cause in check.causes:
        values = [f"{n.replace('_', ' ')} {quantity(e.value, e.unit, e.sigma)}" for n, e in cause.parameters.items()]
        table.add_row(f"{cause.effect} at {cause.site}", chance(cause.probability), "\n".join(values[:6]))
        for m in cause.members:
            if (m.effect, m.site) != (cause.effect, cause.site):
                table.add_row(f"  or {m.effect} at {m.site}", chance(m.probability))
    return table
