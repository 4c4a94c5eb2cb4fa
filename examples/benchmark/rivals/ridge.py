"""Ridge regression on all bases of all effects at all sites together, with modulations; one scale of the largest evidence.

It predicts by all of them. The effect and site with the largest energy is named, with its share of the energy as probability,
if the evidence of the whole regression over no effect exceeds ln(1 / 0.01).
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from problem import Problem, answered, cause, without_geometry

from gtpin.bench.benchmark.answer import Answer
from gtpin.diagnosis.diagnose import FALSE_ALARM

SCALES = np.exp(np.linspace(np.log(1e-3), np.log(30.0), 32))
"""Scales that are tried, in typical sizes of the effects."""


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    problem = Problem.of(folder)
    design, terms = problem.hypotheses.design, list(problem.gains)
    bases = [design.columns(term.basis(design.operating_points)) for term in terms]
    y, X = without_geometry(design.B, design.y, np.hstack(bases))
    U, s, Vt = np.linalg.svd(X, full_matrices=False)
    along = U.T @ y
    evidence = [0.5 * np.sum(along**2 * (t := (k * s) ** 2) / (1 + t) - np.log1p(t)) for k in SCALES]
    best = int(np.argmax(evidence))
    if evidence[best] <= np.log(1.0 / FALSE_ALARM):
        return answered(folder, problem.baseline, [])
    scale = SCALES[best]
    c = Vt.T @ (along * scale**2 * s / (1.0 + (scale * s) ** 2))
    ends = np.cumsum([0, *(basis.shape[1] for basis in bases)])
    energies = np.array([np.sum((X[:, a:b] @ c[a:b]) ** 2) for a, b in pairwise(ends)])
    first = int(np.argmax(energies))
    model = problem.fitted(terms, [float(scale)] * len(terms))
    return answered(folder, model, [cause(terms[first], float(energies[first] / energies.sum()))])
