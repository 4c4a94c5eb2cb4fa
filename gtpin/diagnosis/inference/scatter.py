"""Scatter between visits, possibly caused by effects whose covariates were recorded but contradict each other."""

from __future__ import annotations

import re
from collections.abc import Iterable

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.inference.findings import Doubt
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.priors import Priors
from gtpin.effects.situation import Situation

_MOVES = re.compile(r"(approach|speed)[0-9]+")


def hidden_in_scatter(
    found: Conclusion, scatter: float, untestable: Iterable[Hypothesis], at: Situation, priors: Priors
) -> tuple[Hypothesis, ...]:
    """Effects of direction or speed whose columns were recorded, but left out because they contradict each other.

    Where no cause was found and the scatter is large relative to the instrument's noise, such an effect may cause the
    scatter. The verdict ``none`` would say that it was tested.

    Parameters
    ----------
    scatter
        Ratio of the drives' repeatability to the instrument's noise.
    """
    if found.verdict != "none" or scatter <= priors.scatters:
        return ()
    return tuple(
        hypothesis
        for hypothesis in untestable
        if any(_MOVES.fullmatch(name) and name in at.unusable for name in hypothesis.covariates(at.robot))
    )


def with_scatter(found: Conclusion, hidden: tuple[Hypothesis, ...]) -> Conclusion:
    """The conclusion, with a doubt where there are effects ``hidden`` that may cause the scatter."""
    return found.doubted(Doubt("scatter", hidden[0].site)) if hidden else found
