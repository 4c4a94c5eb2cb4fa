"""A diagnosis as the content of ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from gtpin.diagnosis.inference.findings import Member
from gtpin.diagnosis.linear.cross_validation import ASKED, TOGETHER, Gap
from gtpin.diagnosis.result import Diagnosis, HealthCheck
from gtpin.report.phrases import reason_words
from gtpin.report.words import number_word


def diagnosis_json(d: Diagnosis | HealthCheck) -> dict[str, Any]:
    """The content of ``diagnosis.json``."""
    none = d.verdict == "none"
    return {
        "schema": "gtpin-diagnosis/1",
        "verdict": d.verdict,
        "causes": [
            {
                "effect": c.effect,
                "site": c.site,
                "probability": c.probability,
                "class": _class(c.members),
                "parameters": {
                    n: {"value": e.value, "sigma": e.sigma, "unit": e.unit} for n, e in c.parameters.items()
                },
                "shrinkage": c.explained_fraction,
                "nature": c.nature,
            }
            for c in d.causes
        ],
        "also": [{"site": one.site, "rms": one.rms, "class": _class(one.members)} for one in d.also],
        "candidates": [
            {
                "effect": c.effect,
                "site": c.site,
                "log_evidence": c.log_evidence,
                "probability": c.probability,
                "testable": c.testable,
                "reason": reason_words(c.reason, c.site),
            }
            for c in d.candidates
        ],
        "where": {
            "rod": d.where.rod,
            "site": d.where.site,
            "axis": d.where.axis,
            "covariate": d.where.covariate,
            "region": [{"box": np.asarray(box).tolist(), "share": share} for box, share in d.where.region],
        },
        "gap": {
            **_errors(d.gap),
            "shrinkage": None if none else d.gap.explained_fraction,
            "interval": None if none or d.gap.interval is None else list(d.gap.interval),
            "method": gap_method(d.gap),
            **_turns(d),
        },
        "unexplained": {
            "share": d.unexplained.share,
            "p_value": d.unexplained.p_value,
            "correlates": [
                {"site": site, "covariate": coordinates, "p_value": p}
                for site, coordinates, p in d.unexplained.correlates
            ],
            "descriptions": [
                {"effect": t.effect, "site": t.site, "over": list(t.over), "rms": t.rms, "probability": t.probability}
                for t in d.unexplained.descriptions
            ],
            "could_be": [{"effect": effect, "site": site} for effect, site in d.unexplained.could_be],
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
                for q in d.questions
            ],
        },
        "next_experiment": [e.to_json() for e in d.next_experiment],
        "warnings": list(d.warnings),
    }


def _class(members: Iterable[Member]) -> list[dict[str, Any]]:
    return [{"effect": m.effect, "site": m.site, "probability": m.probability} for m in members]


def _errors(gap: Gap) -> dict[str, Any]:
    """Position errors, those of the first tracker where there are several instruments, and errors of each instrument."""
    if not gap.by_instrument:
        return {
            "position_rms_before": gap.before,
            "position_rms_after": gap.after,
            "noise_floor": gap.floor,
            "noise_inferred": gap.inferred,
        }
    tracker = next((one for one in gap.by_instrument if one.kind == "tracker"), None)
    return {
        "position_rms_before": tracker.before if tracker else None,
        "position_rms_after": tracker.after if tracker else None,
        "noise_floor": tracker.floor if tracker else None,
        "noise_inferred": tracker.inferred if tracker else None,
        "by_instrument": {
            one.name: {
                "rms_before": one.before,
                "rms_after": one.after,
                "noise_floor": one.floor,
                "noise_inferred": one.inferred,
                "unit": one.unit,
            }
            for one in gap.by_instrument
        },
    }


def gap_method(gap: Gap) -> str:
    """How the gap on left-out poses was computed, in words."""
    left_out = {
        "region": f"{number_word(TOGETHER)} neighbouring poses",
        "session": f"each of {gap.blocks} sessions",
        "time": f"each of {gap.blocks} stretches of time",
        "random": f"{number_word(TOGETHER)} poses drawn at random",
    }
    other = f"what {ASKED} other poses may show, by the uncertainty of what was fitted"
    if gap.hold_out == "session":
        other = (
            f"what another session may show, by the uncertainty of what was fitted and how much the {gap.blocks} differ"
        )
    only = f"; {ONE_SESSION}" if gap.sessions < 2 else ""
    return f"{left_out[gap.hold_out]} left out in turn; interval: {other}{only}"


ONE_SESSION = "the data are of one session, as far as they tell, so that the interval ignores what another day brings"


def _turns(d: Diagnosis | HealthCheck) -> dict[str, float]:
    """Orientation errors on left-out poses, rad; only for robots without rods, whose wrists rotate the tool and hardly shift
    it."""
    if d.gap.turns is None or d.model.robot.rods:
        return {}
    return {
        "orientation_rms_before": d.gap.turns.before,
        "orientation_rms_after": d.gap.turns.after,
        "orientation_noise_floor": d.gap.turns.floor,
    }
