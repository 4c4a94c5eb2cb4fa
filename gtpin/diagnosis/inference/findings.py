"""The findings of a diagnosis as plain values: causes with their classes, hypotheses considered, questions, what is
unexplained."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis, alike
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, Gain, HypothesisSet, Term, scales
from gtpin.diagnosis.linear.posterior import NOTHING, fixed, without
from gtpin.diagnosis.priors import SURE, UNDECIDED
from gtpin.effects.effect import Nature
from gtpin.effects.untestable import Untestable
from gtpin.errors import renamed
from gtpin.estimate import Estimate

Verdict = Literal["none", "explained", "ambiguous", "unknown"]


@dataclass(frozen=True)
class Member:
    """An effect at a site that could be the cause, with its probability.

    ``recorded`` is False where its covariate is missing and only a proxy of it supports the effect. ``beside`` is the effect
    and site of another member, where only both together could be in the place of the cause; each then has half of the
    probability of both. ``parameters``: its parameters in the place of the cause; empty where a proxy or a pair is meant.
    """

    effect: str
    site: str
    probability: float
    recorded: bool = True
    beside: tuple[str, str] | None = None
    parameters: Mapping[str, Estimate] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class Cause:
    """A cause, and everything that could be the cause in its place.

    Parameters
    ----------
    effect, site, probability
        The leader of the class, and its probability.
    members
        The class: the leader and every hypothesis with at least 5 % of its probability. An effect with a missing covariate is
        one of them where a proxy supports it.
    parameters
        The parameters of the leader, by name.
    explained_fraction
        Explained fraction of the gap's power, given the other causes.
    nature
        The nature of the leader's effect: :attr:`gtpin.effects.effect.Effect.nature`.
    """

    effect: str
    site: str
    probability: float
    members: tuple[Member, ...]
    parameters: dict[str, Estimate]
    explained_fraction: float
    nature: Nature = "mechanism"
    shrinkage = renamed("shrinkage", "explained_fraction")


@dataclass(frozen=True)
class Undecided:
    """What is weak and undecided: the site of the leader of its class, the size at the TCP (root mean square, m), the class."""

    site: str
    rms: float
    members: tuple[Member, ...]


@dataclass(frozen=True)
class FlexibleFamily:
    """A flexible family that fits, but is no cause: it says where the error is and over what, not why.

    ``rms`` is its root mean square at the TCP, m, and ``probability`` that of the family among all hypotheses.
    """

    effect: str
    site: str
    over: tuple[str, ...]
    rms: float
    probability: float


@dataclass(frozen=True)
class Considered:
    """A hypothesis that was considered.

    Parameters
    ----------
    effect, site
        The hypothesis.
    log_evidence
        Its gain in log evidence, nats.
    probability
        Its probability as a member of the class of a cause; 0 where it is in none. An untestable effect has one where a proxy
        supports it.
    testable
        Whether these data can test it.
    reason
        Of an untestable effect: why it is untestable. Of a testable one: why it could be the cause although its test did not
        show it (a payload that was not recorded); else None.
    """

    effect: str
    site: str
    log_evidence: float
    probability: float
    testable: bool
    reason: Untestable | None


@dataclass(frozen=True)
class Question:
    """A parameter of a cause whose value is outside the range that its effect states as plausible or usual.

    ``effect``, ``site``, ``parameter``: the parameter. ``value``, ``sigma``, ``unit``: its estimate. ``low``, ``high``: the
    range, in ``unit``. ``why``: the reason for this range. ``believed``: whether the cause is named in spite of it.
    """

    effect: str
    site: str
    parameter: str
    value: float
    sigma: float
    unit: str
    low: float
    high: float
    why: str
    believed: bool


class Correlate(NamedTuple):
    """A smooth term that correlates with what the causes leave.

    ``site`` and ``coordinates`` of the term; its p-value under noise alone; its kind of motion, as in `SmoothTerm`; its
    probability relative to that of the best one.
    """

    site: str
    coordinates: str
    p_value: float
    motion: str
    odds: float


@dataclass(frozen=True)
class Unexplained:
    """What is left after the causes.

    ``share``: Chi-square beyond its expected value, divided by the same quantity with the geometry alone; 0 to 1. ``p_value``:
    probability that noise alone gives a larger chi-square. ``correlates``: the smooth terms that correlate with the residuals,
    the largest gain in log evidence first, one of each site over the same coordinates; five at most. ``could_be``: effect and
    site of effects that could be the unknown: likely causes that these data do not tell from it, then untestable effects whose
    proxies explain the residuals about as well as the best smooth term, then those at its site that have no proxy.
    ``descriptions``: flexible families that explain a part of them and are no causes.
    """

    share: float
    p_value: float
    correlates: tuple[Correlate, ...]
    could_be: tuple[tuple[str, str], ...] = ()
    descriptions: tuple[FlexibleFamily, ...] = ()


Reason = Literal[
    "smooth_term",
    "description",
    "restless",
    "impossible",
    "held_out",
    "part",
    "excess",
    "visits",
    "two_groups",
    "two_valued",
    "scatter",
    "chi_square",
]
"""Why something unknown is inferred:

