"""Search for the model of largest log posterior: forward steps from several first terms, exchanges and removals; lines."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincc

from gtpin.diagnosis.evidence import NOTHING, tuned, without
from gtpin.diagnosis.hypothesis import Hypothesis, related, same_place
from gtpin.diagnosis.hypothesis_set import (
    Explanation,
    Gain,
    HypothesisSet,
    Term,
    causes,
    explained_by,
    scales,
)
from gtpin.diagnosis.scan import NO_GAIN
from gtpin.typing import Floats

BEAM = 3
"""Number of first explanations that are tried: the best single explanation need not be in the best pair."""
REMOVAL_MARGIN, REMOVAL_SHARE = 30.0, 0.01
"""Largest gain in worth by new scales after an explanation was removed: nats, and as a share of the worth. Assumed."""
MOST_TERMS = 5
"""Most explanations in a model of a robot with rods; without rods, one more for each actuator."""


def most(hypotheses: HypothesisSet) -> int:
    """Largest number of explanations in a model."""
    return MOST_TERMS + hypotheses.design.operating_points.robot.n_actuators if hypotheses.long else MOST_TERMS


def rough_guess(hypotheses: HypothesisSet, before: Explanation = NOTHING) -> Explanation:
    """A model of everything that is not noise, by one search from a single first explanation.

    ``before``: an earlier such model, of these poses with another noise. A search of a robot without rods, whose models are
    long, starts from it.
    """
    alone = hypotheses.gains(NOTHING, hypotheses.every)
    return search(hypotheses, hypotheses.every, alone, beginnings=1, start=_anew(hypotheses, before))


def search(
    hypotheses: HypothesisSet,
    terms: Sequence[Term],
    alone: Mapping[Term, Gain],
    beginnings: int = BEAM,
    largest: int | None = None,
    start: Explanation = NOTHING,
) -> Explanation:
    """The model of largest worth that was found, out of some explanations.

    ``terms``: the explanations that the model can have. ``alone``: gain in log evidence of each as the only one.
    ``beginnings``: number of first explanations that are tried. ``largest``: largest number of explanations in the model; by
    default :func:`most`. ``start``: a model of these hypotheses that is extended first. If it then has more than ``MOST_TERMS``
    explanations, no other first explanation is tried.
    """
    largest = most(hypotheses) if largest is None else largest
    terms = _with_room(hypotheses, NOTHING, terms)
    order = sorted(terms, key=lambda t: -(alone[t].value - hypotheses.cost(t)))
    best: Explanation = _grow(hypotheses, start, terms, largest) if start.terms else NOTHING
    taken = {hypotheses.without_value(t) for t in best.terms}
    for term in order[: beginnings if len(best.terms) <= MOST_TERMS else 0]:
        if alone[term].value < hypotheses.cost(term):
            break
        if term in taken:
            continue
        grown = _grown(hypotheses, alone[term].term, terms, largest)
        if hypotheses.log_posterior(grown) > hypotheses.log_posterior(best):
            best = grown
            taken = {hypotheses.without_value(t) for t in best.terms}
    return best


def _grown(hypotheses: HypothesisSet, first: Term, terms: Sequence[Term], largest: int) -> Explanation:
    key = first, tuple(terms), largest
    if key not in hypotheses.grown:
        hypotheses.grown[key] = _grow(hypotheses, hypotheses.extended(NOTHING, first), terms, largest)
    return hypotheses.grown[key]


def _anew(hypotheses: HypothesisSet, before: Explanation) -> Explanation:
    """An earlier model with this noise: its explanations that these hypotheses have, without those that reduce the worth."""
    known = set(hypotheses.every)
    terms = [term for term in before.terms if hypotheses.without_value(term) in known]
    if not hypotheses.long or not terms:
        return NOTHING
    return _pruned(hypotheses, hypotheses.of(terms, [scales(before)[term] for term in terms]))


def _grow(hypotheses: HypothesisSet, model: Explanation, terms: Sequence[Term], largest: int) -> Explanation:
    last: dict[tuple[str, str], float] = {}
    while True:
        lines = further_lines(hypotheses, model, last=last)
        gains = hypotheses.net_gains(model, _with_room(hypotheses, model, terms)) if len(model.terms) < largest else {}
        best = max(gains.values(), key=lambda g: g.whole, default=None)
        # Gains are computed with fixed scales: where the step of larger gain does not increase the worth, the other is tried.
        steps = ["term", "lines"] if lines is None or (best and best.whole >= lines[0]) else ["lines", "term"]
        for step in steps:
            larger = model
            if step == "lines" and lines is not None:
                larger = _pruned(hypotheses, widened(hypotheses, model, *lines[1:]))
            elif step == "term" and best is not None and best.whole >= 0.0:
                larger = with_all_lines(hypotheses, model, best)
                if not hypotheses.long:
                    # The same model, found from other first explanations, then has the same values, and known gains. Of a
                    # long model a term would be removed that a swap makes useful.
                    larger = _revalued(hypotheses, _pruned(hypotheses, larger))
                larger = _pruned(hypotheses, _swapped(hypotheses, larger, terms))
            if hypotheses.log_posterior(larger) > hypotheses.log_posterior(model) + 1e-9:
                break
        else:
            larger = _with_lines_instead(hypotheses, settled(hypotheses, model))
            if not hypotheses.log_posterior(larger) > hypotheses.log_posterior(model) + 1e-9:
                return model
        model = larger


def _with_lines_instead(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model with all lines of a drive in the place of its smooth deviation, where that increases the worth.

    Where a joint has many lines, its smooth deviation gains more than any single line, and no single line in addition is worth
    its prior odds.
    """
    if not hypotheses.long:
        return model
    present = {cause.place for cause in causes(model)}
    for term in model.terms:
        for lines in hypotheses.scanned:
            if lines.effect.most_values < 2 or lines.place in present or explained_by(term).site != lines.site:
                continue
            rest = without(hypotheses.groups, model, term, sweeps=1)
            gain = hypotheses.gains(rest, (lines,))[lines]
            if gain.value > hypotheses.cost(lines) and isinstance(gain.term, Hypothesis):
                trial = _pruned(hypotheses, with_its_lines(hypotheses, rest, gain.term))
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model) + 1e-9:
                    return trial
    return model


