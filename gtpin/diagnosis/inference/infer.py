"""The third step of a diagnosis, from evidence to a conclusion: which causes are named, and are smooth terms needed?"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betaincc, expit

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis, SmoothTerm, alike
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, HypothesisSet, causes, smooth_terms
from gtpin.diagnosis.hypotheses.proxies import Proxy
from gtpin.diagnosis.inference.classes import contenders, ranked, with_two_instead
from gtpin.diagnosis.inference.findings import Conclusion, Doubt
from gtpin.diagnosis.inference.reestimate_noise import reestimate_noise, restless_drive
from gtpin.diagnosis.inference.search import search
from gtpin.diagnosis.inference.settle import SearchState
from gtpin.diagnosis.linear.posterior import NOTHING, tuned, without
from gtpin.diagnosis.priors import SURE
from gtpin.typing import Floats


def infer(settled: SearchState, barred: Collection[tuple[str, str]] = ()) -> Conclusion:
    """Search, compare named causes with smooth terms, and look for an actuator whose errors change too fast for these terms.

    Periodic errors that scatter alone would show are barred in a further search. ``barred``: effects and sites that cannot be
    causes.
    """
    hypotheses, scattered = settled.hypotheses, set[tuple[str, str]]()
    while True:
        out = {*barred, *scattered}
        allowed, guess = hypotheses.barring(out) if out else hypotheses, settled.guess
        guess = allowed.only(guess, [t for t in guess.terms if getattr(t, "place", None) not in out]) if out else guess
        found = decide(allowed, guess)
        if not (by_chance := chance_lines(hypotheses, found)):
            break
        scattered |= {cause.place for cause in by_chance}
    found = replace(found, alone=hypotheses.gains(NOTHING, hypotheses.every))
    if found.doubts:
        return found
    sites = tuple(sorted({site for _, site in scattered}))
    site = restless_drive(hypotheses, found.model, sites) if sites else None
    if site is None:
        site = reestimate_noise(settled.observed, hypotheses, found.model).restless
    if site is None:
        return found
    # Errors of this actuator change too fast for smooth terms: causes of other sites are kept where they are sure.
    own = f"q{hypotheses.design.operating_points.robot.sites.index(site) + 1}"
    kept = found.only(hypotheses, [cause for cause in found.beside_unknown() if cause.site != site])
    return kept.doubted(Doubt("restless", site, (own,)))


def decide(hypotheses: HypothesisSet, guess: Explanation = NOTHING) -> Conclusion:
    """Search with and without smooth terms, compare both models, and conclude which causes are named.

    ``guess``: a model that an earlier search found. The searches of a robot without rods, whose models are long, start from it.
    """
    alone = hypotheses.gains(NOTHING, hypotheses.every)
    start = guess if hypotheses.long else NOTHING
    named = search(hypotheses, hypotheses.named, alone, start=hypotheses.only(start, causes(start)))
    mixed = search(hypotheses, hypotheses.every, alone, start=start)
    needed = smooth_terms(mixed)
    if needed and _unknown(hypotheses, mixed, named) > 0.5:
        named = hypotheses.only(mixed, (*_apart(hypotheses, mixed), *needed))
    elif needed := _replacing(hypotheses, named):
        better = tuned(hypotheses.groups, (*named.terms, *needed), (*named.scale, *(1.0 for _ in needed)))
        named = hypotheses.only(better, (*_apart(hypotheses, better), *needed))
    named = without_redundant(hypotheses, named)
    # The smooth terms stay in the model while classes are compared: else an alternative would gain by what they explain.
    classes = {cause: contenders(hypotheses, named, cause) for cause in causes(named)}
    instead: list[tuple[str, str]] = []
    for cause in [cause for cause, members in classes.items() if cause.further and members[0].probability >= SURE]:
        if (replaced := _without_lines(hypotheses, named, cause)) is not None:
            named, needed = replaced, smooth_terms(replaced)
            instead.append(cause.place)
            del classes[cause]
    if not needed:  # where something is unknown, the second of two would explain that, not what the cause explains
        classes = dict(with_two_instead(hypotheses, named, classes))
    doubts = tuple(Doubt("smooth_term", term.site, term.over) for term in needed)
    model, unknown = hypotheses.only(named, causes(named)), hypotheses.only(named, needed)
    found = Conclusion(model, classes, doubts, alone, unknown, likely=tuple(instead))
    return found.named_beside_unknown(hypotheses) if doubts else found


def _unknown(hypotheses: HypothesisSet, mixed: Explanation, named: Explanation) -> float:
    """Probability of the model with smooth terms, as opposed to the one without."""
    priors = hypotheses.priors
    known = hypotheses.only(mixed, causes(mixed))
    modulation = all(hypotheses.modulates(smooth, named) for smooth in smooth_terms(mixed))
    doubt = (priors.modulation if modulation else priors.departure) * (mixed.log_evidence - known.log_evidence)
    ahead = hypotheses.log_posterior(mixed) - hypotheses.log_posterior(named) - doubt
    return float(expit(ahead / priors.heat(named.log_evidence)))


def _replacing(hypotheses: HypothesisSet, named: Explanation) -> tuple[SmoothTerm, ...]:
    """Smooth terms that are more probable than a cause and its whole class."""
    found = []
    for cause in causes(named):
        if hypotheses.smooth and sum(m.probability for m in contenders(hypotheses, named, cause)) < 0.5:
            found.append(ranked(hypotheses, named, cause).smooth[0][0])
    return tuple(dict.fromkeys(found))


def _without_lines(hypotheses: HypothesisSet, named: Explanation, cause: Hypothesis) -> Explanation | None:
    """The model with a smooth function of the actuator's own command in place of a periodic error.

    Beside this function, no line gains more than its prior odds cost. None if there is no such function.

    Several lines follow any local or rough error of a drive as a Fourier series, and often better than a smooth term, whose
    spectrum is another one. A gear's line is larger than its neighbours, and gains beside such a term as well.
    """
    own = (f"q{hypotheses.design.operating_points.robot.sites.index(cause.site) + 1}",)
    rest = without(hypotheses.groups, named, cause, sweeps=1)
    for term in (s for s in hypotheses.smooth if s.site == cause.site and s.over == own and s.motion != "aside"):
        model = tuned(hypotheses.groups, (*rest.terms, term), (*rest.scale, 1.0))
        if hypotheses.gains(model, (cause.template,))[cause.template].value < hypotheses.cost(cause.template):
            return model
    return None


def _apart(hypotheses: HypothesisSet, model: Explanation) -> tuple[Hypothesis, ...]:
    """Causes that gain more than twice the prior odds against them, and more than every smooth term that they can look like.

    What a smooth term leaves of an unknown motion is smaller than what it explains, and a cause may be no more than that.
    """
    costs, sure = hypotheses.costs(model.terms), []
    loss = {t: model.log_evidence - without(hypotheses.groups, model, t).log_evidence for t in model.terms}
    for cause in causes(model):
        like = [loss[term] for term in smooth_terms(model) if _alike(hypotheses, cause, (term,))]
        if loss[cause] > max(2.0 * costs[cause], *like, 0.0):
            sure.append(cause)
    return tuple(sure)


def _alike(hypotheses: HypothesisSet, cause: Hypothesis, smooth: Sequence[SmoothTerm]) -> bool:
    """Whether a cause can look like one of some smooth terms.

    Smooth terms vary too slowly to follow lines, so several lines of a joint can't be confused with them.
    """
    robot = hypotheses.design.operating_points.robot
    if cause.further and hypotheses.long:
        return False
    return any(alike(robot, cause, term) for term in smooth)


def without_redundant(hypotheses: HypothesisSet, named: Explanation) -> Explanation:
    """The model without causes that are not needed when an effect with a missing covariate replaces a stronger cause.

    A testable effect that looks like an effect with a missing covariate explains only a part of it, and a second effect may
    explain the rest. If the first cause may be the effect with the missing covariate, the second has nothing to explain. The
    same holds if the second may be that effect. The effect with the missing covariate is represented by its proxy.
    """
    strength = {c: named.log_evidence - without(hypotheses.groups, named, c).log_evidence for c in causes(named)}
    for cause in sorted(strength, key=lambda c: -strength[c]):
        if cause not in named.terms:
            continue
        unrecorded = {m.hypothesis.place for m in contenders(hypotheses, named, cause) if not m.recorded}
        for proxy in [proxy for proxy in hypotheses.proxies if proxy.hypothesis.place in unrecorded]:
            weaker = [c for c in causes(named) if strength[c] < strength[cause]]
            redundant = [
                c
                for c in weaker
                if proxy.hypothesis.place in {m.hypothesis.place for m in contenders(hypotheses, named, c)}
                or _redundant(hypotheses, named, cause, proxy, c)
            ]
            named = hypotheses.only(named, (t for t in named.terms if t not in redundant))
    return named


def _redundant(
    hypotheses: HypothesisSet, named: Explanation, cause: Hypothesis, proxy: Proxy, other: Hypothesis
) -> bool:
    """Whether ``other`` gains less than the prior odds against it when ``proxy`` takes the place of ``cause``."""
    rest = without(hypotheses.groups, named, cause)
    less = without(hypotheses.groups, rest, other)
    with_other = rest.log_evidence + hypotheses.gains(rest, (proxy,))[proxy].value
    alone = less.log_evidence + hypotheses.gains(less, (proxy,))[proxy].value
    return with_other - alone < hypotheses.costs(named.terms)[other]


SEEN = 1e-6
"""Smallest whitened motion by a drive, relative to the largest, of a row that shows the drive: it avoids a division by 0."""


def chance_lines(hypotheses: HypothesisSet, found: Conclusion) -> tuple[Hypothesis, ...]:
    """The periodic errors of a conclusion of which no line is significant against the scatter of its drive.

    A search compares a line with noise. Where an unknown error of a drive is larger than noise and has no period, many periods
    gain evidence, because each fits a part of it by chance. Here a line is compared with all that is left without it.
    """
    lines = [c for c in causes(found.model) if c.effect.of_own_command and c.effect.most_values > 1 and c.values]
    if not lines:
        return ()
    most = hypotheses.priors.chance_line
    return tuple(c for c in lines if FittedLines.of(hypotheses, found.model, c).chance() > most)


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
        shown = information > SEEN**2 * information.max()
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
