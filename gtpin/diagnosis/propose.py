"""Which effects a dataset can test, why it can not test the others, and proxies of covariates that were not recorded."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise
from math import comb, log

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import NOTHING, Groups, Marginal, all_gains, fixed, gain
from gtpin.diagnosis.hypothesis import CLOCK, Hypothesis, Proxy, Scope
from gtpin.diagnosis.hypothesis_set import HypothesisSet, Untested
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.diagnosis.smooth_terms import smooth_terms
from gtpin.effects.catalogue import OWN
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.effects.untestable import Untestable, as_untestable
from gtpin.errors import warn
from gtpin.model.fit_conditions import TEMPERATURES
from gtpin.typing import Floats

FEWEST_SESSIONS = 2
"""Fewest sessions that are left: with one, no effect of sessions can be tested."""


def propose(design: Design, scope: Scope, *, changes: bool = False) -> HypothesisSet:
    """Divide the effects of a scope, at all their sites, into those that the data can test and those that they can't.

    ``changes``: of effects since an earlier model, whose uncertainty B has; without smooth terms, proxies and scans.
    """
    at, marginal = design.operating_points, Marginal(design.B)
    linear: list[Hypothesis] = []
    scanned: list[Hypothesis] = []
    untested: list[Untested] = []
    for hypothesis in scope.hypotheses(at.robot):
        effect, site = hypothesis.effect, hypothesis.site
        reason = _no_change(at, hypothesis) if changes else as_untestable(effect.untestable(at, site))
        many = not changes and reason is None and len(effect.nonlinear_values(at, site)) > 0
        basis = hypothesis.checked(at) if reason is None else None
        if basis is not None and not many:
            # Whether even many times the typical size does not show: geometry or uncertainty absorb it, or it is small.
            X = design.columns(basis) * scope.priors.large
            whole = float((X**2).sum())
            if (left := whole - float((marginal.half(X) ** 2).sum())) <= scope.priors.shows:
                framed = any(design.measured.rows.stations) and "session" in effect.covariates(at.robot, site)
                hidden = Untestable("absorbed" if left <= scope.priors.leaves * whole else "small")
                reason = Untestable("uncertain") if changes else Untestable("stations") if framed else hidden
        if reason:
            untested.append(Untested(hypothesis, reason))
        else:
            (scanned if many else linear).append(hypothesis)
    if changes:
        return HypothesisSet(design, linear, (), (), scope, untested)
    design, odds = merged_sessions(design, marginal, linear, scope.priors)
    at = design.operating_points
    scaled = any(hypothesis.effect.stretches_frame for hypothesis in linear)
    smooth = tuple(smooth_terms(at, scope.priors, scaled))
    lacking = partial(proxies, design, [one.hypothesis for one in untested], linear, scope.priors)
    return HypothesisSet(design, linear, scanned, smooth, scope, untested, of_sessions=odds, proxies=lacking)


def _no_change(at: OperatingPoints, hypothesis: Hypothesis) -> Untestable | None:
    """Why a check can't test an effect as a change; temperatures that do not vary are no reason."""
    effect = hypothesis.effect
    if effect.since_a_model:
        return None
    if effect.has_nonlinear:
        return Untestable("not_searched")
    reason = as_untestable(effect.untestable(at, hypothesis.site))
    if reason is not None and reason.kind == "constant" and reason.covariate in TEMPERATURES:
        return None
    return reason


