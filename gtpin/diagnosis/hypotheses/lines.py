"""Lines of periodic errors: several at once, estimated again given each other, as many as are worth it.

A joint of an arm can have tens of lines. Each step of the search adds all that are large relative to the largest; then each is
estimated again given the others.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Gain, HypothesisSet, Model, causes
from gtpin.diagnosis.linear.exchange import tuned

FEW_LINES = 3
"""Number of a periodic error's other lines up to which a line is searched for again over all periods; given more of them, its
period is estimated again near where it was: some fifty periods are tried instead of all. Assumed."""
SAME = 0.1
"""Change of a period, in standard deviations, below which the line stays as it is. Assumed."""
SWEEPS, SETTLED = 6, 0.1
"""How often all lines are estimated again at most, and the gain in worth, in nats, below which they are settled. Assumed."""


def further_lines(
    hypotheses: HypothesisSet,
    model: Model,
    terms: Collection[Hypothesis] | None = None,
    last: dict[tuple[str, str], float] | None = None,
) -> tuple[float, Hypothesis, Hypothesis] | None:
    """Of a model's periodic errors the one that gains most by more lines, with these lines and without them.

    The gain is in worth, to first order; None where no line gains.

    Parameters
    ----------
    terms
        Only these of its periodic errors.
    last
        By place, what each gained last, for a smaller model; brought up to date. A line seldom gains more in a larger model, so
        what gained less than the best does now is not looked at again.
    """
    if hypotheses.design.situation.robot.rods:
        return None
    best: tuple[float, Hypothesis, Hypothesis] | None = None
    last = {} if last is None else last
    for term in sorted(causes(model) if terms is None else terms, key=lambda t: -last.get(t.place, np.inf)):
        if best and last.get(term.place, np.inf) <= best[0]:
            break
        if not 0 < len(term.values) < term.effect.most_values or term.template not in hypotheses.scanned:
            continue
        line = hypotheses.scanned_gain(term.template, model, term.values)
        gain = line.value - hypotheses.priors.line
        last[term.place] = gain + line.more if gain > 0.0 else 0.0
        if last[term.place] > (best[0] if best else 0.0) and isinstance(line.term, Hypothesis):
            best = (last[term.place], term.with_lines((*term.lines, *line.term.lines, *line.further)), term)
    return best


def with_all_lines(hypotheses: HypothesisSet, model: Model, gain: Gain) -> Model:
    """A model with one more explanation, and with all its lines at once where there are several."""
    if not gain.further or not isinstance(gain.term, Hypothesis):
        return hypotheses.extended(model, gain.term)
    term = gain.term.with_lines((*gain.term.lines, *gain.further))
    found = _with_lines(hypotheses, hypotheses.extended(model, term), term)
    return tuned(hypotheses.groups, found.terms, found.scale)


def widened(hypotheses: HypothesisSet, model: Model, wider: Hypothesis, old: Hypothesis) -> Model:
    """A model with more lines in the place of one of its periodic errors, all of them estimated again."""
    found = _with_lines(hypotheses, hypotheses.replaced(model, old, wider), wider)
    return tuned(hypotheses.groups, found.terms, found.scale)


def settled(hypotheses: HypothesisSet, model: Model) -> Model:
    """The model with the lines of every periodic error estimated again until that gains nothing more."""
    for place in [cause.place for cause in causes(model) if cause.further]:
        for _ in range(SWEEPS):
            term = next((cause for cause in causes(model) if cause.place == place), None)
            if term is None or not term.further:
                break
            found = _with_lines(hypotheses, model, term)
            gained = hypotheses.worth(found) - hypotheses.worth(model)
            model = found
            if gained < SETTLED:
                break
    return model


def with_its_lines(hypotheses: HypothesisSet, rest: Model, term: Hypothesis) -> Model:
    """A model with one more hypothesis and every further line of it that is worth it."""
    key = rest.terms, rest.scale, term
    if key not in hypotheses.lined:
        model = hypotheses.extended(rest, term)
        own = next(t for t in causes(model) if t.place == term.place)
        while (line := further_lines(hypotheses, model, (own,))) is not None:
            wider = widened(hypotheses, model, *line[1:])
            if hypotheses.worth(wider) <= hypotheses.worth(model) + 1e-9:
                break
            model, own = wider, next(t for t in causes(wider) if t.place == term.place)
        hypotheses.lined[key] = model
    return hypotheses.lined[key]


def _with_lines(hypotheses: HypothesisSet, model: Model, term: Hypothesis) -> Model:
    """The model with each line of a hypothesis estimated again given the others, or left out where it is not worth it."""
    for old in term.lines:
        less = term.with_lines([line for line in term.lines if line != old])
        without_it = hypotheses.replaced(model, term, less)
        candidates = [(less, without_it)] if len(less.values) > 1 else []
        found = _estimated(hypotheses, without_it, less, old)
        if abs(found[0] - old[0]) > SAME * found[1]:
            again = less.with_lines((*less.lines, found))
            candidates.insert(0, (again, hypotheses.replaced(without_it, less, again)))
        for candidate, trial in candidates:
            if hypotheses.worth(trial) > hypotheses.worth(model) + 1e-6:
                model, term = trial, candidate
    return model


def _estimated(
    hypotheses: HypothesisSet, model: Model, others: Hypothesis, old: tuple[float, float]
) -> tuple[float, float]:
    """A line's period given its others, and its standard deviation."""
    if len(others.values) < FEW_LINES:
        line = hypotheses.scanned_gain(others.template, model, others.values).term
        assert isinstance(line, Hypothesis)
        return line.lines[0]
    near = hypotheses.scan(others.template).near(model, old[0], others.values)
    return near.value, near.sigma
