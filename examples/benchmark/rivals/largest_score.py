"""Names the effect and site with the largest evidence alone, always and with probability 1."""

from __future__ import annotations

from pathlib import Path

from problem import Problem, answered, cause

from gtpin.bench.benchmark.answer import Answer


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    problem = Problem.of(folder)
    best = max(problem.gains, key=problem.gains.__getitem__)
    return answered(folder, problem.fitted([best]), [cause(best, 1.0)])
