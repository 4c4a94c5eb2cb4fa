"""What to measure next, as the page shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gtpin.diagnosis.result import Diagnosis
from gtpin.report.page import Table
from gtpin.report.words import covariate_unit, with_unit


@dataclass(frozen=True)
class Step:
    """A proposed measurement: what to do, what it is worth, and the commands."""

    measure: str
    worth: str
    commands: Table


def experiments(d: Diagnosis) -> list[Step]:
    """Everything that is worth measuring next, the most telling first."""
    return [_step(told, d.model.robot.n_actuators) for told in d.to_json()["next_experiment"]]


def _step(told: Mapping[str, Any], n_actuators: int) -> Step:
    covariates: Mapping[str, Any] = told.get("covariates") or {}
    head = [f"q{j + 1}" for j in range(n_actuators)]
    head += [with_unit(name, covariate_unit(name)) for name in covariates]
    rows = [
        [*(f"{value:.4f}" for value in q), *(_cell(values[i]) for values in covariates.values())]
        for i, q in enumerate(told["poses"])
    ]
    return Step(told["measure"], _worth(told.get("expected_gain"), told.get("random_gain")), Table(head, rows))


def _worth(expected: float | None, random: float | None) -> str:
    if expected is None:
        return ""
    beside = f", where as many random poses bring {random:.1f}" if random is not None else ""
    return f"Expected gain in log evidence: {expected:.1f}{beside}."


def _cell(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"
