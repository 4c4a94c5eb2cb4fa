"""The fourth step of a diagnosis: causes and geometry fitted together, what they explain, and doubts that this raises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset, by_region
from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.inference.causes import cause
from gtpin.diagnosis.inference.digits import with_full_digits
from gtpin.diagnosis.inference.findings import Cause, Question, Unexplained
from gtpin.diagnosis.inference.held_out import held_out
from gtpin.diagnosis.inference.joint_fit import fit_together
from gtpin.diagnosis.inference.predictive import with_smaller_errors, without_idle
from gtpin.diagnosis.inference.questions import questions, without_impossible
from gtpin.diagnosis.inference.scatter import hidden_in_scatter, with_scatter
from gtpin.diagnosis.inference.settle import Settled
from gtpin.diagnosis.inference.two_groups import with_one_measurement
from gtpin.diagnosis.inference.two_valued import with_two_valued
from gtpin.diagnosis.inference.unexplained import unexplained
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.cross_validation import Gap, gap
from gtpin.diagnosis.preparation.prepare import Prepared
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]
TOGETHER = 4
"""Neighbouring poses that are left out together."""


@dataclass(frozen=True)
class Fitted:
    """What was concluded in the end, with the fitted causes.

    Parameters
    ----------
    conclusion
        With the doubts that the fit and left-out poses raise.
    model
        Geometry with the causes in.
    causes
        The one that explains most first.
    gap
        How far the gap shrinks on left-out poses.
    unexplained
        What is left.
    questions
        Parameters outside what is plausible or usual.
    """

    conclusion: Conclusion
    model: Model
    causes: tuple[Cause, ...]
    gap: Gap
    unexplained: Unexplained
    questions: tuple[Question, ...]


def fit(prepared: Prepared, settled: Settled, found: Conclusion, rng: np.random.Generator) -> Fitted:
    """Fit geometry and causes together, and hold the conclusion against plausible parameters and left-out poses."""
    hypotheses, searched = settled.hypotheses, settled.searched
    found = with_full_digits(without_idle(hypotheses, found, _blocks(searched)), hypotheses, searched)
    found = with_one_measurement(found, hypotheses, searched)
    found = with_two_valued(hypotheses, found, settled.observed.noise)
    found = with_smaller_errors(hypotheses, found, _blocks(searched))
    model, causes = _fitted(prepared, settled, found)
    asked = questions(found, causes, hypotheses.priors)
    if asked.impossible:
        found = without_impossible(hypotheses, found, asked.impossible)
        model, causes = _fitted(prepared, settled, found)
    columns = {c.place: hypotheses.groups.columns[c] * found.scale[c] for c in found.classes}
    whole, shares = _gaps(settled, columns, rng)
    takes = {place: (whole.shrinkage or 0.0) - (share.shrinkage or 0.0) for place, share in shares.items()}
    causes = [replace(c, shrinkage=takes[c.effect, c.site]) for c in causes]
    found = held_out(found, hypotheses, whole)
    at, noise = hypotheses.design.situation, prepared.baseline.noise
    hidden = hidden_in_scatter(found, noise, hypotheses.untestable, at, hypotheses.priors)
    found = with_scatter(found, hidden)
    remaining = unexplained(hypotheses, found.model, found.verdict == "unknown")
    could_be = tuple(dict.fromkeys((*(h.place for h in hidden), *remaining.could_be)))
    return Fitted(
        conclusion=found,
        model=model,
        causes=tuple(sorted(causes, key=lambda c: -c.shrinkage)),
        gap=whole,
        unexplained=replace(remaining, could_be=could_be),
        questions=(*asked.impossible, *asked.unusual),
    )


def _fitted(prepared: Prepared, settled: Settled, found: Conclusion) -> tuple[Model, list[Cause]]:
    """The model with the causes in, and the causes with their parameters."""
    named: Sequence[Hypothesis] = list(found.classes)
    scale = [found.scale[cause] for cause in named]
    references = settled.hypotheses.design.situation.references
    model = fit_together(settled.everything, prepared.baseline.model, named, scale, references)
    return model, [cause(model, c, found.classes[c]) for c in named]


def _blocks(dataset: Dataset) -> list[npt.NDArray[np.bool_]]:
    """Neighbouring poses that are left out together."""
    return by_region(dataset, max(2, (int(dataset.visits.max()) + 1) // TOGETHER))


def _gaps(
    settled: Settled, columns: dict[tuple[str, str], Floats], rng: np.random.Generator
) -> tuple[Gap, dict[tuple[str, str], Gap]]:
    """How far the gap shrinks with all causes, and with all but each."""
    design, noise = settled.hypotheses.design, settled.observed.noise
    blocks = _blocks(settled.searched)
    covariance = noise.covariance(design.command_jacobian, design.components)
    floor = np.trace(covariance[:, :3, :3], axis1=1, axis2=2)
    none = np.zeros((len(design.y), 0))
    whole = gap(design, np.hstack([none, *columns.values()]), floor, blocks, rng)
    if len(columns) == 1:
        return whole, {place: gap(design, none, floor, blocks, rng) for place in columns}
    less = {place: np.hstack([none, *(v for p, v in columns.items() if p != place)]) for place in columns}
    return whole, {place: gap(design, others, floor, blocks, rng) for place, others in less.items()}
