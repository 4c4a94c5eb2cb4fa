"""The verdict: every reason for which it is ``unknown``, and what it is without one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import Gain, HypothesisSet, Model, Term, scales
from gtpin.diagnosis.inference.findings import Verdict
from gtpin.diagnosis.priors import SURE

Reason = Literal["smooth_term", "restless", "impossible", "held_out", "two_groups", "two_valued", "scatter"]
"""Why something unknown is inferred:

``smooth_term``
    Smooth nonparametric terms are likelier than the named causes alone (``decide.py``).
``restless``
    An actuator errs from pose to pose more than repeated visits let it scatter (``noise.py``).
``impossible``
    A cause would need a parameter that physics does not allow (``questions.py``).
``held_out``
    Left-out poses are much farther off than noise (``held_out.py``).
``two_groups``
    What passes for noise are two groups of rows (``two_groups.py``).
``two_valued``
    What passes for scatter of a drive takes two values (``two_valued.py``).
``scatter``
    Visits scatter, and the columns that would tell why contradict each other (``scatter.py``).
"""


@dataclass(frozen=True)
class Doubt:
    """A reason for which something unknown is inferred; ``site`` and ``over``, its coordinates, where they are known."""

    reason: Reason
    site: str = ""
    over: tuple[str, ...] = ()


@dataclass(frozen=True)
class Contender:
    """A hypothesis that could be the cause; ``recorded`` is false where only a proxy of its covariate shows it."""

    hypothesis: Hypothesis
    probability: float
    recorded: bool = True


@dataclass(frozen=True)
class Conclusion:
    """What is concluded from the evidence.

    Parameters
    ----------
    model
        The causes that are named.
    classes
        Of each cause: itself and what could be the cause in its place, the likeliest first.
    doubts
        Why something unknown is inferred in addition to the causes.
    alone
        Gain in log evidence of every explanation by itself.
    """

    model: Model
    classes: Mapping[Hypothesis, tuple[Contender, ...]]
    doubts: tuple[Doubt, ...]
    alone: Mapping[Term, Gain]

    @property
    def verdict(self) -> Verdict:
        """``unknown`` before ``ambiguous`` before ``explained`` before ``none``: the first that applies."""
        if self.doubts:
            return "unknown"
        if any(members[0].probability < SURE for members in self.classes.values()):
            return "ambiguous"
        return "explained" if self.classes else "none"

    @property
    def scale(self) -> Mapping[Term, float]:
        """Of each cause, over its typical size."""
        return scales(self.model)

    def doubted(self, *doubts: Doubt) -> Conclusion:
        """The same with further doubts."""
        return replace(self, doubts=(*self.doubts, *doubts))

    def only(self, hypotheses: HypothesisSet, causes: list[Hypothesis]) -> Conclusion:
        """The same with some of its causes."""
        classes = {cause: self.classes[cause] for cause in causes}
        return replace(self, model=hypotheses.only(self.model, causes), classes=classes)

    def sure(self) -> list[Hypothesis]:
        """Causes that stand alone."""
        return [cause for cause, members in self.classes.items() if members[0].probability >= SURE]
