"""A diagnosis as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from gtpin.diagnosis.result import Diagnosis


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """The content of ``diagnosis.json``."""
    none = diagnosis.verdict == "none"
    return {
        "schema": "gtpin-diagnosis/1",
        "verdict": diagnosis.verdict,
        "causes": [
            {
                "effect": c.effect,
                "site": c.site,
                "probability": c.probability,
                "class": [{"effect": m.effect, "site": m.site, "probability": m.probability} for m in c.members],
                "parameters": {
                    n: {"value": e.value, "sigma": e.sigma, "unit": e.unit} for n, e in c.parameters.items()
                },
                "shrinkage": c.shrinkage,
            }
            for c in diagnosis.causes
        ],
        "candidates": [
            {
                "effect": c.effect,
                "site": c.site,
                "log_evidence": c.log_evidence,
                "probability": c.probability,
                "testable": c.testable,
                "reason": c.reason,
            }
            for c in diagnosis.candidates
        ],
        "where": {
            "rod": diagnosis.where.rod,
            "site": diagnosis.where.site,
            "axis": diagnosis.where.axis,
            "covariate": diagnosis.where.covariate,
            "region": [{"box": np.asarray(box).tolist(), "share": share} for box, share in diagnosis.where.region],
        },
        "gap": {
            "position_rms_before": diagnosis.gap.before,
            "position_rms_after": diagnosis.gap.after,
            "noise_floor": diagnosis.gap.floor,
            "shrinkage": None if none else diagnosis.gap.shrinkage,
            "interval": None if none or diagnosis.gap.interval is None else list(diagnosis.gap.interval),
            "method": "four neighbouring poses left out in turn; "
            "interval: what 120 other poses may show, by the uncertainty of what was fitted",
        },
        "unexplained": {
            "share": diagnosis.unexplained.share,
            "p_value": diagnosis.unexplained.p_value,
            "correlates": [
                {"site": site, "covariate": coordinates, "p_value": p}
                for site, coordinates, p in diagnosis.unexplained.correlates
            ],
            "could_be": [{"effect": effect, "site": site} for effect, site in diagnosis.unexplained.could_be],
            "questions": [
                {
                    "effect": q.effect,
                    "site": q.site,
                    "parameter": q.parameter,
                    "value": q.value,
                    "sigma": q.sigma,
                    "unit": q.unit,
                    "expected": [q.low if np.isfinite(q.low) else None, q.high if np.isfinite(q.high) else None],
                    "why": q.why,
                    "believed": q.believed,
                }
                for q in diagnosis.questions
            ],
        },
        "next_experiment": [e.to_json() for e in diagnosis.next_experiment],
    }
