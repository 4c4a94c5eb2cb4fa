"""Where the gap lies, before any cause is named: by rod, site, axis, covariate and region."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.findings import Correlate, Unexplained
from gtpin.diagnosis.hypothesis import Hypothesis, SmoothTerm
from gtpin.diagnosis.hypothesis_set import Explanation, Gain, HypothesisSet, Term
from gtpin.diagnosis.posterior import given
from gtpin.diagnosis.proxies import Proxy
from gtpin.diagnosis.smooth_terms import COMMON
from gtpin.distributions import chi2
from gtpin.instruments.readings import Readings
from gtpin.typing import Floats, Mask


@dataclass(frozen=True)
class Where:
    """Where the gap lies, after the geometry alone was fitted.

    Shares sum to 1, or are all zero where there is no gap.

    ``rod``, ``axis``: by name: shares of the gap's mean square beyond noise. ``rod``: in the closure residuals of the rods.
    ``axis``: in the whitened components of the pose or the readings. ``site``: by name: shares of the largest gain in log
    evidence at each site, by an effect or a smooth term alone. Common motions and proxies are left out. ``covariate``: by name:
    the largest gain in log evidence of a smooth term over it, relative to the best covariate; not shares. ``region``: boxes (2,
    3), m, base frame, and the share of the gap's mean square beyond noise in each.
    """

    rod: dict[str, float]
    site: dict[str, float]
    axis: dict[str, float]
    covariate: dict[str, float]
    region: tuple[tuple[Floats, float], ...]


def where(hypotheses: HypothesisSet, alone: Mapping[Term, Gain], blocks: list[Mask]) -> Where:
    """Divide the gap that the geometry alone leaves into shares.

    ``alone``: gain in log evidence of each term as the only one. ``blocks``: (N,) masks of the poses of each region.
    """
    design = hypotheses.design
    residual = design.y - design.B @ hypotheses.groups.marginal.deviation(design.y)
    c = design.components
    whitened = residual.reshape(-1, c)
    excess = whitened**2 - design.independent
    axis = _shares(_by_reading(design.measured, excess))
    by_pose = excess.sum(axis=1)
    T = design.operating_points.poses.T
    regions = _shares({str(k): float(by_pose[b].sum()) for k, b in enumerate(blocks)})
    boxes = tuple(
        (np.stack([T[b].min(axis=0), T[b].max(axis=0)]), regions[str(k)]) for k, b in enumerate(blocks) if b.any()
    )
    rods = {}
    if design.measured.tracked:
        rods = design.operating_points.rod_shares(
            design.coloured(whitened), np.asarray(np.linalg.inv(design.whitening))
        )
    return Where(rods, _sites(alone), axis, _covariates(alone), boxes)


def _by_reading(readings: Readings, excess: Floats) -> dict[str, float]:
    """Power beyond noise of each instrument's components, by name, divided by the number of rows."""
    found: dict[str, float] = {}
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        for k, component in enumerate(one.components):
            if readings.components == 1 and len(one.components) > 1:
                power = excess[mine & (readings.rows.component == k)].sum()
            else:
                power = excess[mine][:, k].sum()
            found[one.label(component)] = float(power) / len(excess)
    return found


def _sites(alone: Mapping[Term, Gain]) -> dict[str, float]:
    """Shares of the largest gain at each site, by an effect or a smooth term; proxies and common motions are left out."""
    best: dict[str, float] = {}
    for term, gain in alone.items():
        if isinstance(term, Proxy) or (isinstance(term, SmoothTerm) and term.motion in COMMON):
            continue
        best[term.site] = max(best.get(term.site, 0.0), gain.value)
    return _shares(best)


def _covariates(alone: Mapping[Term, Gain]) -> dict[str, float]:
    """Largest gain of a smooth term over each coordinate, relative to the largest of all."""
    best: dict[str, float] = {}
    for term, gain in alone.items():
        for coordinate in term.over if isinstance(term, SmoothTerm) else ():
            best[coordinate] = max(best.get(coordinate, 0.0), gain.value)
    top = max(best.values(), default=0.0)
    return {name: (gain / top if top > 0.0 else 0.0) for name, gain in best.items()}


