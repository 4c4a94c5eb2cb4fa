"""The third step of a diagnosis: from hypotheses to a conclusion."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from gtpin.diagnosis.inference.chance_lines import chance_lines
from gtpin.diagnosis.inference.named_causes import decide, with_restless
from gtpin.diagnosis.inference.reestimate_noise import reestimate_noise, restless_drive
from gtpin.diagnosis.inference.settle import Settled
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.posterior import NOTHING


def infer(settled: Settled, barred: Collection[tuple[str, str]] = ()) -> Conclusion:
    """Search, compare named causes with smooth terms, and look for an actuator whose errors change too fast for these terms.

    Parameters
    ----------
    barred
        Effects and sites that cannot be causes.
    """
    hypotheses = settled.hypotheses
    found, scattered = _without_chance_lines(settled, barred)
    if found.doubts:
        return found
    site = restless_drive(hypotheses, found.model, scattered) if scattered else None
    if site is None:
        site = reestimate_noise(settled.observed, hypotheses, found.model).restless
    return found if site is None else with_restless(hypotheses, found, site)


def _without_chance_lines(settled: Settled, barred: Collection[tuple[str, str]]) -> tuple[Conclusion, tuple[str, ...]]:
    """The conclusion of a search without periodic errors that scatter alone would show, and the sites of these."""
    hypotheses, scattered = settled.hypotheses, set[tuple[str, str]]()
    found = _decided(settled, {*barred})
    while chance := chance_lines(hypotheses, found):
        scattered |= {cause.place for cause in chance}
        found = _decided(settled, {*barred, *scattered})
    alone = hypotheses.gains(NOTHING, hypotheses.every)
    return replace(found, alone=alone), tuple(sorted({site for _, site in scattered}))


def _decided(settled: Settled, barred: Collection[tuple[str, str]]) -> Conclusion:
    if not barred:
        return decide(settled.hypotheses, settled.guess)
    allowed, guess = settled.hypotheses.barring(barred), settled.guess
    return decide(allowed, allowed.only(guess, [t for t in guess.terms if getattr(t, "place", None) not in barred]))
