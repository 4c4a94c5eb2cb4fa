"""The limit of naming several causes: a rival that knows the true displacements, and enumerates all pairs.

Its linear model is that of a diagnosis (docs/statistics.md, sections 3 to 7), of all rows, with the noise that the diagnosis
estimates: y ~ N(0, I + B B' + sum over k of s_k^2 X_k X_k'). A hypothesis is an effect at a site. X of a true one is a single
column, its true displacement divided by its true amplitude: the rival knows its shape, and its amplitude has the prior of a
scale. X of any other is the basis of the diagnosis. Its nonlinear parameter has the values that explain most alone and given
each of the true effects; its evidence is reduced because many values were tried.

The rival compares the model without effects, all single hypotheses, all pairs, and the best pairs with one more.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, Literal, NamedTuple, TypeVar

import numpy as np

from gtpin.bench.blind.judged import Named, Statement
from gtpin.bench.blind.truth import Truth
from gtpin.data import Dataset
from gtpin.diagnosis.design import Observed
from gtpin.diagnosis.diagnose import FALSE_ALARM
from gtpin.diagnosis.evidence import NOTHING, Groups, Posterior, all_gains, tuned
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.noise import searchable_rows, settle
from gtpin.diagnosis.prepare import prepare
from gtpin.diagnosis.propose import propose
from gtpin.diagnosis.scan import Scan
from gtpin.effects.catalogue import catalogue, effects_by_id
from gtpin.effects.displacement import Displacement
from gtpin.model.measured_robot import measuring, robot_of
from gtpin.typing import Floats

K = TypeVar("K", bound=Hashable)
Odds = Literal["diagnosis", "flat"]
"""Prior odds: those of a diagnosis, or the same log odds against every cause, whatever else is in the model."""

CLASS_NATS = 3.0
"""Change of the log evidence below which a hypothesis in the place of a cause belongs to its class. Assumed: odds of 20."""
TUNED = 50
"""Number of pairs whose scales are estimated together: those of largest worth with scales estimated one after the other."""
WIDENED = 20
"""Number of pairs, those of largest worth, to which one more hypothesis is added."""


class Larger(NamedTuple, Generic[K]):
    """A model with one more group: its log evidence with the model's scales unchanged, the model, the group, and its scale."""

    log_evidence: float
    model: Posterior[K]
    term: K
    scale: float

    @property
    def terms(self) -> tuple[K, ...]:
        """All its groups."""
        return (*self.model.terms, self.term)


@dataclass(frozen=True)
class Enumeration(Generic[K]):
    """The most probable set of at most three groups, by enumeration.

    Parameters
    ----------
    groups
        Displacements of all hypotheses, and their inner products.
    terms
        The hypotheses.
    place
        Effect and site of each: a set has each of them once.
    """

    groups: Groups[K]
    terms: Sequence[K]
    place: Callable[[K], Hashable]

    @cached_property
    def singles(self) -> dict[K, Posterior[K]]:
        """The models of one hypothesis."""
        return {term: tuned(self.groups, (term,), (1.0,)) for term in self.terms}

    @cached_property
    def pairs(self) -> list[Larger[K]]:
        """All models of two hypotheses."""
        return self._larger(self.singles.values())

    def best(self, cost: Callable[[Sequence[K]], float]) -> Posterior[K]:
        """The set with the largest log evidence less ``cost`` of its members; the empty set where every other one has less."""

        def log_posterior(model: Posterior[K] | Larger[K]) -> float:
            return model.log_evidence - cost(model.terms)

        def best_of(some: Sequence[Larger[K]]) -> list[Posterior[K]]:
            first = sorted(some, key=log_posterior, reverse=True)[:TUNED]
            models = [tuned(self.groups, one.terms, (*one.model.scale, one.scale)) for one in first]
            return sorted(models, key=log_posterior, reverse=True)

        pairs = best_of(self.pairs)
        threes = best_of(self._larger(pairs[:WIDENED]))
        return max([NOTHING, *self.singles.values(), *pairs, *threes], key=log_posterior)

    def _larger(self, models: Iterable[Posterior[K]]) -> list[Larger[K]]:
        """Each of the models with each further hypothesis. Of two with the same set of hypotheses, only the better is kept."""
        found: dict[frozenset[K], Larger[K]] = {}
        for model in models:
            for term, (gain, scale) in all_gains(self.groups, model, self._others(model.terms)).items():
                one = Larger(model.log_evidence + gain, model, term, scale)
                known = found.setdefault(frozenset(one.terms), one)
                if known.log_evidence < one.log_evidence:
                    found[frozenset(one.terms)] = one
        return list(found.values())

    def _others(self, terms: Sequence[K]) -> list[K]:
        """Hypotheses whose place is not that of one of ``terms``."""
        taken = {self.place(term) for term in terms}
        return [term for term in self.terms if self.place(term) not in taken]

    def members(self, model: Posterior[K], cause: K) -> dict[K, float]:
        """The class of one of a model's hypotheses: what could be in its place, and how much that changes the log evidence."""
        kept = [(t, s) for t, s in zip(model.terms, model.scale, strict=True) if t != cause]
        terms, scale = tuple(t for t, _ in kept), tuple(s for _, s in kept)
        models = {t: tuned(self.groups, (*terms, t), (*scale, 1.0)) for t in self._others(terms)}
        changes = {term: other.log_evidence - model.log_evidence for term, other in models.items()}
        return {term: change for term, change in changes.items() if term == cause or change > -CLASS_NATS}