def _with_room(hypotheses: HypothesisSet, model: Explanation, terms: Sequence[Term]) -> Sequence[Term]:
    """The terms with which a model of a robot without rods has at most ``most_coefficients`` coefficients per measured number.

    Terms of all links of an arm have hundreds of coefficients, and several such terms explain any data.
    """
    if not hypotheses.long:
        return terms
    room = hypotheses.priors.most_coefficients * hypotheses.design.count - len(model.mean)
    if room <= 0.0:
        return []
    groups = hypotheses.groups
    return [term for term in terms if term not in groups or groups.width(term) <= room]


def _swapped(hypotheses: HypothesisSet, model: Explanation, terms: Sequence[Term]) -> Explanation:
    """The model after exchanges of one explanation for another that increase its worth."""
    for _ in range(3):
        before = model
        for term in model.terms:
            rest = without(hypotheses.groups, model, term, sweeps=1)
            others = _instead(hypotheses, term, _with_room(hypotheses, rest, terms))
            found = hypotheses.gains(rest, (hypotheses.without_value(term), *others))
            gains = {t: gain.value - hypotheses.cost(t) for t, gain in found.items()}
            own, other = hypotheses.without_value(term), max(gains, key=lambda t: gains[t])
            # Further lines of a periodic error are not in the gain of a single one.
            mine = max(gains[own], hypotheses.log_posterior(model) - hypotheses.log_posterior(rest))
            if other != own and gains[other] > mine + 0.5:
                trial = hypotheses.extended(rest, found[other].term)
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model):
                    model = trial
                    break
        if model is before:
            return model
    return model