def merged_sessions(
    design: Design, marginal: Marginal, hypotheses: Sequence[Hypothesis], priors: Priors
) -> tuple[Design, float]:
    """A linear problem in which consecutive sessions without a change between them are one session.

    Coefficients of a session that has none of its own cost evidence, so that a second label within a session would make a
    certain shift between sessions doubtful. The effects of sessions are taken together, each session with one set of their
    coefficients. Two neighbours are merged where equal sets are more probable than different ones (Savage-Dickey density
    ratio), first those of the largest ratio. ``hypotheses``: those that can be tested.

    Returns the problem, and the natural logarithm of the number of ways to divide the sessions into as many: log prior odds,
    nats, against each effect of sessions.
    """
    at = design.operating_points
    labels = at.references.sessions
    if len(labels) <= FEWEST_SESSIONS or not at.varies("session"):
        return design, 0.0
    names = np.array([str(name) for name in at.covariates["session"]])
    if at.has("time"):
        labels = tuple(sorted(labels, key=lambda label: float(at.covariate("time")[names == label].mean())))
    members = np.array([names == label for label in labels])
    parts = [_by_session(design, h, members) for h in hypotheses if "session" in h.covariates(at.robot)]
    found = [part for part in parts if part is not None]
    if not found:
        return design, 0.0
    groups: Groups[str] = Groups(marginal, design.y, priors)
    groups.add("all", np.concatenate(found, axis=2).transpose(1, 0, 2).reshape(len(design.y), -1))
    scale = gain(groups, NOTHING, "all")[1]
    posterior = fixed(groups, ("all",), (scale,))
    together = _together(posterior.mean, posterior.covariance, scale, len(labels))
    if len(together) == len(labels):
        return design, 0.0
    new = {labels[i]: labels[group[0]] for group in together for i in group}
    column = np.array([new[name] for name in names], dtype=object)
    changed = replace(design, operating_points=at.with_covariate("session", column))
    return changed, log(comb(len(labels) - 1, len(together) - 1))


def _by_session(design: Design, hypothesis: Hypothesis, members: npt.NDArray[np.bool_]) -> Floats | None:
    """(K, N c, m) whitened displacements by the m coefficients of each of K sessions; None if they are not of one session."""
    X = design.columns(hypothesis.basis(design.operating_points))
    each, left = divmod(X.shape[1], len(members))
    if left or not each:
        return None
    rows = np.repeat(members, design.components, axis=1)
    # Columns belong to the only session in which they are not zero, in whatever order the effect has them.
    inside = np.array([(X[own] != 0.0).any(axis=0) for own in rows])
    if (inside.sum(axis=0) != 1).any() or (inside.sum(axis=1) != each).any():
        return None
    return np.stack([X[:, own] for own in inside])


def _together(mean: Floats, covariance: Floats, scale: float, count: int) -> list[list[int]]:
    """Groups of consecutive sessions, given the posterior of ``count`` sets of coefficients, of prior variance scale^2 each."""
    found, width = [[i] for i in range(count)], len(mean) // count

    def equal(a: list[int], b: list[int]) -> tuple[float, Floats, slice, slice]:
        """Log density of equal coefficients in the posterior less that in the prior; the gain matrix that makes them equal; and
        the coefficients of both groups: those of their first sessions."""
        own, other = slice(a[0] * width, (a[0] + 1) * width), slice(b[0] * width, (b[0] + 1) * width)
        d, across = mean[own] - mean[other], covariance[:, own] - covariance[:, other]
        factor = cho_factor(across[own] - across[other], lower=True)
        before = scale**2 * (1.0 / len(a) + 1.0 / len(b))  # of the difference of two means of independent coefficients
        ratio = -0.5 * float(d @ cho_solve(factor, d)) - float(np.log(np.diag(factor[0])).sum())
        return ratio + 0.5 * width * log(before), cho_solve(factor, across.T).T, own, other

    while len(found) > FEWEST_SESSIONS:
        tried = [equal(a, b) for a, b in pairwise(found)]
        best = int(np.argmax([ratio for ratio, *_ in tried]))
        ratio, gain_, own, other = tried[best]
        if ratio <= 0.0:
            break
        mean = mean - gain_ @ (mean[own] - mean[other])
        covariance = covariance - gain_ @ (covariance[own] - covariance[other])
        found[best : best + 2] = [found[best] + found[best + 1]]
    return found


