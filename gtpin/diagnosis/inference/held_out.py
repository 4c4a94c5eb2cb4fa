"""A conclusion compared with the errors on left-out poses."""

from __future__ import annotations

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Doubt
from gtpin.diagnosis.inference.shown_noise import ShownNoise, floor_of
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.cross_validation import Gap
from gtpin.diagnosis.linear.observed import Observed
from gtpin.noise.repeats import LEAST_CONTRASTS


def held_out(
    found: Conclusion, hypotheses: HypothesisSet, whole: Gap, observed: Observed, shown: ShownNoise
) -> Conclusion:
    """The conclusion, with a doubt where residuals and errors on left-out poses are larger than noise.

    Noise is what was declared or what repeated visits show. Nothing can exceed noise that is assumed from the residuals.

    Parameters
    ----------
    whole
        The gap on left-out poses with all causes.
    """
    if found.doubts or shown.source == "residuals":
        return found
    priors, silent = hypotheses.priors, found.verdict == "none"
    if silent and shown.contradicted:
        return found.doubted(Doubt("visits"))
    size, chance = shown.excess(observed, hypotheses, found.model)
    allowed = float(np.sqrt(floor_of(shown.most, hypotheses.design).mean() / shown.floor(hypotheses.design).mean()))
    far = whole.after > (priors.silent if silent else priors.named) * allowed * whole.floor
    if chance <= priors.chance and (far or (silent and size > priors.excess)):
        return found.doubted(Doubt("excess" if shown.visits < LEAST_CONTRASTS else "held_out"))
    return found
