"""What sparse regressions share: data without geometry, resampling of poses, and the answer by what was selected."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from problem import Problem, answered, cause, without_geometry

from gtpin.bench.benchmark.answer import Answer
from gtpin.diagnosis.hypothesis import Hypothesis

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int_]
REFITS = 20
MOST = 12
"""Most causes that are named: a regression that selects more has explained noise."""
Selection = Callable[[Floats, Sequence[Floats]], tuple[list[int], float]]
"""From residuals (m,) and columns of each group: the groups selected, and the penalty with which they were."""
Again = Callable[[Floats, Sequence[Floats], float], list[int]]
"""The same with a given penalty."""


def regressed(
    folder: Path, select: Selection, again: Again, poses: Callable[[np.random.Generator, int], Ints]
) -> Answer:
    """The answer by a sparse regression; a probability is the share of regressions on resampled poses that select the effect.

    ``poses`` draws indices of poses: half of them, or as many with repetition.
    """
    problem = Problem.of(folder)
    design, terms = problem.hypotheses.design, list(problem.cores)
    chosen, penalty = select(*_clean(design.B, design.y, list(problem.cores.values())))
    rng, numbers = np.random.default_rng(0), np.arange(len(design.y)).reshape(-1, problem.rows_of_a_pose)
    count = np.zeros(len(terms))
    for _ in range(REFITS if chosen else 0):
        rows = numbers[poses(rng, len(numbers))].ravel()
        part = _clean(design.B[rows], design.y[rows], [X[rows] for X in problem.cores.values()])
        count[again(*part, penalty)] += 1.0
    chosen = sorted(chosen, key=lambda i: (-count[i], -problem.gains[terms[i]]))[:MOST]
    named: list[Hypothesis] = [terms[i] for i in chosen]
    causes = [cause(terms[i], float(count[i] / REFITS)) for i in chosen]
    return answered(folder, problem.fitted(named), causes)


def _clean(B: Floats, y: Floats, columns: list[Floats]) -> tuple[Floats, list[Floats]]:
    left = without_geometry(B, y, *columns)
    return left[0], left[1:]
