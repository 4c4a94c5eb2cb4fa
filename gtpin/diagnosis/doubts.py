"""The doubts: each reason to assume something unknown, as a rule with its source.

A rule takes what is known so far, and returns the conclusion with its doubt and the causes that remain, or None where there is
no such doubt. `OF_THE_SEARCH`, `OF_THE_FIT` and `OF_LEFT_OUT_POSES` at the end list the rules in their order. Not rules of this
file: smooth terms that are needed and a drive beyond noise (``verdict.py``), a fit of the causes that does not converge
(``diagnose.py``), and the chi-square of a check (``against.py``).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp
from typing import TypeVar

import numpy as np

from gtpin.data.plausible import command_steps
from gtpin.diagnosis.classes import ClassMember, class_of, ordered, own_probability, unnamed
from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Posterior, without
from gtpin.diagnosis.gap import leave_out, unexplained
from gtpin.diagnosis.hypothesis import Hypothesis, SmoothTerm, Term
from gtpin.diagnosis.hypothesis_set import HypothesisSet
from gtpin.diagnosis.noise import SearchState, ShownNoise, floor_of, left_over
from gtpin.diagnosis.prepare import Prepared
from gtpin.diagnosis.priors import CLASS_SHARE, LIKELY, PRIORS, SURE, Priors
from gtpin.diagnosis.result import Cause, Doubt, FlexibleFamily, Gap, Question
from gtpin.diagnosis.verdict import Conclusion, infer, size, weak
from gtpin.effects.effect import Effect
from gtpin.errors import warn
from gtpin.estimate import Estimate
from gtpin.kinematics.rotations import frame_motions
from gtpin.noise.estimate import LEAST_CONTRASTS
from gtpin.typing import Floats, Mask


@dataclass(frozen=True)
class Context:
    """What a rule judges.

    ``prepared``, ``settled``: the data, and the rows and hypotheses of the search. ``found``: the conclusion so far.
    ``blocks``: (N,) masks of neighbouring poses, which are left out together. ``causes``: the causes after they were fitted.
    """

    prepared: Prepared
    settled: SearchState
    found: Conclusion
    blocks: list[Mask]
    causes: Sequence[Cause] = ()

    @property
    def hypotheses(self) -> HypothesisSet:
        """The hypotheses of the search."""
        return self.settled.hypotheses

    @property
    def of_poses(self) -> bool:
        """Whether poses were measured, not readings."""
        return self.settled.observed.measured.tracked


@dataclass(frozen=True, kw_only=True)
class FittedContext(Context):
    """As :class:`Context`, with the errors on left-out poses ``gap``, and ``shown``, the noise by declaration and visits."""

    gap: Gap
    shown: ShownNoise


C = TypeVar("C", bound=Context)


def judged(context: C, rules: Iterable[Callable[[C], Conclusion | None]]) -> C:
    """The context with the conclusion of some rules, applied one after the other."""
    for rule in rules:
        context = replace(context, found=rule(context) or context.found)
    return context


MOST_FORMS = 3
"""Most forms with few parameters that are a mechanism together: a bearing's axis with three error motions. Assumed."""
LEAST_BY_FORMS = 0.55
"""Least share of a flexible family's gain that its forms gain. Where no smooth term gained more, forms of false families gained
up to 0.35 on 33 datasets of another simulation (examples/independent) and up to 0.46 of products of two functions
(tests/diagnosis/test_descriptions.py); forms of true ones gained 0.65 and more."""