def _shares(power: Mapping[str, float]) -> dict[str, float]:
    positive = {name: max(float(value), 0.0) for name, value in power.items()}
    total = sum(positive.values())
    return {name: (value / total if total > 0.0 else 0.0) for name, value in positive.items()}


CORRELATES = 5
"""Most sites and coordinates that are reported."""


def unexplained(hypotheses: HypothesisSet, model: Explanation, unknown: bool) -> Unexplained:
    """Chi-square of the residuals of a model, and the smooth terms that correlate with them.

    ``model``: the named causes. ``unknown``: whether something unknown is assumed as well.
    """
    groups, design = hypotheses.groups, hypotheses.design
    power = marginal_power(hypotheses, model)
    gram = np.vstack([np.zeros((0, len(model.mean))), *(groups.across(n, model.terms) for n in model.terms)])
    effective_parameters = float(np.einsum("ij,ji->", model.covariance, gram))
    dof = max(design.dof - effective_parameters, 1.0)
    excess = groups.power - design.dof
    correlates, most = dict[tuple[str, tuple[str, ...]], Correlate](), 0.0
    gains = hypotheses.gains(model, hypotheses.smooth)
    for smooth in sorted(gains, key=lambda s: -gains[s].value):  # p-values of several may be 0
        if len(correlates) == CORRELATES:
            break
        if (smooth.site, smooth.over) in correlates:  # of several motions of a site over the same coordinates, the best
            continue
        own, seen = given(groups, model, smooth)
        values, vectors = np.linalg.eigh(own)
        kept = values > 1e-6 * max(float(values.max()), 1e-300)
        statistic = float(((vectors.T @ seen)[kept] ** 2 / values[kept]).sum())
        p_value = float(chi2.sf(statistic, kept.sum()))
        if p_value < hypotheses.priors.seen:
            most = most if correlates else gains[smooth].value
            odds = float(np.exp((gains[smooth].value - most) / hypotheses.priors.heat(most)))
            correlates[smooth.site, smooth.over] = Correlate(smooth.site, smooth.words, p_value, smooth.motion, odds)
    share = float(np.clip((power - dof) / excess, 0.0, 1.0)) if excess > 1e-9 else 0.0
    best = tuple(correlates.values())
    could_be = (*_could_be(hypotheses, model), *_untried(hypotheses, best[:1])) if unknown else ()
    return Unexplained(share, float(chi2.sf(power, dof)), best, could_be)


def marginal_power(hypotheses: HypothesisSet, model: Explanation) -> float:
    """Chi-square of the residual with geometry and a model's causes marginalised: y' (I + B B' + sum_k s_k^2 E_k E_k')^-1 y."""
    moment = np.concatenate([np.zeros(0), *(hypotheses.groups.moment(n) for n in model.terms)])
    return hypotheses.groups.power - float(moment @ model.mean)


def _could_be(hypotheses: HypothesisSet, model: Explanation) -> tuple[tuple[str, str], ...]:
    """Effect and site of untestable effects whose proxies gain nearly as much as the best smooth term, the best first."""
    priors = hypotheses.priors
    best = max((gain.value for gain in hypotheses.gains(model, hypotheses.smooth).values()), default=0.0)
    gains = hypotheses.gains(model, hypotheses.proxies)
    enough = [
        p
        for p in sorted(gains, key=lambda p: -gains[p].value)
        if gains[p].value >= max(priors.accounts * best, priors.surely)
    ]
    taken = {term.place for term in model.terms if isinstance(term, Hypothesis)}
    return tuple(p.hypothesis.place for p in enough if p.hypothesis.place not in taken)


def _untried(hypotheses: HypothesisSet, best: Sequence[Correlate]) -> list[tuple[str, str]]:
    """Effect and site of effects at the site of the ``best`` smooth term that lack a covariate and have no proxy.

    Nothing in these data speaks for or against them.
    """
    tried, sites = {proxy.hypothesis.place for proxy in hypotheses.proxies}, {one.site for one in best}
    untested = (u.hypothesis.place for u in hypotheses.untested if u.reason.kind in ("missing", "unusable"))
    return [place for place in untested if place[1] in sites and place not in tried]
