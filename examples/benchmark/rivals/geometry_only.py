"""Calibration without effects: names no cause, and predicts by the geometry alone."""

from __future__ import annotations

from pathlib import Path

from problem import Problem, answered

from gtpin.bench.benchmark.answer import Answer


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    return answered(folder, Problem.of(folder).baseline, [])