UNLOADED = Untestable("unrecorded_payload", "payload")
"""Why an effect that depends on forces could be the cause although its test with the robot's own weight does not show it."""
MOST_PAUSES = 11
"""Largest number of pauses after which a new session is assumed."""
SHORT = 0.95
"""Share of the intervals between visits whose mean is the usual interval: the shortest ones, which are no pauses."""
BREAKS, TWO_BREAKS = 23, 7
"""Where there is no pause: number of instants at which one new session is tried, and number of those at which two are."""
CLOCKS = tuple(name for name in CLOCK if name != "session")
"""Numeric coordinates that change with time."""
SPELLS = 12
"""Number of intervals of time. In each, a payload that was not recorded may have been carried."""


def proxies(
    design: Design, untestable: Iterable[Hypothesis], testable: Iterable[Hypothesis], priors: Priors = PRIORS
) -> Iterator[Proxy]:
    """Proxies of effects with a missing covariate, and of effects of forces where the payload was not recorded."""
    at, failed = design.operating_points, dict[str, str]()
    for hypothesis in untestable:
        columns = _tried(hypothesis, partial(proxy_columns, design, hypothesis, priors), failed)
        if columns is not None:
            yield Proxy(hypothesis, columns, odds(at, hypothesis, priors))
    spells = [] if "payload" in at.covariates else further_loads(at, priors)
    for hypothesis in testable if spells else ():
        if "payload" in hypothesis.coordinates(at.robot) and not hypothesis.effect.has_nonlinear:
            columns = _tried(hypothesis, partial(_under, design, hypothesis, spells), failed)
            if columns is not None:
                yield Proxy(hypothesis, columns, priors.not_varied, UNLOADED)
    for effect, why in failed.items():
        text = f"{effect} can't be tried with a proxy of what was not recorded ({why}): it is in no class"
        warn(text)


def _tried(hypothesis: Hypothesis, columns: Callable[[], Floats | None], failed: dict[str, str]) -> Floats | None:
    """The result of ``columns``. None where there is no proxy, where a displacement is not finite, or where a user's own effect
    fails with the proxy; ``failed`` then gets the error."""
    try:
        found = columns()
    except Exception as error:  # a user's effect may fail in any way
        if type(hypothesis.effect) in OWN:
            raise
        failed[hypothesis.effect.id] = f"{type(error).__name__}: {error}"
        return None
    return found if found is not None and np.isfinite(found).all() else None


def _under(design: Design, hypothesis: Hypothesis, spells: list[OperatingPoints]) -> Floats:
    """An effect's displacements, and those that a payload in each interval of time adds to its core."""
    effect, site = hypothesis.effect, hypothesis.site
    plain = design.columns(effect.basis(design.operating_points, site))
    core = [i for i in effect.core or range(plain.shape[1]) if i < plain.shape[1]]
    more = [design.columns(effect.basis(at, site))[:, core] - plain[:, core] for at in spells]
    return np.hstack([plain, *more])


def odds(at: OperatingPoints, hypothesis: Hypothesis, priors: Priors = PRIORS) -> float:
    """Prior odds of an effect with a missing covariate relative to a testable effect.

    They are 1 where the covariate was recorded but can't be used, and smaller for a session that began without a pause.
    """
    missing = _missing(at, hypothesis)
    if at.unusable.issuperset(missing):
        return 1.0
    once = missing == ["session"] and not len(pauses(at, priors))
    return priors.not_varied if once else priors.not_recorded


def proxy_columns(design: Design, hypothesis: Hypothesis, priors: Priors = PRIORS) -> Floats | None:
    """(N c, m) whitened displacements of an effect whose covariate is missing, by the proxy of that covariate that fits best.

    None where there is no proxy, or where the effect is untestable for another reason than one missing covariate.
    """
    at, (effect, site) = design.operating_points, (hypothesis.effect, hypothesis.site)
    missing = _missing(at, hypothesis)
    if len(missing) != 1 or effect.has_nonlinear:
        return None
    found: list[Floats] = [
        np.hstack([design.columns(effect.basis(at.with_covariate(missing[0], values), site)) for values in together])
        for together in guesses(at, missing[0], priors)
    ]
    if len(found) < 2:
        return found[0] if found else None
    groups: Groups[int] = Groups(Marginal(design.B), design.y)
    for i, columns in enumerate(found):
        groups.add(i, columns)
    gains = all_gains(groups, NOTHING, range(len(found)))
    best: int = max(gains, key=lambda i: gains[i])
    return found[best]


