"""The third step of a diagnosis: from hypotheses to a conclusion."""

from __future__ import annotations

from gtpin.diagnosis.inference.named_causes import decide, with_restless
from gtpin.diagnosis.inference.reestimate_noise import reestimate_noise
from gtpin.diagnosis.inference.settle import Settled
from gtpin.diagnosis.inference.verdict import Conclusion


def infer(settled: Settled) -> Conclusion:
    """Search, compare named causes with smooth terms, and look for an actuator whose errors change too fast for these terms."""
    hypotheses = settled.hypotheses
    found = decide(hypotheses, settled.guess)
    if found.doubts:
        return found
    site = reestimate_noise(settled.observed, hypotheses, found.model, settled.declared).restless
    return found if site is None else with_restless(hypotheses, found, site)
