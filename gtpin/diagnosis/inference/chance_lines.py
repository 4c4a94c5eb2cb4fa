"""Lines of periodic errors that scatter alone would show: the best of many periods fits a part of any large error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import betaincc

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet, Model, causes
from gtpin.diagnosis.inference.reestimate_noise import left_over

Floats = npt.NDArray[np.float64]


def chance_lines(hypotheses: HypothesisSet, model: Model) -> tuple[Hypothesis, ...]:
    """The periodic errors of a model of which no line is significant against the scatter of its drive.

    A search compares a line with noise. Where an unknown error of a drive is larger than noise and has no period, many periods
    gain evidence, because each fits a part of it by chance. Here a line is compared with all that is left without it.
    """
    found = (c for c in causes(model) if c.effect.most_values > 1 and c.values)
    chance = hypotheses.priors.chance_line
    return tuple(c for c in found if DriveErrors.of(hypotheses, model, c).chance() > chance)


@dataclass(frozen=True)
class DriveErrors:
    """Errors along one drive, and the lines that were fitted to them.

    Parameters
    ----------
    errors
        (N,) whitened errors along the drive, from which the lines are not subtracted.
    lines
        For each line its (N, p) whitened displacements along the drive.
    rows
        Number of different commands of the drive.
    tried
        Number of periods that were tried.
    """

    errors: Floats
    lines: tuple[Floats, ...]
    rows: int
    tried: int

    @staticmethod
    def of(hypotheses: HypothesisSet, model: Model, cause: Hypothesis) -> DriveErrors:
        """The errors along the drive of a periodic error that the geometry and the rest of a model leave."""
        design, columns = hypotheses.design, hypotheses.groups.columns(cause)
        j, at = design.situation.robot.sites.index(cause.site), model.terms.index(cause)
        first = sum(model.widths[:at])
        fitted = columns @ model.mean[first : first + model.widths[at]]
        whole = left_over(hypotheses, model)[0] + fitted.reshape(-1, design.components)
        along = design.by_command[:, :, j]
        along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        own = np.einsum("nc,ncm->nm", along, columns.reshape(*along.shape, -1))
        return DriveErrors(
            errors=np.einsum("nc,nc->n", along, whole),
            lines=tuple(np.split(own, len(cause.values), axis=1)),
            rows=len(np.unique(design.situation.q[:, j])),
            tried=len(cause.effect.nonlinear_values(design.situation, cause.site)),
        )

    def chance(self) -> float:
        """Upper bound of the probability that scatter without a period shows a line as significant as the best one.

        The lines are fitted one after the other, the strongest first. Of Gaussian scatter with n degrees of freedom, p columns
        take a share of the power with a beta distribution, of parameters p/2 and (n - p)/2. The best of all periods that were
        tried takes a larger share than this with at most their number times the probability (Bonferroni), and so for the number
        of lines that were tested.
        """
        left, open_, least = self.errors, list(self.lines), 1.0
        freedom = float(self.rows)
        for tested in range(1, len(self.lines) + 1):
            fits = [left - X @ np.linalg.lstsq(X, left, rcond=None)[0] for X in open_]
            powers = [float(fit @ fit) for fit in fits]
            best = int(np.argmin(powers))
            width = open_.pop(best).shape[1]
            share = min(max(1.0 - powers[best] / max(float(left @ left), 1e-300), 0.0), 1.0)
            if freedom <= width:
                break
            single = float(betaincc(width / 2.0, (freedom - width) / 2.0, share))
            least = min(least, single * self.tried * tested)
            left, freedom = fits[best], freedom - width
        return least