def flexible_families(context: Context) -> Conclusion | None:
    """``description``: a flexible family (`cross_coupling`, `axis_motion`), which follows any smooth motion, is no cause.

    Such a family is a cause where forms with few parameters, its own or those of another family, are at least as likely as the
    family and as every smooth term that is not only its modulation, prior odds included. Its class then has the other families
    by their forms, and the cause is the likeliest of them. Otherwise the family says where the error is and over what, but not
    why: it is a doubt where it explains more than a small part of the gap, and no cause. Where its class is undecided it stays.
    """
    hypotheses, found = context.hypotheses, context.found
    families, doubts, mechanisms = [], [], set(found.mechanisms)
    for cause, members in found.classes.items():
        if cause.effect.nature != "description" or members[0].probability < LIKELY:
            continue
        by_forms = _by_forms(hypotheses, found.whole(hypotheses), cause)
        if by_forms:
            found, cause = _likeliest_forms(hypotheses, found, cause, by_forms)
            mechanisms.add(cause.place)
        else:
            over = tuple(sorted(cause.drivers(hypotheses.design.operating_points.robot)))
            own = own_probability(members, cause)
            families.append(FlexibleFamily(*cause.place, over, size(hypotheses, found.model, cause), own))
            if not weak(hypotheses, found.model, cause):
                doubts.append(Doubt("description", cause.site, over))
    found = replace(found, mechanisms=frozenset(mechanisms), descriptions=(*found.descriptions, *families))
    if not families:
        return found
    places = {(d.effect, d.site) for d in families}
    kept = found.only(hypotheses, [cause for cause in found.classes if cause.place not in places])
    return kept.named_beside_unknown(hypotheses).doubted(*doubts) if doubts else kept


def _by_forms(hypotheses: HypothesisSet, model: Posterior[Term], cause: Hypothesis) -> dict[Hypothesis, float]:
    """Gain in log evidence, nats, of each flexible family in the place of one by its forms; empty where all gain too little.

    Enough is what any smooth term gains, less the prior odds; and of the family's own forms a share ``LEAST_BY_FORMS`` of what
    it gains itself. It then counts with all its functions, since what these gain beyond the forms, such as a short wave, is not
    another family's. Forms of another family have to gain what the family does.
    """
    rest = without(hypotheses.groups, model, cause, sweeps=1)
    own = model.log_evidence - rest.log_evidence
    smooth = max((g.value for g in hypotheses.gains(rest, unnamed(hypotheses, cause)).values()), default=0.0)
    families = [
        h for h in hypotheses.named if h.effect.nature == "description" and (h == cause or h not in model.terms)
    ]
    gains = {family: _gain_of_forms(hypotheses, rest, family) for family in families}
    priors = hypotheses.priors
    least = smooth - priors.departure * own - priors.unnamed
    if gains[cause] >= max(LEAST_BY_FORMS * own, least):
        gains[cause] = max(gains[cause], own)
    return gains if max(gains.values()) >= max((1.0 - priors.modulation) * own - priors.unnamed, least) else {}


def _gain_of_forms(hypotheses: HypothesisSet, rest: Posterior[Term], family: Hypothesis) -> float:
    """Gain of a family's forms: chosen one after the other, each against the prior odds of a choice among all of them.

    The forms become groups of ``hypotheses``, once.
    """
    groups, forms = hypotheses.groups, []
    for number, chosen in enumerate(family.effect.forms(hypotheses.design.operating_points.robot, family.site)):
        form = SmoothTerm(family.site, (str(number),), f"form of {family.effect.id}")
        if form not in groups:
            groups.add(form, groups.columns(family)[:, list(chosen)])
        forms.append(form)
    simple, price = rest, float(np.log(max(len(forms), 1)))
    for _ in range(min(MOST_FORMS, len(forms))):
        gains = hypotheses.gains(simple, forms)
        best = max(gains, key=lambda form: gains[form].value)
        if gains[best].value < price:
            break
        simple = hypotheses.extended(simple, best)
    return simple.log_evidence - rest.log_evidence - (len(simple.terms) - len(rest.terms)) * price