@dataclass(frozen=True)
class Limit:
    """The rival on one dataset.

    Parameters
    ----------
    hypotheses
        Those of a diagnosis of the dataset.
    forms
        (m, 1) whitened displacement of each true effect at its typical size; empty: the rival knows none, and every hypothesis
        has the basis of the diagnosis.
    """

    hypotheses: HypothesisSet
    forms: Mapping[Hypothesis, Floats]

    @staticmethod
    def of(dataset: Dataset, truth: Truth) -> Limit:
        """For a tracker's dataset and a truth with displacements; effects that are not in the catalogue are left out.

        Rows that a diagnosis sets aside as gross errors are used, because an effect may show in them alone. So the dataset must
        have no real gross errors.
        """
        robot = measuring(robot_of(dataset), dataset)
        scope = Scope.of(catalogue(), (), FALSE_ALARM, robot)
        prepared = prepare(dataset, robot)
        admitted = searchable_rows(prepared, scope.priors)
        noise = settle(prepared, admitted, scope, np.random.default_rng(0)).observed.noise
        everything = Observed.of(prepared.dataset, prepared.baseline)
        everything = replace(everything, noise=everything.noise.sized_as(noise))
        hypotheses = propose(everything.design(prepared.baseline.model), scope)
        place = {int(row): i for i, row in enumerate(dataset.row)}
        rows = [place[int(row)] for row in prepared.dataset.row]
        known, forms = effects_by_id(), {}
        for true in truth.effects:
            if true.effect in known and true.displacement is not None:
                column = np.array(true.displacement)[rows, :, None] / (true.amplitude or 1.0)
                forms[Hypothesis(known[true.effect], true.site)] = hypotheses.design.columns(
                    Displacement(np.ones(1), twist=column)
                )
        return Limit(hypotheses, forms)

    def without_forms(self) -> Limit:
        """The rival without the true displacements: it has the basis of the diagnosis for every hypothesis."""
        return Limit(self.hypotheses, {})

    @cached_property
    def every(self) -> Enumeration[Hypothesis]:
        """The enumeration of all hypotheses."""
        return Enumeration(self._prepared[0], tuple(self._prepared[1]), lambda term: term.place)

    @cached_property
    def _prepared(self) -> tuple[Groups[Hypothesis], dict[Hypothesis, float]]:
        """All hypotheses, and the reduction of the log evidence of each for the values that were tried, nats."""
        all_, mine = self.hypotheses, Groups[Hypothesis](self.hypotheses.groups.marginal, self.hypotheses.design.y)
        paid: dict[Hypothesis, float] = {}
        for true, form in self.forms.items():
            mine.add(true, form)
            paid[true] = 0.0
        given = [NOTHING, *(tuned(mine, (true,), (1.0,)) for true in self.forms)]
        for hypothesis in (h for h in all_.linear if h not in self.forms):
            mine.add(hypothesis, all_.groups.columns(hypothesis), hypothesis.effect.core)
            paid[hypothesis] = 0.0
        for hypothesis in (h for h in all_.scanned if h not in self.forms):
            scan = Scan(all_.design, mine, hypothesis.effect, hypothesis.site)
            for model in given:
                best = scan.best(model)
                term = Hypothesis(hypothesis.effect, hypothesis.site, best.value)
                if term not in mine:
                    mine.add(
                        term, all_.design.columns(term.basis(all_.design.operating_points)), hypothesis.effect.core
                    )
                peak = all_gains(mine, model, (term,))[term][0]
                paid[term] = min(paid.get(term, np.inf), max(peak - best.gain, 0.0))
        return mine, paid

    def statement(self, odds: Odds) -> Statement:
        """What the rival says: the most probable set, and the class of each member."""
        paid = self._prepared[1]
        alone = {term: model.log_evidence - paid[term] for term, model in self.every.singles.items()}

        def cost(terms: Sequence[Hypothesis]) -> float:
            against = [
                self.hypotheses.threshold if odds == "flat" else self._against(term, terms, alone) for term in terms
            ]
            return sum(against) + sum(paid[term] for term in terms)

        best = self.every.best(cost)
        causes = [_named(cause, self.every.members(best, cause)) for cause in best.terms]
        sure = all(len(cause.members) == 1 for cause in causes)
        verdict: Literal["none", "explained", "ambiguous"] = "explained" if sure else "ambiguous"
        return Statement(verdict=verdict if causes else "none", causes=tuple(causes))

    def _against(self, term: Hypothesis, terms: Sequence[Hypothesis], alone: Mapping[Hypothesis, float]) -> float:
        """Log prior odds of a diagnosis against a member of a set: docs/statistics.md, section 7."""
        mine = self.hypotheses
        stronger = [mine.share(term, t) * alone[t] for t in terms if alone[t] > alone[term]]
        return mine.cost(term) + max(stronger, default=0.0) + (mine.priors.third if len(stronger) > 1 else 0.0)


def _named(cause: Hypothesis, changes: Mapping[Hypothesis, float]) -> Named:
    """A cause with its class; probabilities by the evidence of its members."""
    best: dict[str, float] = {}
    for term, change in changes.items():
        best[str(term)] = max(best.get(str(term), -np.inf), change)
    whole = float(np.logaddexp.reduce(list(best.values())))
    members = {name: float(np.exp(change - whole)) for name, change in best.items()}
    return Named(name=str(cause), probability=members[str(cause)], members=members)
