"""Scatter between visits that effects may cause whose covariates were recorded, but contradict each other."""

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
    """Effects that differ between visits, and lack columns that were recorded but contradict the others.

    Where nothing was found and visits scatter by more than the instrument, that scatter is as likely theirs as the drives':
    ``none`` would say that they were tested.

    Parameters
    ----------
    scatter
        Of the drives, over the instrument's noise.
    """
    if found.verdict != "none" or scatter <= priors.scatters:
        return ()
    return tuple(
        hypothesis
        for hypothesis in untestable
        if any(_MOVES.fullmatch(name) and name in at.unusable for name in hypothesis.covariates(at.robot))
    )


def with_scatter(found: Conclusion, hidden: tuple[Hypothesis, ...]) -> Conclusion:
    """The conclusion; doubted where effects may hide in scatter."""
    return found.doubted(Doubt("scatter", hidden[0].site)) if hidden else found
