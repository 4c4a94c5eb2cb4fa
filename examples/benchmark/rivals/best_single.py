"""Names the effect and site with the largest evidence alone if it exceeds ln(hypotheses / 0.01); its class by evidence.

Probabilities are those of Bayes' rule over all single hypotheses and none, with the same prior odds for each hypothesis.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from problem import Problem, answered, cause

from gtpin.bench.benchmark.answer import Answer
from gtpin.diagnosis.diagnose import FALSE_ALARM

SHARE = 0.05
"""Smallest probability of a member of the class."""


def answer(folder: Path) -> Answer:
    """The answer to one case."""
    problem = Problem.of(folder)
    terms, gains = list(problem.gains), np.array(list(problem.gains.values()))
    against = np.log(len(terms) / FALSE_ALARM)
    if gains.max() <= against:
        return answered(folder, problem.baseline, [])
    shares = np.exp(gains - against - np.logaddexp(np.logaddexp.reduce(gains - against), 0.0))
    first = int(np.argmax(gains))
    others = [terms[i] for i in np.argsort(-shares) if i != first and shares[i] >= SHARE]
    return answered(folder, problem.fitted([terms[first]]), [cause(terms[first], float(shares[first]), others)])