``smooth_term``
    Smooth nonparametric terms are likelier than the named causes alone (``infer.py``).
``description``
    Only a flexible family explains an error (``descriptions.py``).
``restless``
    Errors of an actuator differ from pose to pose by more than repeated visits scatter (``reestimate_noise.py``).
``impossible``
    A cause would need a parameter that physics does not allow (``questions.py``).
``held_out``
    Residuals or errors on left-out poses are larger than the noise that repeated visits show (``fit.py``), or the
    errors are no smaller with the causes than without (``predictive.py``).
``part``
    Residuals of one part of an instrument (a station, a plane, a socket, a component) are larger than the noise (``fit.py``).
``excess``
    The residuals are larger than the declared noise, and no visits tell whether the difference repeats (``fit.py``).
``visits``
    Visits to the same commands differ by more than the declared noise and the drives' repeatability (``shown_noise.py``).
``two_groups``
    What looks like noise comes from two groups of rows (``suspicious_data.py``).
``two_valued``
    What looks like scatter of a drive has two values (``suspicious_data.py``).
``scatter``
    Visits scatter, and columns that could show the reason contradict each other (``suspicious_data.py``).
``chi_square``
    Poses of a check are farther from the earlier model than noise and its uncertainty allow (``against/check.py``).
"""


@dataclass(frozen=True)
class Doubt:
    """A reason for which something unknown is assumed.

    ``site`` and ``over``: the site at which it acts, or the part of an instrument that shows it, and the coordinates that it
    depends on; empty where not known.
    """

    reason: Reason
    site: str = ""
    over: tuple[str, ...] = ()


@dataclass(frozen=True)
class Smallest:
    """The smallest change of an effect at a site that a check finds with a given power.

    Parameters
    ----------
    effect, site
        The effect that changes, and its site.
    parameter, value, unit
        The size of the change, as the effect's first parameter. Where the effect has several coefficients: the median over
        changes of random shape. ``value`` is None where not even 1,000 times the typical size is found.
    """

    effect: str
    site: str
    parameter: str
    value: float | None
    unit: str


@dataclass(frozen=True)
class Contender:
    """A hypothesis that could be the cause, with its probability.

    ``hypothesis``, ``probability``: the hypothesis, and how probable it is. ``recorded``: false where only a proxy shows it.
    ``beside``: another hypothesis, where only both together could be in the place of the cause.
    """

    hypothesis: Hypothesis
    probability: float
    recorded: bool = True
    beside: Hypothesis | None = None


@dataclass(frozen=True)
class Conclusion:
    """The conclusion from the evidence: causes, their classes, and doubts.

    ``model``: the causes that are named. ``classes``: for each cause its class with the cause itself, the most probable member
    first. ``doubts``: reasons for which something unknown is assumed in addition to the causes. ``alone``: gain in log evidence
    of every hypothesis and smooth term as the only one. ``beside``: the smooth terms that are needed beside the causes.
    ``also``: those causes that are weak and undecided: they do not change the verdict. ``descriptions``: flexible families that
    fit and are no causes. ``mechanisms``: places of the causes that are such families, but have a mechanism's form.
    ``likely``: places of likely causes that are not named, because they could be the unknown themselves.
    """

    model: Explanation
    classes: Mapping[Hypothesis, tuple[Contender, ...]]
    doubts: tuple[Doubt, ...]
    alone: Mapping[Term, Gain]
    beside: Explanation = NOTHING
    also: tuple[Hypothesis, ...] = ()
    descriptions: tuple[FlexibleFamily, ...] = ()
    mechanisms: frozenset[tuple[str, str]] = frozenset()
    likely: tuple[tuple[str, str], ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The verdict: the first of ``unknown``, ``ambiguous``, ``explained`` and ``none`` that applies."""
        if self.doubts:
            return "unknown"
        if len(self.sure()) < len(self.classes) - len(self.also):
            return "ambiguous"
        return "explained" if self.classes else "none"

    @property
    def scale(self) -> Mapping[Term, float]:
        """Scale of each cause: its size over the typical size."""
        return scales(self.model)

    def whole(self, hypotheses: HypothesisSet) -> Explanation:
        """The model of the causes with the smooth terms beside them."""
        model, beside = self.model, self.beside
        if not beside.terms:
            return model
        return fixed(hypotheses.groups, (*model.terms, *beside.terms), (*model.scale, *beside.scale))

    def doubted(self, *doubts: Doubt) -> Conclusion:
        """The conclusion with further doubts."""
        return replace(self, doubts=(*self.doubts, *doubts))

    def bounded(self, causes: Collection[Hypothesis], most: float) -> Conclusion:
        """The conclusion with a largest probability of the members of some causes' classes."""
        classes = dict(self.classes)
        for cause in causes:
            share = min(most / classes[cause][0].probability, 1.0)
            classes[cause] = tuple(replace(m, probability=share * m.probability) for m in classes[cause])
        return replace(self, classes=classes)

    def only(self, hypotheses: HypothesisSet, causes: list[Hypothesis]) -> Conclusion:
        """The conclusion with only some of its causes."""
        classes = {cause: self.classes[cause] for cause in causes}
        return replace(self, model=hypotheses.only(self.model, causes), classes=classes)

    def named_beside_unknown(self, hypotheses: HypothesisSet) -> Conclusion:
        """The conclusion with only the causes that stand beside something unknown, and with what is weak and undecided.

        What is not sure may be a part of the unknown. A cause that gains less than it, and that a member of its class could
        look like, may be no more than what that member leaves of the unknown. Of the others, the leader of a class is likely
        where it has 0.5 or more.
        """
        robot, model, groups = hypotheses.design.operating_points.robot, self.whole(hypotheses), hypotheses.groups
        loss = {cause: model.log_evidence - without(groups, model, cause).log_evidence for cause in self.classes}
        beside, sure = {*self.beside_unknown(), *self.also}, self.sure()
        open_ = [cause for cause in self.classes if cause not in sure]

        def within(cause: Hypothesis, other: Hypothesis) -> bool:
            members = (m.hypothesis for m in self.classes[other])
            return loss[cause] < loss[other] and any(alike(robot, cause, member) for member in members)

        kept = [c for c in self.classes if c in beside and not any(within(c, other) for other in open_)]
        leaders = [members[0] for cause, members in self.classes.items() if cause not in kept]
        if not leaders:
            return self
        likely = (m.hypothesis.place for m in leaders if m.probability >= UNDECIDED)
        return replace(self.only(hypotheses, kept), likely=(*self.likely, *likely))

    def nature(self, cause: Hypothesis) -> Nature:
        """The nature of a cause: a flexible family is a mechanism only where its form was found to be one."""
        return "mechanism" if cause.place in self.mechanisms else cause.effect.nature

    def members(self, cause: Hypothesis) -> tuple[Member, ...]:
        """The class of a cause, as it is reported."""
        return tuple(
            Member(*m.hypothesis.place, m.probability, m.recorded, m.beside.place if m.beside else None)
            for m in self.classes[cause]
        )

    def sure(self) -> list[Hypothesis]:
        """Causes that lead their class with a probability of 0.95 or more."""
        return [
            cause
            for cause, members in self.classes.items()
            if members[0].hypothesis.place == cause.place and members[0].probability >= SURE
        ]

    def beside_unknown(self) -> list[Hypothesis]:
        """Causes that stand beside something unknown: they lead their class with 0.5 or more."""
        return [
            cause
            for cause, members in self.classes.items()
            if members[0].hypothesis.place == cause.place and members[0].probability >= UNDECIDED
        ]


def considered(
    hypotheses: HypothesisSet, found: Conclusion, could_be: Collection[tuple[str, str]] = ()
) -> tuple[Considered, ...]:
    """All hypotheses that were tested, the largest gain in log evidence first, then those that could not be tested."""
    members = [m for contenders in found.classes.values() for m in contenders]
    probability = {m.hypothesis.place: m.probability for m in members}
    asked = {m.hypothesis.place for m in members if not m.recorded} | set(could_be)
    reason = {p.hypothesis.place: p.reason for p in hypotheses.proxies if p.hypothesis.place in asked}
    tested = [
        Considered(*h.place, found.alone[h].value, probability.get(h.place, 0.0), True, reason.get(h.place))
        for h in hypotheses.named
    ]
    others = [
        Considered(*u.hypothesis.place, 0.0, probability.get(u.hypothesis.place, 0.0), False, u.reason)
        for u in hypotheses.untested
    ]
    return (*sorted(tested, key=lambda row: -row.log_evidence), *others)
