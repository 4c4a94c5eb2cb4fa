"""All effects of the catalogue, as a diagnosis takes them."""

from gtpin.diagnosis.hypotheses.hypothesis import Scope
from gtpin.effects.catalogue import catalogue


def every_effect(false_alarm: float = 0.01) -> Scope:
    return Scope(catalogue(), frozenset(), false_alarm)