def _likeliest_forms(
    hypotheses: HypothesisSet, found: Conclusion, cause: Hypothesis, by_forms: Mapping[Hypothesis, float]
) -> tuple[Conclusion, Hypothesis]:
    """The conclusion with the families in a cause's class by the gain of their forms; the likeliest of them is the cause."""
    temperature = hypotheses.priors.temperature_of(by_forms[cause])
    own = own_probability(found.classes[cause], cause)
    probability = {m.hypothesis: m.probability for m in found.classes[cause]}
    for family, gain in by_forms.items():
        probability[family] = max(
            probability.get(family, 0.0), own * exp(min((gain - by_forms[cause]) / temperature, 700.0))
        )
    before = {m.hypothesis: m for m in found.classes[cause]}
    whole = max(sum(probability.values()), 1.0)
    likeliest = max(by_forms, key=lambda family: probability[family])
    members = [replace(before.get(h, ClassMember(h, 0.0)), probability=p / whole) for h, p in probability.items()]
    least = CLASS_SHARE * max(m.probability for m in members)
    members = [m for m in members if m.probability >= least or m.hypothesis == likeliest]
    terms = [likeliest if term == cause else term for term in found.model.terms]
    model = found.model if likeliest == cause else hypotheses.of(terms, found.model.scale)
    classes = {likeliest if c == cause else c: members_ for c, members_ in found.classes.items()}
    return replace(found, model=model, classes={**classes, likeliest: ordered(members, likeliest)}), likeliest


COARSEST = 2e-2
"""Step of commands, m or rad, above which they are a grid that was chosen on purpose. Assumed: 1 degree is below it."""
VARIOUS = 0.5
"""Share of distinct commands of a drive above which they are not a grid that was chosen on purpose."""


def rounded_commands(context: Context) -> Conclusion | None:
    """Where something is unknown and the errors are as small as the commands' last digit, nothing is named beside it.

    Study: commands truncated to 0.1 mm (examples/mistakes).

    Warns (`GtpinWarning`): names the step of the commands.
    """
    design, dataset = context.hypotheses.design, context.settled.searched
    if not (context.found.doubts and context.of_poses):
        return None
    steps = command_steps(dataset.q, design.operating_points.robot.revolute)
    if steps is None:
        return None
    step = float(steps.size[np.isfinite(steps.size)].max())
    # Multiples of a step, with too many distinct ones for a grid chosen on purpose.
    various = min(len(np.unique(column)) for column in np.round(dataset.q, 12).T) > VARIOUS * len(dataset)
    if step > COARSEST or not various:
        return None
    errors = design.coloured(left_over(context.hypotheses, NOTHING)[0])[:, :3]
    if np.sqrt((errors**2).sum(axis=1).mean()) > context.hypotheses.priors.few_steps * step:
        return None
    size = steps.words if "degrees" in steps.words else f"{1e3 * step:g} mm or mrad"
    warn(
        f"commands have steps of {size}, and what is left is of that size: they look rounded or cut off; export more digits"
    )
    return context.found.only(context.hypotheses, [])


GROUP_SWEEPS = 30
USUAL_SIGMAS = (1.5e-5, 5e-5)
"""Assumed noise of a laser tracker, m and rad, for the weights of positions and orientations where no noise is declared."""
LISTED_ROWS = 8
"""Lines of rows that a message lists."""


@dataclass(frozen=True)
class RowGroups:
    """The mask (N,) of the smaller group, and the distance between the two groups' frames at the median row, m."""

    smaller: Mask
    apart: float


