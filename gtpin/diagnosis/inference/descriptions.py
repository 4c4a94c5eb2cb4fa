"""Flexible families that fit, and what is weak and undecided: both are reported apart from the causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis, SmoothTerm
from gtpin.diagnosis.hypotheses.hypothesis_set import Explanation, HypothesisSet
from gtpin.diagnosis.inference.classes import unnamed
from gtpin.diagnosis.inference.findings import Doubt, FlexibleFamily, Undecided
from gtpin.diagnosis.inference.unexplained import marginal_power
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.exchange import without
from gtpin.diagnosis.priors import UNDECIDED

MOST_FORMS = 3
"""Most forms with few parameters that are a mechanism together: a bearing's axis with three error motions. Assumed."""


def described(hypotheses: HypothesisSet, found: Conclusion) -> Conclusion:
    """The conclusion without causes that are only a description: flexible families, which follow any smooth motion.

    Such a family is a cause where a mechanism's form with few parameters is at least as likely as the family and as every
    smooth term that is not only its modulation. Otherwise it says where the error is and over what, but not why: it is a doubt
    where it explains more than a small part of the gap, and no cause. Where its class is undecided it stays.
    """
    told, doubts, mechanisms = [], [], set(found.mechanisms)
    for cause, members in found.classes.items():
        if cause.effect.nature != "description" or members[0].probability < UNDECIDED:
            continue
        if is_mechanism(hypotheses, found.whole(hypotheses), cause):
            mechanisms.add(cause.place)
        else:
            over = tuple(sorted(cause.drivers(hypotheses.design.situation.robot)))
            own = next(m.probability for m in members if m.hypothesis.place == cause.place)
            told.append(FlexibleFamily(*cause.place, over, size(hypotheses, found.model, cause), own))
            if not weak(hypotheses, found.model, cause):
                doubts.append(Doubt("description", cause.site, over))
    found = replace(found, mechanisms=frozenset(mechanisms), descriptions=(*found.descriptions, *told))
    if not told:
        return found
    places = {(d.effect, d.site) for d in told}
    kept = found.only(hypotheses, [cause for cause in found.classes if cause.place not in places])
    return kept.only(hypotheses, kept.beside_unknown()).doubted(*doubts) if doubts else kept


def without_undecided(hypotheses: HypothesisSet, found: Conclusion) -> Conclusion:
    """The conclusion that tells apart what is weak and undecided, where other causes are named."""
    small = tuple(
        cause
        for cause, members in found.classes.items()
        if members[0].probability < UNDECIDED and weak(hypotheses, found.model, cause)
    )
    return replace(found, also=small) if len(small) < len(found.classes) else found


def is_mechanism(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> bool:
    """Whether forms with few parameters explain what a flexible family does, as likely as the family and any smooth function.

    The forms are chosen one after the other, each against the prior odds of a choice among all of them. The family may be
    likelier by the share of its evidence that a cause's modulation has. The forms become groups of ``hypotheses``, once.
    """
    groups, at = hypotheses.groups, hypotheses.design.situation
    rest = without(groups, model, cause, sweeps=1)
    columns = groups.columns(cause)
    forms = []
    for number, chosen in enumerate(cause.effect.forms(at.robot, cause.site)):
        form = SmoothTerm(cause.site, (str(number),), f"form of {cause.effect.id}")
        if form not in groups:
            groups.add(form, columns[:, list(chosen)])
        forms.append(form)
    simple: Explanation = rest
    for _ in range(min(MOST_FORMS, len(forms))):
        gains = hypotheses.gains(simple, forms)
        best = max(gains, key=lambda form: gains[form].value)
        if gains[best].value < np.log(len(forms)):
            break
        simple = hypotheses.extended(simple, best)
    by_forms = (
        simple.log_evidence - rest.log_evidence - (len(simple.terms) - len(rest.terms)) * np.log(max(len(forms), 1))
    )
    own = model.log_evidence - rest.log_evidence
    smooth = max((g.value for g in hypotheses.gains(rest, unnamed(hypotheses, cause)).values()), default=0.0)
    return bool(by_forms >= max((1.0 - hypotheses.priors.modulation) * own, smooth))


def undecided(hypotheses: HypothesisSet, found: Conclusion) -> tuple[Undecided, ...]:
    """What is weak and undecided, as it is reported."""
    return tuple(Undecided(c.site, size(hypotheses, found.model, c), found.members(c)) for c in found.also)


def weak(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> bool:
    """Whether a cause explains only a small part of the chi-square beyond noise that the geometry leaves."""
    less = without(hypotheses.groups, model, cause, sweeps=1)
    own = marginal_power(hypotheses, less) - marginal_power(hypotheses, model)
    return own < hypotheses.priors.weak * (hypotheses.groups.power - hypotheses.design.dof)


def size(hypotheses: HypothesisSet, model: Explanation, cause: Hypothesis) -> float:
    """Root mean square of the TCP's displacement by a cause over the poses of the search, m."""
    at = hypotheses.design.situation
    start = sum(model.widths[: model.terms.index(cause)])
    basis = cause.basis(at)
    moved = basis.displacement(at)[:, :3] @ (basis.sigma * model.mean[start : start + len(basis)])
    return float(np.sqrt((moved**2).sum(axis=1).mean()))
