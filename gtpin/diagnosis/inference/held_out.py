"""A conclusion compared with the errors on left-out poses."""

from __future__ import annotations

from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Doubt
from gtpin.diagnosis.inference.unexplained import marginal_chance
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.cross_validation import Gap


def held_out(found: Conclusion, hypotheses: HypothesisSet, whole: Gap) -> Conclusion:
    """The conclusion, with a doubt where errors on left-out poses are much larger than the noise floor.

    Parameters
    ----------
    whole
        The gap on left-out poses with all causes.
    """
    if found.doubts:
        return found
    most = hypotheses.priors.silent if found.verdict == "none" else hypotheses.priors.named
    if whole.after > most * whole.floor and marginal_chance(hypotheses, found.model) <= hypotheses.priors.chance:
        return found.doubted(Doubt("held_out"))
    return found