def two_groups(
    design: Design, residual: Floats, sigma: tuple[float, float], priors: Priors = PRIORS
) -> RowGroups | None:
    """Two groups of rows with different frames; None where residuals with one frame for all rows are hardly larger.

    ``residual``: (N, c) whitened residual of the geometry and the causes. ``sigma``: the instrument's noise of positions and
    orientations, m and rad, with which residuals are whitened.
    """
    c, T = design.components, design.model.in_instrument_frame(design.operating_points.poses).T
    scale = np.array([sigma[0]] * 3 + [sigma[1]] * 3)[:c]
    y, F = design.coloured(residual) / scale, frame_motions(T - T.mean(axis=0))[:, :c] / scale[:, None]
    centred = y - y.mean(axis=0)
    first = centred @ np.linalg.svd(centred, full_matrices=False)[2][0] > 0.0
    for _ in range(GROUP_SWEEPS):
        off = [_left_by(F, y, group)[0] for group in (first, ~first)]
        now = (off[0] ** 2).sum(axis=1) < (off[1] ** 2).sum(axis=1)
        if (now == first).all():
            break
        first = now
    smaller = first if first.mean() <= 0.5 else ~first
    if smaller.mean() < priors.least_group:
        return None
    (one, a), (two, b) = (_left_by(F, y, group) for group in (smaller, ~smaller))
    both = np.where(smaller[:, None], one, two)
    whole, _ = _left_by(F, y, np.ones(len(y), dtype=bool))
    if (whole**2).sum() < priors.two_groups * (both**2).sum():
        return None
    apart = np.linalg.norm((F @ (a - b))[:, :3] * scale[:3], axis=1)
    return RowGroups(smaller, float(np.median(apart)))


def rows_in_two_groups(context: Context) -> Conclusion | None:
    """``two_groups``: what looks like noise comes from two groups of rows with a frame each.

    Study: two machines in one table (examples/mistakes); tests/diagnosis/test_suspicious_data.py.

    Warns (`GtpinWarning`): Lists the rows of the smaller group by their lines in the file.
    """
    hypotheses, found, dataset = context.hypotheses, context.found, context.settled.searched
    if found.doubts or not context.of_poses:
        return None
    instrument = dataset.instrument
    sigma = (instrument.position_sigma or USUAL_SIGMAS[0], instrument.orientation_sigma or USUAL_SIGMAS[1])
    groups = two_groups(hypotheses.design, left_over(hypotheses, found.model)[0], sigma, hypotheses.priors)
    if groups is None:
        return None
    lines = np.sort(dataset.row[groups.smaller])
    shown = ", ".join(str(line) for line in lines[:LISTED_ROWS])
    warn(
        f"the rows fall into two groups that differ by one motion of {1e3 * groups.apart:.2g} mm: {len(lines)} rows "
        f"({shown}, ...) against {len(groups.smaller) - len(lines)}: two machines, two set-ups of the instrument, a zero that "
        "moved, or play whose direction of approach was not recorded; give each group its session"
    )
    return found.doubted(Doubt("two_groups"))


def _left_by(F: Floats, y: Floats, group: Mask) -> tuple[Floats, Floats]:
    """(N, c) residuals of all rows with a frame fitted to a group, and the frame's motion (6,)."""
    flat = F[group].reshape(-1, 6)
    motion: Floats = np.asarray(np.linalg.lstsq(flat, y[group].ravel(), rcond=None)[0], dtype=np.float64)
    return y - F @ motion, motion


def worse_predictions(context: Context) -> Conclusion | None:
    """``held_out``: all causes together do not make the errors of left-out poses smaller; none is named.

    Errors are smaller where the product of two ratios is below 1, those of the mean squares of positions and of measured
    orientations: a wrist rotates the tool and hardly shifts it. The model that users get has no smooth terms, so none is here.
    """
    design, found = context.hypotheses.design, context.found
    if not found.classes:
        return None
    nothing, causes = np.zeros((len(design.y), 0)), context.hypotheses.columns(found.model)
    alone, whole = (leave_out(design, some, context.blocks) for some in (nothing, causes))
    compared = [(alone.errors, whole.errors)] + [(alone.turned, whole.turned)] * bool(alone.turned.size)
    if np.prod([(after**2).sum() / (before**2).sum() for before, after in compared]) < 1.0:
        return None
    return found.only(context.hypotheses, []).doubted(Doubt("held_out"))


