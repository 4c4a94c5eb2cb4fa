"""A plan of poses in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table

from gtpin.diagnosis.inference.findings import Smallest
from gtpin.health.plan import PosePlan, checked_first
from gtpin.report.words import length, percent, quantity

SHOWN = 12
"""Largest number of effects in the table of a plan for discrimination."""


def plan_words(plan: PosePlan) -> list[str]:
    """The purpose of the poses, and what they can show."""
    count = len(plan.commands)
    if plan.purpose == "calibration" and plan.information is not None:
        own = plan.information
        return [
            f"{count} poses for a calibration: {own.nats:.0f} nats on the geometry; as many at random: {own.nats_random:.0f}.",
            f"Error of predicted positions after the calibration: {length(own.error)}; at random: {length(own.error_random)}.",
        ]
    if plan.purpose == "discrimination":
        return [f"{count} poses that tell {len(plan.told)} effects at their sites apart, as far as poses can."]
    place = "where the instrument may stand anywhere" if plan.frame == "free" else "measured in the base frame"
    return [
        f"{count} poses for a check, {place}: changes found in {percent(plan.power)} of checks, with false alarms in "
        f"{percent(plan.false_alarm)}, are from the sizes in the table on."
    ]


def plan_summary(plan: PosePlan) -> RenderableType:
    """The sentences, and the table of changes or effects that the poses can show."""
    if plan.purpose == "calibration":
        return Group(*plan_words(plan))
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    head = ("change", "smallest") if plan.purpose == "health" else ("effect", "1 sigma", "of random poses")
    for name in head:
        table.add_column(name, no_wrap=True)
    if plan.purpose == "health":
        for one in usual(plan.smallest):
            table.add_row(f"{one.effect} at {one.site}", smallest_words(one))
    for told in sorted(plan.told, key=lambda one: one.sigma / max(one.sigma_random, 1e-300))[:SHOWN]:
        name = f"{told.effect} at {told.site}, {told.parameter.replace('_', ' ')}"
        table.add_row(name, quantity(told.sigma, told.unit), quantity(told.sigma_random, told.unit))
    return Group(*plan_words(plan), table)


def usual(smallest: Sequence[Smallest]) -> list[Smallest]:
    """Those of the smallest changes for which a plan chooses its poses."""
    return [one for one in smallest if one.effect in checked_first()]


def smallest_words(one: Smallest) -> str:
    """A smallest change with its parameter."""
    if one.value is None:
        return "none is found"
    return f"{one.parameter.replace('_', ' ')} {quantity(one.value, one.unit)}"
