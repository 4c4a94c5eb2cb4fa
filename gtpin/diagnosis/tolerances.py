"""Whether a part is farther from nominal than its tolerance, or a cause explains what looks like it.

A calibration knows no effects. Where one acts that the geometry can follow, parameters move beyond their tolerances, and these
are widened: joints of a soft rod by 70 mm, the zero of a joint whose axis wobbles by 2.5 degrees. The effect is then a part of
the geometry, and no cause. Both explanations are compared by their log marginal likelihood, of the same rows and noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.limits import CONFLICT
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.evidence import Posterior
from gtpin.diagnosis.gap import blocks_of, leave_out
from gtpin.diagnosis.hypothesis import Scope, Term
from gtpin.diagnosis.noise import SearchState
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.search import HypothesisSet, rough_guess, smooth_of


def explained_within(within: Prepared, settled: SearchState, scope: Scope) -> bool:
    """Whether causes and a geometry ``within`` its tolerances explain the rows of a search as well as the wider ones with which
    it has ``settled``: with a log marginal likelihood that is lower by `CONFLICT` at most.

    Where smooth terms are needed too, which the model that users get does not have, the geometry within its tolerances must
    also predict poses that are left out as well.
    """
    seen = Observed.of(settled.searched, within.baseline)
    seen = replace(seen, noise=settled.observed.noise, weight=settled.observed.weight)
    design = seen.design(within.baseline.model)
    hypotheses = propose(design, scope)
    found = rough_guess(hypotheses, settled.guess)
    if _log_likelihood(hypotheses, found) + CONFLICT < _log_likelihood(settled.hypotheses, settled.guess):
        return False
    return not smooth_of(found) or _left_out(design, settled) <= _left_out(settled.hypotheses.design, settled)


def _log_likelihood(hypotheses: HypothesisSet, model: Posterior[Term]) -> float:
    """Log marginal likelihood of the rows with the geometry and a model's terms, less the costs of these, nats."""
    volume = float(np.linalg.slogdet(hypotheses.design.whitening)[1].sum())
    return volume + hypotheses.groups.log_evidence + hypotheses.log_posterior(model)


def _left_out(design: Design, settled: SearchState) -> float:
    """Sum of squares of the errors of the geometry alone at poses of regions that are left out, m^2."""
    blocks = blocks_of(settled.searched, "region", np.random.default_rng(0))
    return float((leave_out(design, np.zeros((len(design.y), 0)), blocks).errors ** 2).sum())
