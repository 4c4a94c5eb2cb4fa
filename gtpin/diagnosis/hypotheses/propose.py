"""Which effects a dataset can show, and why it can't show the others."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from gtpin.diagnosis.hypotheses.common_motions import common_motions
from gtpin.diagnosis.hypotheses.hypothesis import Candidate
from gtpin.diagnosis.hypotheses.hypothesis_set import Pool
from gtpin.diagnosis.hypotheses.smooth_terms import free_motions
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.evidence import Marginal
from gtpin.diagnosis.result import Considered
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.effect import Effect
from gtpin.effects.untestable import Untestable, as_untestable
from gtpin.errors import ModelError
from gtpin.robot.robot import Robot

LARGE = 10.0
"""Times its usual size, at which an effect that geometry absorbs nearly whole can't be shown."""
SHOWS = 15.8
"""Whitened energy past geometry that a matched filter needs for 95 % at 1 % false alarms."""


def check_excluded(exclude: Collection[str], robot: Robot) -> Collection[str]:
    """Words ``effect`` or ``effect@site`` as they are.

    Raises
    ------
    ModelError
        If there is no such effect, or it has no such site.
    """
    known = effects_by_id()
    for word in exclude:
        named, at, place = word.partition("@")
        if named not in known or (at and not place):
            raise ModelError(f"no effect is called {word!r}", hint=f"effects are {', '.join(known)}")
        if place and place not in known[named].sites(robot):
            sites = ", ".join(known[named].sites(robot))
            raise ModelError(f"no effect is called {word!r}", hint=f"sites of {named} are {sites}")
    return exclude


def make_pool(design: Design, exclude: Collection[str], false_alarm: float) -> tuple[Pool, tuple[Considered, ...]]:
    """Testable candidates, and what is said of the others."""
    at = design.situation
    marginal = Marginal(design.B)
    plain, scanned, untestable, others = {}, [], [], []
    for effect in effects_by_id().values():
        for site in effect.sites(at.robot):
            if effect.id in exclude or f"{effect.id}@{site}" in exclude:
                continue
            reason = as_untestable(effect.untestable(at, site))
            many = 0 if reason else len(effect.nonlinear_values(at, site))
            if reason is None and not many and _absorbed(design, marginal, effect, site):
                reason = Untestable("absorbed")
            if reason:
                untestable.append(Considered(effect.id, site, 0.0, 0.0, False, reason))
                others.append(Candidate(effect, site))
            elif many:
                scanned.append(Candidate(effect, site))
            else:
                plain[f"{effect.id}@{site}"] = Candidate(effect, site)
    scaled = any(candidate.effect.stretches_frame for candidate in plain.values())
    frees = (*free_motions(at), *common_motions(at, scaled))
    return Pool(design, plain, tuple(scanned), frees, false_alarm, tuple(others)), tuple(untestable)


def _absorbed(design: Design, marginal: Marginal, effect: Effect, site: str) -> bool:
    """Whether geometry takes nearly all of an effect far beyond its usual size."""
    X = design.columns(effect.basis(design.situation, site)) * LARGE
    return float(np.trace(marginal.product(X, X))) <= SHOWS
