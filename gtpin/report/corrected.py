"""Causes that a controller with the calibrated geometry can correct by itself, with tables that ``gtpin export`` writes."""

from __future__ import annotations

from gtpin.compensation.corrections import correctable
from gtpin.diagnosis.result import Diagnosis
from gtpin.report.phrases import SURE
from gtpin.report.words import site_words


def sure_corrections(d: Diagnosis) -> list[str]:
    """Certain causes that tables for single actuators can correct, as text."""
    sure = {(c.effect, c.site) for c in d.causes if c.probability >= SURE}
    kept = [active for active in correctable(d.model) if (active.effect.id, active.site) in sure]
    return [f"{active.effect.id} at {site_words(active.site)}" for active in kept]
