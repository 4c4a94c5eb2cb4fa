"""The third step of a diagnosis: from hypotheses to a conclusion."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betaincc

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet, Model, causes, scales
from gtpin.diagnosis.inference.named_causes import decide, with_restless
from gtpin.diagnosis.inference.reestimate_noise import reestimate_noise, restless_drive
from gtpin.diagnosis.inference.settle import Settled
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.posterior import NOTHING
from gtpin.typing import Floats

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
    model = found.model
    if found.beside:
        model = hypotheses.of((*model.terms, *found.beside), (*model.scale, *(1.0 for _ in found.beside)))
    return tuple(c for c in lines if FittedLines.of(hypotheses, model, c).chance() > hypotheses.priors.chance_line)


@dataclass(frozen=True)
class FittedLines:
    """Errors of one drive at its different commands, and the lines that were fitted to them.

    ``errors``, ``variance``: (n,) errors that the geometry and the other causes leave, m or rad: the mean of the visits of a
    command; and their variance by the noise. ``lines``: for each line its (n, p) deviations of the travel less what the
    geometry and the other causes fit of them, m or rad. ``tried``: number of periods that were tried. ``taken``: Effective
    number of the errors that the geometry and the other causes fit: this many are missing in what is left.
    """

    errors: Floats
    variance: Floats
    lines: tuple[Floats, ...]
    tried: int
    taken: float = 0.0

    @staticmethod
    def of(hypotheses: HypothesisSet, model: Model, cause: Hypothesis) -> FittedLines:
        """The errors of a drive that the geometry and a model without one periodic error leave, and the lines of this error.

        What the geometry and the other causes fit of the lines is subtracted. Flexible causes of the drive fit scatter, too;
        without the subtraction, less scatter would be left, and the lines would look significant.
        """
        design = hypotheses.design
        along = design.by_command[:, :, design.situation.robot.sites.index(cause.site)]
        information = np.einsum("nc,nc->n", along, along)
        shown = information > SEEN**2 * information.max()
        along, information = along[shown], information[shown]

        def moved(columns: Floats) -> Floats:
            return np.asarray(np.einsum("nc,ncm->nm", along, columns.reshape(len(shown), design.components, -1)[shown]))

        others = np.hstack(
            [design.B, *(hypotheses.groups.columns(t) * s for t, s in scales(model).items() if t != cause)]
        )
        prior = np.concatenate([design.prior, np.ones(others.shape[1] - len(design.prior))])
        normal = others.T @ others + np.diag(prior)
        whole = np.column_stack([design.y, hypotheses.groups.columns(cause)])
        left = moved(whole - others @ np.linalg.solve(normal, others.T @ whole))
        fitted = moved(others) / np.sqrt(information)[:, None]
        same = np.unique(design.situation.q[shown], axis=0, return_inverse=True)[1].ravel()
        total = np.bincount(same, information)
        left = np.stack([np.bincount(same, column) for column in left.T], axis=1) / total[:, None]
        return FittedLines(
            errors=left[:, 0],
            variance=1.0 / total,
            lines=tuple(np.split(left[:, 1:], len(cause.values), axis=1)),
            tried=len(cause.effect.nonlinear_values(design.situation, cause.site)),
            taken=_taken(np.linalg.solve(normal, fitted.T @ fitted)),
        )

    def chance(self) -> float:
        """Upper bound of the probability that scatter without a period shows a line as significant as the best one.

        The lines are fitted one after the other, the strongest first; what is left without the line is noise of known variance
        and scatter of the drive, whose variance is estimated. Of n such errors, less those that other causes fit, p columns
        take a share of the power with a beta distribution, of parameters p/2 and (n - p)/2. The best of all periods that were
        tried takes a larger share than this with at most their number times the probability (Bonferroni). The k-th test of a
        line has the share 1 / (k (k + 1)) of the whole probability.
        """
        left, open_, least = self.errors, list(self.lines), 1.0
        freedom = len(self.errors) - self.taken
        for tested in range(1, len(self.lines) + 1):
            if freedom <= 1.0:
                break
            scatter = max(float((left**2).sum()) / freedom - float(self.variance.mean()), 0.0)
            root = 1.0 / np.sqrt(self.variance + scatter)
            whole = float(((left * root) ** 2).sum())
            fits = [X @ np.linalg.lstsq(X * root[:, None], left * root, rcond=None)[0] for X in open_]
            powers = [float((((left - fit) * root) ** 2).sum()) for fit in fits]
            best = int(np.argmin(powers))
            width = open_.pop(best).shape[1]
            if freedom <= width + 1.0 or whole == 0.0:
                break
            share = min(max(1.0 - powers[best] / whole, 0.0), 1.0)
            least = min(
                least, float(betaincc(width / 2.0, (freedom - width) / 2.0, share)) * self.tried * tested * (tested + 1)
            )
            left, freedom = left - fits[best], freedom - width
        return least


def _taken(hat: Floats) -> float:
    """Number of a drive's independent errors that a fit with this hat matrix H takes: 2 tr H - tr H^2.

    I - H of independent errors has tr (I - H)^2 degrees of freedom. ``hat`` is a matrix with the same traces.
    """
    return float(2.0 * np.trace(hat) - np.einsum("ij,ji->", hat, hat))


def infer(settled: Settled, barred: Collection[tuple[str, str]] = ()) -> Conclusion:
    """Search, compare named causes with smooth terms, and look for an actuator whose errors change too fast for these terms.

    ``barred``: effects and sites that cannot be causes.
    """
    hypotheses = settled.hypotheses
    found, scattered = _without_chance_lines(settled, barred)
    if found.doubts:
        return found
    site = restless_drive(hypotheses, found.model, scattered) if scattered else None
    if site is None:
        site = reestimate_noise(settled.observed, hypotheses, found.model).restless
    return found if site is None else with_restless(hypotheses, found, site)


def _without_chance_lines(settled: Settled, barred: Collection[tuple[str, str]]) -> tuple[Conclusion, tuple[str, ...]]:
    """The conclusion of a search without periodic errors that scatter alone would show, and the sites of these."""
    hypotheses, scattered = settled.hypotheses, set[tuple[str, str]]()
    found = _decided(settled, {*barred})
    while chance := chance_lines(hypotheses, found):
        scattered |= {cause.place for cause in chance}
        found = _decided(settled, {*barred, *scattered})
    alone = hypotheses.gains(NOTHING, hypotheses.every)
    return replace(found, alone=alone), tuple(sorted({site for _, site in scattered}))


def _decided(settled: Settled, barred: Collection[tuple[str, str]]) -> Conclusion:
    if not barred:
        return decide(settled.hypotheses, settled.guess)
    allowed, guess = settled.hypotheses.barring(barred), settled.guess
    return decide(allowed, allowed.only(guess, [t for t in guess.terms if getattr(t, "place", None) not in barred]))
