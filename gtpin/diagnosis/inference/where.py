"""Where the gap lies, before any cause is named: by rod, site, axis, covariate and region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import SmoothTerm
from gtpin.diagnosis.hypotheses.hypothesis_set import Gain, HypothesisSet, Term
from gtpin.diagnosis.hypotheses.proxies import Proxy
from gtpin.diagnosis.hypotheses.smooth_terms import COMMON
from gtpin.diagnosis.linear.design import Design
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
    left = design.y - design.B @ hypotheses.groups.marginal.deviation(design.y)
    c = design.components
    whitened = left.reshape(-1, c)
    excess = whitened**2 - design.independent
    axis = _shares(_by_reading(design.measured, excess))
    by_pose = excess.sum(axis=1)
    T = design.situation.poses.T
    regions = _shares({str(k): float(by_pose[b].sum()) for k, b in enumerate(blocks)})
    boxes = tuple(
        (np.stack([T[b].min(axis=0), T[b].max(axis=0)]), regions[str(k)]) for k, b in enumerate(blocks) if b.any()
    )
    return Where(_rods(design, whitened), _sites(alone), axis, _covariates(alone), boxes)


def _rods(design: Design, whitened: Floats) -> dict[str, float]:
    """Shares of the rods: residual and noise mapped to the rods by the closures' Jacobian. Empty without rods or poses."""
    at = design.situation
    if not at.robot.rods or not design.measured.tracked:
        return {}
    seen = np.linalg.inv(design.whitening)
    to_rods = np.linalg.inv(at.response[:, :6])[:, :, : design.components] @ seen
    power = (np.einsum("nkc,nc->nk", to_rods, whitened) ** 2).mean(axis=0) - (to_rods**2).sum(axis=2).mean(axis=0)
    return _shares(dict(zip(at.robot.rod_sites, power, strict=True)))


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