def _missing(at: OperatingPoints, hypothesis: Hypothesis) -> list[str]:
    return [name for name in hypothesis.effect.covariates(at.robot, hypothesis.site) if not at.has(name)]


def guesses(at: OperatingPoints, name: str, priors: Priors = PRIORS) -> Iterable[tuple[Column, ...]]:
    """Proxies of the missing covariate ``name``: each item is one or more columns (N,) that are used together."""
    numbered = re.fullmatch(r"(approach|speed)(\d+)", name)
    if numbered:
        other = f"{'speed' if numbered[1] == 'approach' else 'approach'}{numbered[2]}"
        if not at.varies(other):
            return []
        return [(np.sign(at.covariate(other)) * (1.0 if numbered[1] == "approach" else priors.likely_speed),)]
    if name == "session":
        return _sessions(at, priors)
    if name == "time":
        clocks: list[tuple[Column, ...]] = [(at.covariate(n),) for n in CLOCKS if n != name and at.varies(n)]
        if at.varies("session"):
            clocks.append((_order(at.covariates["session"]),))
        return clocks
    if name not in CLOCKS:
        return []
    # Of a temperature: the other temperature, and slow changes over time.
    together: list[Column] = [at.covariate(n) for n in CLOCKS[1:] if n != name and at.varies(n)]
    if at.varies("time"):
        reference = at.references.temperature
        together += [reference + priors.warmer * at.time, reference + priors.warmer * at.time**2]
    return [tuple(together)] if together else []


def _order(names: Column) -> Floats:
    """(N,) rank of each row's session: names that are numbers first, in order of the number, then the others as texts."""
    known = sorted({str(name) for name in names}, key=lambda n: (0, int(n), n) if n.isdecimal() else (1, 0, n))
    return np.array([known.index(str(name)) for name in names], dtype=float)


def _sessions(at: OperatingPoints, priors: Priors) -> Iterator[tuple[Column, ...]]:
    """New sessions after pauses; where there is no pause, one or two new sessions at tried instants."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if clock is None:
        return
    values, begun = at.covariate(clock), [pauses(at, priors)]
    if not len(begun[0]):
        once, twice = (np.arange(1, n + 1) / (n + 1) for n in (BREAKS, TWO_BREAKS))
        places = [*once[:, None], *(np.array(pair) for pair in combinations(twice, 2))]
        begun = [np.quantile(values, shares) for shares in places]
    for since in begun:
        yield (np.searchsorted(since, values, side="right").astype(str).astype(object),)


def pauses(at: OperatingPoints, priors: Priors = PRIORS) -> Floats:
    """Ends of the longest pauses between visits, s, in the order of time."""
    if not at.varies("time"):
        return np.zeros(0)
    time = np.sort(at.covariate("time"))
    waits = np.diff(time)
    longest = np.sort(np.argsort(-waits)[:MOST_PAUSES])
    # Not the median: it is 0 where a clock shows whole minutes only and most visits follow within a minute.
    usual = np.sort(waits)[: max(int(SHORT * len(waits)), 1)].mean()
    return np.asarray(time[1:][longest[waits[longest] > priors.pause * max(float(usual), 1e-9)]])


def further_loads(at: OperatingPoints, priors: Priors = PRIORS) -> list[OperatingPoints]:
    """Situations with a payload beyond the recorded one in one interval of time each; none without a column of time."""
    clock = next((n for n in CLOCKS if at.varies(n)), None)
    if clock is None:
        return []
    recorded = at.covariate("payload") if "payload" in at.covariates else np.zeros(len(at))
    spell = np.argsort(np.argsort(at.covariate(clock))) * SPELLS // len(at)
    return [at.with_covariate("payload", recorded + np.where(spell == k, priors.payload, 0.0)) for k in range(SPELLS)]
