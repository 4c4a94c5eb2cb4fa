"""The order of a periodic error's lines: the strongest is the first."""

from __future__ import annotations

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet, Model


def strongest_first(hypotheses: HypothesisSet, model: Model, cause: Hypothesis) -> Hypothesis:
    """A cause of a model with its lines by the size of their cores, the largest first; other causes as they are."""
    if not cause.further:
        return cause
    widths = [hypotheses.groups.width(term) for term in model.terms]
    place = model.terms.index(cause)
    start = sum(widths[:place])
    one = cause.basis(hypotheses.design.situation).sigma
    lines = (model.mean[start : start + widths[place]] * one).reshape(len(cause.values), -1)
    size = np.linalg.norm(lines[:, list(cause.effect.core)], axis=1)
    return cause.with_lines([cause.lines[i] for i in np.argsort(-size, kind="stable")])
