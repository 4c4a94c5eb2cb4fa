"""Tables of docs/benchmark.md, from ``benchmark.json`` in docs/figures, which examples/benchmark/record.py writes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from figures import RECORDS

RIVALS = {
    "diagnosis": "`gtpin diagnose`",
    "best_single": "largest evidence, above a threshold",
    "largest_score": "largest evidence, always",
    "lasso": "group LASSO",
    "sindy": "thresholded least squares (SINDy)",
    "ridge": "ridge on all bases",
    "classifier": "trained classifier",
    "gaussian_process": "Gaussian process",
    "geometry_only": "geometry only",
}
"""Those that answer all cases, in the order of the tables."""
GEOMETRIES = {
    "geometry_only": "geometry only (gtpin, priors)",
    "mujoco_sysid": "mujoco.sysid",
    "figaroh": "FIGAROH",
    "gaussian_process": "Gaussian process",
    "ridge": "ridge on all bases",
    "diagnosis": "`gtpin diagnose`",
}
"""Those that are compared on serial arms alone."""
NAMING = {
    "one effect, E > 63: detected": "detected, E > 63",
    "one effect, E > 63: class holds the truth": "class holds the truth, E > 63",
    "one effect, E > 63: members of the classes": "members",
    "one effect, D > 63: strict": "strict, D > 63",
    "several effects: F1 of those with E > 63": "F1 of several",
}
PAIRED = "paired"
SAFETY = {
    "no effect: silent": "no effect: silent",
    "unlisted effect: unknown": "unlisted: unknown",
    "unlisted effect: a false cause with confidence": "unlisted: false with confidence",
    "all cases: a false cause with confidence": "false with confidence",
    "all cases: a false cause named": "a false cause named",
    "error of prediction, units of the noise": "error of prediction",
    PAIRED: "the same over that of the diagnosis, case by case",
}


def _read() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((RECORDS / "benchmark.json").read_text(encoding="utf-8"))
    return found


def cell(figure: Mapping[str, Any]) -> str:
    """A value with its 95 % bounds; a dash where there is none."""
    value, low, high = figure["value"], figure["low"], figure["high"]
    if value is None:
        return "–"
    return f"{value:.2f}" if low is None else f"{value:.2f} ({low:.2f}..{high:.2f})"


def _table(columns: Mapping[str, str]) -> str:
    read = _read()
    found: dict[str, Any] = {r: {**row, PAIRED: read["paired"][r]} for r, row in read["rivals"].items()}
    first = next(iter(found.values()))
    lines = ["| | " + " | ".join(columns.values()) + " |", "|---" * (len(columns) + 1) + "|"]
    lines += [
        f"| {words} | " + " | ".join(cell(found[rival][name]) for name in columns) + " |"
        for rival, words in RIVALS.items()
        if rival in found
    ]
    return "\n".join([*lines, "| cases | " + " | ".join(_cases(first[name]) for name in columns) + " |"])


def _cases(figure: Mapping[str, Any]) -> str:
    return str(figure["of"])


def naming() -> str:
    """The table of what is named."""
    return _table(NAMING)


def safety() -> str:
    """The table of silence, `unknown`, false causes, and predictions."""
    return _table(SAFETY)


def arms() -> str:
    """The table of predictions on serial arms."""
    found = _read()["arms"]
    lines = ["| | error of prediction, units of the noise | cases answered |", "|---|---|---|"]
    for rival, words in GEOMETRIES.items():
        if rival in found:
            figure = found[rival]["error of prediction, units of the noise"]
            lines.append(f"| {words} | {cell(figure)} | {figure['of']} |")
    return "\n".join(lines)


TABLES: dict[str, Callable[[], str]] = {
    "benchmark_naming": naming,
    "benchmark_safety": safety,
    "benchmark_arms": arms,
}
