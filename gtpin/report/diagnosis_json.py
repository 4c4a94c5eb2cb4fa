"""A diagnosis as the content of ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from gtpin.diagnosis.gap import BLOCK_POSES, PREDICTED_POSES
from gtpin.diagnosis.result import Cause, Diagnosis, Gap, HealthCheck, Member
from gtpin.effects.sites import joints
from gtpin.report.geometry import departures_of
from gtpin.report.phrases import reason_words
from gtpin.report.why import why_json
from gtpin.report.words import number_word


def diagnosis_json(d: Diagnosis | HealthCheck) -> dict[str, Any]:
    """The content of ``diagnosis.json``."""
    none, where, unexplained, best = d.verdict == "none", d.where, d.unexplained, d.unexplained.best_known
    geometry = [
        _of(one, "value", "sigma", "unit", "position_rms") | {"parameter": one.name}
        for one in (departures_of(d) if isinstance(d, Diagnosis) else ())
    ]
    regions = [{"box": np.asarray(box).tolist(), "share": share} for box, share in where.region]
    return {
        "schema": "gtpin-diagnosis/1",
        "verdict": d.verdict,
        "causes": [_cause(c) for c in d.causes],
        "also": [_of(one, "site", "rms") | {"class": _class(one.members)} for one in d.also],
        "candidates": [
            _of(c, "effect", "site", "log_evidence", "probability", "testable")
            | {"reason": reason_words(c.reason, c.site)}
            for c in d.candidates
        ],
        "where": _of(where, "rod", "site", "axis", "covariate") | {"region": regions, "geometry": geometry},
        "gap": {
            **_errors(d.gap),
            "shrinkage": None if none else d.gap.explained_fraction,
            "interval": None if none or d.gap.interval is None else list(d.gap.interval),
            "method": gap_method(d.gap),
            **_turns(d),
        },
        "unexplained": {
            **_of(unexplained, "share", "p_value"),
            "correlates": [
                {"site": o.site, "covariate": o.coordinates, "p_value": o.p_value} for o in unexplained.correlates
            ],
            "descriptions": [
                _of(t, "effect", "site") | {"over": list(t.over)} | _of(t, "rms", "probability")
                for t in unexplained.descriptions
            ],
            "could_be": [_place(place) | {"position_rms_after": left} for place, left in unexplained.could_be.items()],
            "leaders": [_of(one, "effect", "site", "log_evidence", "left") for one in unexplained.leaders],
            "best_known": best and {"effects": [_place(place) for place in best.effects], "left": best.left},
            "jumps": list(unexplained.jumps),
            "questions": [
                _of(q, "effect", "site", "parameter", "value", "sigma", "unit")
                | {"expected": [end if np.isfinite(end) else None for end in (q.low, q.high)]}
                | _of(q, "why", "believed")
                for q in d.questions
            ],
        },
        "rows": d.dataset.rows_used,
        "next_experiment": [e.to_json() for e in d.next_experiment],
        "warnings": list(d.warnings),
        **({"why": why_json(d, d.why)} if isinstance(d, Diagnosis) and d.why is not None else {}),
    }


def _of(one: object, *names: str) -> dict[str, Any]:
    return {name: getattr(one, name) for name in names}


def _place(place: tuple[str, str]) -> dict[str, str]:
    return dict(zip(("effect", "site"), place, strict=True))


def _class(members: Iterable[Member]) -> list[dict[str, Any]]:
    return [_of(m, "effect", "site", "probability") for m in members]


def _cause(c: Cause) -> dict[str, Any]:
    return {
        **_of(c, "effect", "site", "probability"),
        "class": _class(c.members),
        "parameters": {name: _of(e, "value", "sigma", "unit") for name, e in c.parameters.items()},
        "shrinkage": c.explained_fraction,
        "nature": c.nature,
        "share": c.share,
    }


def _errors(gap: Gap) -> dict[str, Any]:
    """Position errors, those of the first tracker where there are several instruments, and errors of each instrument."""
    known, by_instrument = ("before", "after", "floor", "inferred"), gap.by_instrument
    keys = ("position_rms_before", "position_rms_after", "noise_floor", "noise_inferred")
    whose = next((one for one in by_instrument if one.kind == "tracker"), None) if by_instrument else gap
    found: dict[str, Any] = {key: getattr(whose, name, None) for key, name in zip(keys, known, strict=True)}
    if by_instrument:
        keys = ("rms_before", "rms_after", "noise_floor", "noise_inferred")
        found["by_instrument"] = {
            one.name: {key: getattr(one, name) for key, name in zip(keys, known, strict=True)} | {"unit": one.unit}
            for one in by_instrument
        }
    return found


def gap_method(gap: Gap) -> str:
    """How the gap on left-out poses was computed, in words."""
    left_out = {
        "region": f"{number_word(BLOCK_POSES)} neighbouring poses",
        "session": f"each of {gap.blocks} sessions",
        "time": f"each of {gap.blocks} stretches of time",
        "random": f"{number_word(BLOCK_POSES)} poses drawn at random",
    }
    fitted = "by the uncertainty of what was fitted"
    other = f"what {PREDICTED_POSES} other poses may show, {fitted}"
    if gap.hold_out == "session":
        other = f"what another session may show, {fitted} and how much the {gap.blocks} differ"
    if gap.sessions < 2:
        other += "; the data are of one session, as far as is known, so that the interval ignores changes between days"
    return f"{left_out[gap.hold_out]} left out in turn; interval: {other}"


def _turns(d: Diagnosis | HealthCheck) -> dict[str, float]:
    """Orientation errors on left-out poses, rad; only for robots without rods, whose wrists rotate the tool and hardly shift
    it."""
    if d.gap.turns is None or not joints(d.model.robot):
        return {}
    before, after, floor = d.gap.turns.before, d.gap.turns.after, d.gap.turns.floor
    return {"orientation_rms_before": before, "orientation_rms_after": after, "orientation_noise_floor": floor}
