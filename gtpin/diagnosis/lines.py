"""Lines of periodic errors: a line is one period with its coefficients, and one hypothesis can have several.

A joint of an arm can have tens of lines. Each step of the search adds all lines whose gain is large relative to the largest
gain; then each line is estimated again given the others.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.hypothesis_set import Explanation, Gain, HypothesisSet, causes
from gtpin.diagnosis.posterior import tuned
from gtpin.diagnosis.scan import LEAST

FEW_LINES = 3
"""Where a periodic error has fewer other lines than this, a line is estimated again by a scan of all periods; otherwise about
fifty periods near its last one are tried. Assumed."""
SAME = 0.1
"""Change of a period, in standard deviations, below which the line is not changed. Assumed."""
SWEEPS, SETTLED = 6, 0.1
"""Most times that all lines are estimated again, and the gain in worth, nats, below which this stops. Assumed."""


def further_lines(
    hypotheses: HypothesisSet,
    model: Explanation,
    terms: Collection[Hypothesis] | None = None,
    last: dict[tuple[str, str], float] | None = None,
) -> tuple[float, Hypothesis, Hypothesis] | None:
    """The periodic error of a model that gains most by more lines: (gain, hypothesis with these lines, hypothesis without).

    The gain is in worth, nats, to first order. None where no line gains.

    ``terms``: only these of its periodic errors. ``last``: gains of each periodic error in an earlier, smaller model, by place;
    they are updated here. A line seldom gains more in a larger model, so those that gained less than the best one now are not
    computed again.
    """
    if not hypotheses.long or len(model.mean) >= hypotheses.priors.most_coefficients * hypotheses.design.count:
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


def with_all_lines(hypotheses: HypothesisSet, model: Explanation, gain: Gain) -> Explanation:
    """A model with one more explanation, and with all its lines at once where there are several."""
    if not gain.further or not isinstance(gain.term, Hypothesis):
        return hypotheses.extended(model, gain.term)
    term = gain.term.with_lines((*gain.term.lines, *gain.further))
    found = _with_lines(hypotheses, hypotheses.extended(model, term), term)
    return tuned(hypotheses.groups, found.terms, found.scale)


def widened(hypotheses: HypothesisSet, model: Explanation, wider: Hypothesis, old: Hypothesis) -> Explanation:
    """A model with more lines in the place of one of its periodic errors, all of them estimated again."""
    found = _with_lines(hypotheses, hypotheses.replaced(model, old, wider), wider)
    return tuned(hypotheses.groups, found.terms, found.scale)


def settled(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model with the lines of every periodic error estimated again until the gain is below ``SETTLED``."""
    for place in [cause.place for cause in causes(model) if cause.further]:
        for _ in range(SWEEPS):
            term = next((cause for cause in causes(model) if cause.place == place), None)
            if term is None or not term.further:
                break
            found = _with_lines(hypotheses, model, term)
            gained = hypotheses.log_posterior(found) - hypotheses.log_posterior(model)
            model = found
            if gained < SETTLED:
                break
    return model


def with_its_lines(hypotheses: HypothesisSet, rest: Explanation, term: Hypothesis) -> Explanation:
    """A model with one more hypothesis, and with each further line of it that increases the worth."""
    key = rest.terms, rest.scale, term
    if key not in hypotheses.lined:
        model = hypotheses.extended(rest, term)
        own = next(t for t in causes(model) if t.place == term.place)
        while (line := further_lines(hypotheses, model, (own,))) is not None:
            wider = widened(hypotheses, model, *line[1:])
            if hypotheses.log_posterior(wider) <= hypotheses.log_posterior(model) + 1e-9:
                break
            model, own = wider, next(t for t in causes(wider) if t.place == term.place)
        hypotheses.lined[key] = model
    return hypotheses.lined[key]


def _with_lines(hypotheses: HypothesisSet, model: Explanation, term: Hypothesis) -> Explanation:
    """The model with each line of a hypothesis estimated again given the others, or left out where that increases the worth."""
    for old in term.lines:
        if len(term.values) < 2:  # its lines were equal
            break
        less = term.with_lines([line for line in term.lines if line != old])
        without_it = hypotheses.replaced(model, term, less)
        candidates = [(less, without_it)] if len(less.values) > 1 else []
        found = _estimated(hypotheses, without_it, less, old)
        if abs(found[0] - old[0]) > SAME * found[1]:
            again = less.with_lines((*less.lines, found))
            candidates.insert(0, (again, hypotheses.replaced(without_it, less, again)))
        for candidate, trial in candidates:
            if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model) + 1e-6:
                model, term = trial, candidate
    return model


def _estimated(
    hypotheses: HypothesisSet, model: Explanation, others: Hypothesis, old: tuple[float, float]
) -> tuple[float, float]:
    """A line's period given the other lines, and its standard deviation; the old ones where no other is distinguished."""
    scan = hypotheses.scan(others.template)
    few = len(others.values) < FEW_LINES
    found = scan.best(model, others.values) if few else scan.near(model, old[0], others.values)
    return old if found.gain <= LEAST else (found.value, found.sigma)


def strongest_first(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> Hypothesis:
    """A cause of a model with its lines by the size of their cores, the largest first; other causes as they are."""
    if not cause.further:
        return cause
    widths = [hypotheses.groups.width(term) for term in model.terms]
    place = model.terms.index(cause)
    start = sum(widths[:place])
    one = cause.basis(hypotheses.design.operating_points).sigma
    lines = (model.mean[start : start + widths[place]] * one).reshape(len(cause.values), -1)
    size = np.linalg.norm(lines[:, list(cause.effect.core)], axis=1)
    return cause.with_lines([cause.lines[i] for i in np.argsort(-size, kind="stable")])