def questions(found: Conclusion, causes: Iterable[Cause], priors: Priors) -> list[Question]:
    """Compare parameters of causes with the ranges that their effects state as plausible and usual.

    A cause with an impossible parameter is not named; with an unusual one it is (``believed``). The impossible ones come first.
    """
    effects, asked = {hypothesis.place: hypothesis.effect for hypothesis in found.classes}, list[Question]()
    for cause in causes:
        asked += out_of_range(effects[cause.effect, cause.site], cause.site, cause.parameters, priors)
    return sorted(asked, key=lambda question: question.believed)


def out_of_range(effect: Effect, site: str, parameters: Mapping[str, Estimate], priors: Priors) -> list[Question]:
    """The parameters of an effect that are outside its plausible range; where there is none, those outside its usual one."""
    for ranges, believed in ((effect.plausible, False), (effect.expected_range, True)):
        asked = []
        for name in (name for name in ranges if name in parameters):
            own, e = ranges[name], parameters[name]
            reach = priors.implausible * e.sigma
            if not (own.low <= e.value + reach and e.value - reach <= own.high):
                place = effect.id, site, name
                asked.append(Question(*place, e.value, e.sigma, e.unit, own.low, own.high, own.why, believed))
        if asked:
            return asked
    return []


def causes_reach_noise(context: FittedContext) -> Conclusion | None:
    """No doubt by smooth terms where the named causes alone leave less than noise, and close the gap.

    What a smooth term gains is then within the noise: neighbouring poses share a part of it, or it is declared too large.
    Study: tests/diagnosis/test_causes_reach_noise.py.
    """
    found, hypotheses, shown = context.found, context.hypotheses, context.shown
    if not found.classes or {doubt.reason for doubt in found.doubts} != {"smooth_term"}:
        return None
    chance = shown.excess(shown.noise, context.settled.observed, hypotheses, found.model)[1]
    before, after, floor = context.gap.before**2, context.gap.after**2, context.gap.floor**2
    closed = after - floor <= hypotheses.priors.core_leaves * (before - floor)
    return replace(found, doubts=(), beside=NOTHING) if closed and chance >= SURE else None


def impossible_parameters(context: Context) -> Conclusion | None:
    """``impossible``: a cause would need a parameter that physics does not allow; something unknown looks like it.

    Of the others, those are named that a search without the impossible ones names with confidence.
    """
    asked = [one for one in questions(context.found, context.causes, context.hypotheses.priors) if not one.believed]
    if not asked:
        return None
    other = infer(context.settled, {(one.effect, one.site) for one in asked})
    return without_impossible(context.hypotheses, context.found, asked, {cause.place for cause in other.sure()})


def without_impossible(
    hypotheses: HypothesisSet, found: Conclusion, asked: Sequence[Question], sure: Collection[tuple[str, str]]
) -> Conclusion:
    """The conclusion without impossible causes, with a doubt: an unknown cause looks like them.

    ``sure``: effects and sites that a search without the impossible causes names with confidence. Other causes are not named:
    they may explain the data only together with an impossible one.
    """
    places = {(q.effect, q.site) for q in asked}
    wrong = next(cause for cause in found.classes if cause.place == (asked[0].effect, asked[0].site))
    over = tuple(sorted(wrong.drivers(hypotheses.design.operating_points.robot)))
    kept = found.only(hypotheses, [cause for cause in found.classes if cause.place in {*sure} - places])
    return kept.doubted(Doubt("impossible", wrong.site, over))


