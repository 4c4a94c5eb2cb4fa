"""Which effects a dataset can test, and why it can't test the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import comb, log

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from gtpin.diagnosis.design import Design
from gtpin.diagnosis.evidence import Groups, Marginal
from gtpin.diagnosis.hypothesis import Hypothesis, Scope
from gtpin.diagnosis.hypothesis_set import HypothesisSet, Untested
from gtpin.diagnosis.posterior import NOTHING, fixed, gain
from gtpin.diagnosis.priors import Priors
from gtpin.diagnosis.smooth_terms import smooth_terms
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.untestable import Untestable, as_untestable
from gtpin.model.fit_conditions import TEMPERATURES
from gtpin.typing import Floats

FEWEST = 2
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
            # Whether geometry or uncertainty of the model absorb nearly all even of many times the typical size.
            X = design.columns(basis) * scope.priors.large
            if float(np.trace(marginal.product(X, X))) <= scope.priors.shows:
                reason = Untestable("uncertain" if changes else "absorbed")
        if reason:
            untested.append(Untested(hypothesis, reason))
        else:
            (scanned if many else linear).append(hypothesis)
    if changes:
        return HypothesisSet(design, linear, (), (), scope, untested, proxied=False)
    design, odds = merged_sessions(design, marginal, linear, scope.priors)
    at = design.operating_points
    scaled = any(hypothesis.effect.stretches_frame for hypothesis in linear)
    smooth = tuple(smooth_terms(at, scope.priors, scaled))
    return HypothesisSet(design, linear, scanned, smooth, scope, untested, of_sessions=odds)


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
    if len(labels) <= FEWEST or not at.varies("session"):
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

    while len(found) > FEWEST:
        tried = [equal(a, b) for a, b in pairwise(found)]
        best = int(np.argmax([ratio for ratio, *_ in tried]))
        ratio, gain_, own, other = tried[best]
        if ratio <= 0.0:
            break
        mean = mean - gain_ @ (mean[own] - mean[other])
        covariance = covariance - gain_ @ (covariance[own] - covariance[other])
        found[best : best + 2] = [found[best] + found[best + 1]]
    return found
