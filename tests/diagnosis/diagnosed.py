"""Machines with hidden faults, drawn by the plant, and what is said of them: each diagnosed once."""

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import gtpin
from gtpin.bench.simulator import Case, make_case
from gtpin.diagnosis.result import Diagnosis

LARGE = 1500.0
"""Energy, twice the log likelihood at stake, at which a fault is hard to overlook."""
POSES = 120


def quietly(call: Callable[..., Any], *given: Any, **options: Any) -> Any:
    """What a call returns, without its warnings: of poses that a large fault makes look like gross errors, ..."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        return call(*given, **options)


@cache
def machine(seed: int, effect: str | None = None, site: str | None = None, noncentrality: float = LARGE) -> Case:
    return make_case(seed, effects=[(effect, site)] if effect else [], noncentrality=noncentrality, poses=POSES)


@cache
def said(
    seed: int,
    effect: str | None = None,
    site: str | None = None,
    noncentrality: float = LARGE,
    exclude: tuple[str, ...] = (),
) -> Diagnosis:
    return quietly(gtpin.diagnose, machine(seed, effect, site, noncentrality).dataset, exclude=exclude)


def classes(found: Diagnosis) -> set[tuple[str, str]]:
    """Every effect and site that could be a cause."""
    return {(m.effect, m.site) for c in found.causes for m in c.members}