def errors_beyond_noise(context: FittedContext) -> Conclusion | None:
    """``held_out``, ``part``, ``excess``: residuals and errors on left-out poses are larger than noise.

    They exceed it where they do so by more than a declared sigma is known to. Beside causes they may also exceed it by a small
    share of the gap, since no cause follows its equation exactly: of the gap of positions on left-out poses, or of all that was
    measured, in units of noise. A wrist rotates the tool and hardly shifts it.

    Noise is what was declared or what repeated visits show. Nothing can exceed noise that is assumed from the residuals.
    Without causes the repeatability is the largest that the visits allow; beside causes it is the likeliest, else what the
    causes do not explain would pass for it. Study: examples/diagnosis/noise_floor.py.
    """
    found, hypotheses, shown, observed = context.found, context.hypotheses, context.shown, context.settled.observed
    if found.doubts or shown.source == "residuals":
        return None
    priors, silent = hypotheses.priors, found.verdict == "none"
    noise = shown.most if silent else shown.noise
    size, chance, part = shown.excess(noise, observed, hypotheses, found.model)
    allowed = float(floor_of(noise, hypotheses.design).mean() / shown.floor(hypotheses.design).mean())
    before, after, floor = context.gap.before**2, context.gap.after**2, allowed * context.gap.floor**2
    far = after > priors.silent**2 * floor or size > priors.excess
    if not silent:
        far &= after - floor > priors.core_leaves * (before - floor)
        far &= shown.share_left(observed, hypotheses, found.model) > priors.core_leaves
    if chance > priors.chance or not far:
        return None
    # Something acts that no effect describes: a smooth term may as well be in the place of a certain cause.
    model = found.whole(hypotheses)
    again = {cause: class_of(hypotheses, model, cause, unlisted=True) for cause in found.sure()}
    doubt = Doubt("part", part) if part else Doubt("excess" if shown.visits < LEAST_CONTRASTS else "held_out")
    return replace(found, classes={**found.classes, **again}).doubted(doubt)


_MOVES = re.compile(r"(approach|speed)[0-9]+")


def hidden_in_scatter(context: Context) -> Conclusion | None:
    """``scatter``: visits scatter, and columns of direction or speed, which could show why, contradict each other.

    The verdict ``none`` would say that effects of these columns were tested. Study: of eight machines with directions of other
    rows, three with backlash are called ``none`` without this rule (examples/mistakes).
    """
    found, at = context.found, context.hypotheses.design.operating_points
    if found.verdict != "none" or _scatter(context) <= context.hypotheses.priors.scatters:
        return None
    hidden = [
        untested.hypothesis.place
        for untested in context.hypotheses.untested
        if any(_MOVES.fullmatch(n) and n in at.unusable for n in untested.hypothesis.covariates(at.robot))
    ]
    return replace(found, likely=(*found.likely, *hidden)).doubted(Doubt("scatter", hidden[0][1])) if hidden else None


def correlated_residuals(context: Context) -> Conclusion | None:
    """``smooth_term``: the verdict ``none``, with residuals that correlate with a smooth term by more than chance.

    The search asks for more, prior odds; but ``none`` says that nothing but noise is left. The p-value is that of the best of
    all smooth terms (Bonferroni). Study: of 200 machines without an effect (examples/independent), none is below the limit.
    """
    found, hypotheses = context.found, context.hypotheses
    left = unexplained(hypotheses, found.model, False, scaled=True).correlates if found.verdict == "none" else ()
    best = min(left, key=lambda one: one.p_value, default=None)
    if best is None or best.p_value * len(hypotheses.smooth) > hypotheses.priors.chance:
        return None
    return found.doubted(Doubt("smooth_term", best.site, tuple(best.coordinates.split(","))))


def _scatter(context: Context) -> float:
    """Scatter of the drives over the instrument's noise: from repeated visits for poses, from all residuals for readings."""
    noise = context.settled.observed.noise
    if context.of_poses:
        return context.prepared.baseline.drive_scatter
    moved = np.sqrt((context.hypotheses.design.by_command_seen**2).sum(axis=2))
    return float(np.median(noise.repeatability * moved / noise.each))


OF_THE_SEARCH = (flexible_families, rounded_commands, rows_in_two_groups, worse_predictions)
"""Rules that need nothing but the search."""
OF_THE_FIT = (impossible_parameters,)
"""Rules that need the causes' parameters, fitted together with the geometry."""
OF_LEFT_OUT_POSES = (causes_reach_noise, errors_beyond_noise, hidden_in_scatter, correlated_residuals)
"""Rules that need the errors on left-out poses."""
