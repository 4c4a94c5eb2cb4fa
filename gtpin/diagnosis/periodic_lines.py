"""The lines (periods) of the periodic error of a drive: more of them, all of them estimated again, those that are chance."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from gtpin.diagnosis.evidence import Posterior, tuned, without_coefficients
from gtpin.diagnosis.hypothesis import Hypothesis, Term
from gtpin.diagnosis.hypothesis_set import Gain, HypothesisSet, causes
from gtpin.diagnosis.scan import NO_GAIN, FittedLines

FEW_LINES = 3
"""Where a periodic error has fewer other lines than this, a line is estimated again by a scan of all periods; otherwise about
fifty periods near its last one are tried. Assumed."""
SAME_PERIOD = 0.1
"""Change of a period, in standard deviations, below which the line is not changed. Assumed."""
SHORT_STEP = 0.5
"""Largest step of Newton's method to a better period, and its largest standard deviation, in steps of the scan, of which there
are six in the width of a maximum. Otherwise periods near the last one are tried."""
LINE_SWEEPS, LINES_CONVERGED = 6, 0.1
"""Most times that all lines are estimated again, and the gain in log posterior, nats, below which this stops. Assumed."""


def further_lines(
    hypotheses: HypothesisSet,
    model: Posterior[Term],
    terms: Collection[Hypothesis] | None = None,
    last: dict[tuple[str, str], float] | None = None,
    every: bool = True,
) -> tuple[float, Hypothesis, Hypothesis] | None:
    """The periodic error of a model that gains most by more lines: (gain, hypothesis with these lines, hypothesis without).

    The gain is in log posterior, nats, to first order. None where no line gains.

    ``terms``: only these of its periodic errors. ``last``: gains of each periodic error in an earlier, smaller model, by place;
    they are updated here. A line seldom gains more in a larger model, so those that gained less than the best one now are not
    computed again; those that gained nothing only where ``every`` is true, and no other gains.
    """
    if not hypotheses.long or len(model.mean) >= hypotheses.priors.most_coefficients * hypotheses.design.count:
        return None
    best: tuple[float, Hypothesis, Hypothesis] | None = None
    last = {} if last is None else last
    for term in sorted(causes(model) if terms is None else terms, key=lambda t: -last.get(t.place, np.inf)):
        if (best or not every) and last.get(term.place, np.inf) <= (best[0] if best else 0.0):
            break
        if not 0 < len(term.values) < term.effect.most_values or term.template not in hypotheses.scanned:
            continue
        line = hypotheses.scanned_gain(term.template, model, term.values)
        gain = line.value - hypotheses.priors.line
        last[term.place] = gain + line.more if gain > 0.0 else 0.0
        if last[term.place] > (best[0] if best else 0.0) and isinstance(line.term, Hypothesis):
            best = (last[term.place], term.with_lines((*term.lines, *line.term.lines, *line.further)), term)
    return best


def with_all_lines(hypotheses: HypothesisSet, model: Posterior[Term], gain: Gain) -> Posterior[Term]:
    """A model with one more term, and with all its lines at once where there are several."""
    if not gain.further or not isinstance(gain.term, Hypothesis):
        return hypotheses.extended(model, gain.term)
    term = gain.term.with_lines((*gain.term.lines, *gain.further))
    found = _reestimate_lines(hypotheses, hypotheses.extended(model, term), term)
    return tuned(hypotheses.groups, found.terms, found.scale)


def widened(hypotheses: HypothesisSet, model: Posterior[Term], wider: Hypothesis, old: Hypothesis) -> Posterior[Term]:
    """A model with more lines in the place of one of its periodic errors, all of them estimated again."""
    found = _reestimate_lines(hypotheses, hypotheses.replaced(model, old, wider), wider)
    return tuned(hypotheses.groups, found.terms, found.scale)


def with_lines_reestimated(hypotheses: HypothesisSet, model: Posterior[Term]) -> Posterior[Term]:
    """The model with the lines of every periodic error estimated again until the gain is below ``LINES_CONVERGED``."""
    for place in [cause.place for cause in causes(model) if cause.further]:
        for _ in range(LINE_SWEEPS):
            term = next((cause for cause in causes(model) if cause.place == place), None)
            if term is None or not term.further:
                break
            found = _reestimate_lines(hypotheses, model, term)
            gained = hypotheses.log_posterior(found) - hypotheses.log_posterior(model)
            model = found
            if gained < LINES_CONVERGED:
                break
    return model


def with_lines(hypotheses: HypothesisSet, rest: Posterior[Term], term: Hypothesis) -> Posterior[Term]:
    """A model with one more hypothesis, and with each further line of it that increases the log posterior."""
    key = rest.terms, rest.scale, term
    if key not in hypotheses.models_with_lines:
        model = hypotheses.extended(rest, term)
        own = next(t for t in causes(model) if t.place == term.place)
        while (line := further_lines(hypotheses, model, (own,))) is not None:
            wider = widened(hypotheses, model, *line[1:])
            if hypotheses.log_posterior(wider) <= hypotheses.log_posterior(model) + 1e-9:
                break
            model, own = wider, next(t for t in causes(wider) if t.place == term.place)
        hypotheses.models_with_lines[key] = model
    return hypotheses.models_with_lines[key]


def _reestimate_lines(hypotheses: HypothesisSet, model: Posterior[Term], term: Hypothesis) -> Posterior[Term]:
    """The model with each line of a hypothesis estimated again given the others, or left out where that increases the log
    posterior; of many lines only those that would change."""
    for old, changes in zip(term.lines, _changing(hypotheses, model, term), strict=True):
        if not changes:
            continue
        if len(term.values) < 2:  # its lines were equal
            break
        less = term.with_lines([line for line in term.lines if line != old])
        without_it = hypotheses.replaced(model, term, less)
        candidates = [(less, without_it)]
        found = _estimated(hypotheses, model, term, old, without_it, less)
        if abs(found[0] - old[0]) > SAME_PERIOD * found[1]:
            again = less.with_lines((*less.lines, found))
            candidates.insert(0, (again, hypotheses.replaced(without_it, less, again)))
        for candidate, trial in candidates:
            if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model) + 1e-6:
                model, term = trial, candidate
    return model


def _changing(hypotheses: HypothesisSet, model: Posterior[Term], term: Hypothesis) -> list[bool]:
    """Whether each line of a hypothesis may have another period given the others, or be left out."""
    if len(term.lines) <= FEW_LINES:
        return [True] * len(term.lines)
    at, groups = model.terms.index(term), hypotheses.groups
    place, scale = sum(model.widths[:at]), model.scale[at]
    best, sigma = hypotheses.scan(term.template).improved(model, term.values, place)
    found = np.abs(best - term.values) > SAME_PERIOD * sigma
    for i, part in enumerate(groups.parts(term)):
        own = slice(place, place + groups.width(part))
        found[i] |= without_coefficients(model, own, scale) + hypotheses.priors.line > 0.0
        place = own.stop
    return [bool(changes) for changes in found]


def _estimated(
    hypotheses: HypothesisSet,
    model: Posterior[Term],
    term: Hypothesis,
    old: tuple[float, float],
    without_it: Posterior[Term],
    others: Hypothesis,
) -> tuple[float, float]:
    """A line's period given the other lines, and its standard deviation; the old ones where no other is distinguished.

    ``model``, ``term``: with the line. ``without_it``, ``others``: without it. One step of Newton's method where it is short.
    """
    scan = hypotheses.scan(others.template)
    if len(others.values) < FEW_LINES:
        found = scan.best(without_it, others.values)
        return old if found.gain <= NO_GAIN else (found.value, found.sigma)
    at = model.terms.index(term)
    parts = hypotheses.groups.parts(term)
    before = term.values.index(old[0])
    first = sum(model.widths[:at]) + sum(hypotheses.groups.width(part) for part in parts[:before])
    (value,), (sigma,) = scan.improved(model, old[:1], first)
    short = max(abs(value - old[0]), sigma) < SHORT_STEP * scan.step(old[0])
    if short and scan.resolved(np.array([value]), others.values).all():
        return float(value), float(sigma)
    found = scan.near(without_it, old[0], others.values)
    return old if found.gain <= NO_GAIN else (found.value, found.sigma)


def strongest_first(hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis) -> Hypothesis:
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


def chance_lines(hypotheses: HypothesisSet, model: Posterior[Term]) -> tuple[Hypothesis, ...]:
    """The periodic errors of a model of which no line is significant against the scatter of its drive.

    A search compares a line with noise. Where an unknown error of a drive is larger than noise and has no period, many periods
    gain evidence, because each fits a part of it by chance. Here a line is compared with all that is left without it. Needed by
    a joint with random errors: tests/diagnosis/test_periodic_lines.py. Several lines, which follow any errors at the
    commands that chose them, also have to hold at others.
    """
    lines = [c for c in causes(model) if c.effect.of_own_command and c.effect.most_values > 1 and c.values]
    if not lines:
        return ()
    most, design, found = hypotheses.priors.chance_line, hypotheses.design, []
    for cause in lines:
        others = hypotheses.columns(hypotheses.only(model, set(model.terms) - {cause}))
        each = np.split(hypotheses.groups.columns(cause), len(cause.values), axis=1)
        periods = np.array(cause.effect.nonlinear_values(design.operating_points, cause.site))
        fitted = FittedLines.of(design, others, each, cause.site, len(periods))
        if fitted.chance() > most or (cause.further and fitted.held(periods) < hypotheses.priors.lines_hold):
            found.append(cause)
    return tuple(found)