def _revalued(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model with nonlinear parameters estimated beside the explanations that are left; they were found beside others."""
    for term in model.terms:
        if isinstance(term, Hypothesis) and len(term.values) == 1:
            rest = without(hypotheses.groups, model, term, sweeps=1)
            found = hypotheses.gains(rest, (term.template,))[term.template].term
            if isinstance(found, Hypothesis) and found != term:
                trial = hypotheses.replaced(model, term, found)
                if hypotheses.log_posterior(trial) > hypotheses.log_posterior(model):
                    model = trial
    return model


def _instead(hypotheses: HypothesisSet, term: Term, terms: Sequence[Term]) -> Sequence[Term]:
    """The explanations that are tried in the place of ``term``: for a robot without rods, those that can look like it."""
    robot, own = hypotheses.design.operating_points.robot, explained_by(term)
    if not hypotheses.long:
        return terms
    return [t for t in terms if same_place(robot, own, explained_by(t)) or related(robot, own, explained_by(t))]


def _pruned(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model without the explanations that reduce its worth."""
    groups = hypotheses.groups
    while model.terms:
        log_posterior = hypotheses.log_posterior(model)
        terms = model.terms
        if hypotheses.long:  # such models are large: new scales are computed only where a removal loses little worth
            margin = max(REMOVAL_MARGIN, REMOVAL_SHARE * abs(log_posterior))
            terms = tuple(
                t for t in terms if hypotheses.log_posterior(without(groups, model, t)) > log_posterior - margin
            )
        smaller = [without(groups, model, t, sweeps=1) for t in terms]
        best = max(smaller, key=hypotheses.log_posterior, default=model)
        if best is model or hypotheses.log_posterior(best) < log_posterior:
            return model
        model = best
    return model


FEW_LINES = 3
"""Where a periodic error has fewer other lines than this, a line is estimated again by a scan of all periods; otherwise about
fifty periods near its last one are tried. Assumed."""
SAME_PERIOD = 0.1
"""Change of a period, in standard deviations, below which the line is not changed. Assumed."""
LINE_SWEEPS, LINES_CONVERGED = 6, 0.1
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
    found = _lines_reestimated(hypotheses, hypotheses.extended(model, term), term)
    return tuned(hypotheses.groups, found.terms, found.scale)


def widened(hypotheses: HypothesisSet, model: Explanation, wider: Hypothesis, old: Hypothesis) -> Explanation:
    """A model with more lines in the place of one of its periodic errors, all of them estimated again."""
    found = _lines_reestimated(hypotheses, hypotheses.replaced(model, old, wider), wider)
    return tuned(hypotheses.groups, found.terms, found.scale)


def settled(hypotheses: HypothesisSet, model: Explanation) -> Explanation:
    """The model with the lines of every periodic error estimated again until the gain is below ``LINES_CONVERGED``."""
    for place in [cause.place for cause in causes(model) if cause.further]:
        for _ in range(LINE_SWEEPS):
            term = next((cause for cause in causes(model) if cause.place == place), None)
            if term is None or not term.further:
                break
            found = _lines_reestimated(hypotheses, model, term)
            gained = hypotheses.log_posterior(found) - hypotheses.log_posterior(model)
            model = found
            if gained < LINES_CONVERGED:
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


def _lines_reestimated(hypotheses: HypothesisSet, model: Explanation, term: Hypothesis) -> Explanation:
    """The model with each line of a hypothesis estimated again given the others, or left out where that increases the worth."""
    for old in term.lines:
        if len(term.values) < 2:  # its lines were equal
            break
        less = term.with_lines([line for line in term.lines if line != old])
        without_it = hypotheses.replaced(model, term, less)
        candidates = [(less, without_it)] if len(less.values) > 1 else []
        found = _estimated(hypotheses, without_it, less, old)
        if abs(found[0] - old[0]) > SAME_PERIOD * found[1]:
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
    return old if found.gain <= NO_GAIN else (found.value, found.sigma)


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


LEAST_SEEN = 1e-6
"""Smallest whitened motion by a drive, relative to the largest, of a row that shows the drive: it avoids a division by 0."""


def chance_lines(hypotheses: HypothesisSet, model: Explanation) -> tuple[Hypothesis, ...]:
    """The periodic errors of a model of which no line is significant against the scatter of its drive.

    A search compares a line with noise. Where an unknown error of a drive is larger than noise and has no period, many periods
    gain evidence, because each fits a part of it by chance. Here a line is compared with all that is left without it.
    """
    lines = [c for c in causes(model) if c.effect.of_own_command and c.effect.most_values > 1 and c.values]
    if not lines:
        return ()
    most = hypotheses.priors.chance_line
    return tuple(c for c in lines if FittedLines.of(hypotheses, model, c).chance() > most)


@dataclass(frozen=True)
class FittedLines:
    """Errors of one drive at its different commands, and the lines that were fitted to them.

    ``errors``, ``variance``: (n,) errors that the geometry and the other causes leave, m or rad: the mean of the visits of a
    command; and their variance by the noise. ``lines``: for each line its (n, p) deviations of the travel less what the
    geometry and the other causes fit of them, m or rad. ``tried``: number of periods that were tried.
    ``effective_parameters``: effective number of the errors that the geometry and the other causes fit: this many are
    missing in what is left.
    """

    errors: Floats
    variance: Floats
    lines: tuple[Floats, ...]
    tried: int
    effective_parameters: float = 0.0

    @staticmethod
    def of(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> FittedLines:
        """The errors of a drive that the geometry and a model without one periodic error leave, and the lines of this error.

        What the geometry and the other causes fit of the lines is subtracted. Flexible causes of the drive fit scatter, too;
        without the subtraction, less scatter would be left, and the lines would look significant.
        """
        design = hypotheses.design
        along = design.by_command[:, :, design.operating_points.robot.sites.index(cause.site)]
        information = np.einsum("nc,nc->n", along, along)
        shown = information > LEAST_SEEN**2 * information.max()
        along, information = along[shown], information[shown]

        def moved(columns: Floats) -> Floats:
            return np.asarray(np.einsum("nc,ncm->nm", along, columns.reshape(len(shown), design.components, -1)[shown]))

        others, prior = design.beside(hypotheses.columns(hypotheses.only(model, set(model.terms) - {cause})))
        normal = others.T @ others + np.diag(prior)
        whole = np.column_stack([design.y, hypotheses.groups.columns(cause)])
        left = moved(whole - others @ np.linalg.solve(normal, others.T @ whole))
        fitted = moved(others) / np.sqrt(information)[:, None]
        # I - H of independent errors, H the fit's hat matrix, has tr (I - H)^2 degrees of freedom; this one has H's traces.
        hat = np.linalg.solve(normal, fitted.T @ fitted)
        same = np.unique(design.operating_points.q[shown], axis=0, return_inverse=True)[1].ravel()
        total = np.bincount(same, information)
        left = np.stack([np.bincount(same, column) for column in left.T], axis=1) / total[:, None]
        return FittedLines(
            errors=left[:, 0],
            variance=1.0 / total,
            lines=tuple(np.split(left[:, 1:], len(cause.values), axis=1)),
            tried=len(cause.effect.nonlinear_values(design.operating_points, cause.site)),
            effective_parameters=float(2.0 * np.trace(hat) - np.einsum("ij,ji->", hat, hat)),
        )

    def chance(self) -> float:
        """Upper bound of the probability that scatter without a period shows a line as significant as the best one.

        The lines are fitted one after the other, the strongest first; what is left without the line is noise of known variance
        and scatter of the drive, whose variance is estimated. Of n such errors, less those that other causes fit, p columns
        take a share of the power with a beta distribution, of parameters p/2 and (n - p)/2. The best of all periods that were
        tried takes a larger share than this with at most their number times the probability (Bonferroni). The k-th test of a
        line has the share 1 / (k (k + 1)) of the whole probability.
        """
        residual, open_, least = self.errors, list(self.lines), 1.0
        freedom = len(self.errors) - self.effective_parameters
        for tested in range(1, len(self.lines) + 1):
            if freedom <= 1.0:
                break
            scatter = max(float((residual**2).sum()) / freedom - float(self.variance.mean()), 0.0)
            root = 1.0 / np.sqrt(self.variance + scatter)
            whole = float(((residual * root) ** 2).sum())
            fits = [X @ np.linalg.lstsq(X * root[:, None], residual * root, rcond=None)[0] for X in open_]
            powers = [float((((residual - fit) * root) ** 2).sum()) for fit in fits]
            best = int(np.argmin(powers))
            width = open_.pop(best).shape[1]
            if freedom <= width + 1.0 or whole == 0.0:
                break
            share = min(max(1.0 - powers[best] / whole, 0.0), 1.0)
            least = min(
                least, float(betaincc(width / 2.0, (freedom - width) / 2.0, share)) * self.tried * tested * (tested + 1)
            )
            residual, freedom = residual - fits[best], freedom - width
        return least
