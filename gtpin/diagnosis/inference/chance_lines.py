"""Lines of periodic errors that the scatter of their drive alone would show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betaincc

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, HypothesisSet, causes, scales
from gtpin.diagnosis.inference.verdict import Conclusion
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
    model = found.whole(hypotheses)
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
    def of(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> FittedLines:
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
        # I - H of independent errors, H the fit's hat matrix, has tr (I - H)^2 degrees of freedom; this one has H's traces.
        hat = np.linalg.solve(normal, fitted.T @ fitted)
        same = np.unique(design.situation.q[shown], axis=0, return_inverse=True)[1].ravel()
        total = np.bincount(same, information)
        left = np.stack([np.bincount(same, column) for column in left.T], axis=1) / total[:, None]
        return FittedLines(
            errors=left[:, 0],
            variance=1.0 / total,
            lines=tuple(np.split(left[:, 1:], len(cause.values), axis=1)),
            tried=len(cause.effect.nonlinear_values(design.situation, cause.site)),
            taken=float(2.0 * np.trace(hat) - np.einsum("ij,ji->", hat, hat)),
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
