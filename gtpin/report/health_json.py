"""A check against an earlier model as the content of ``diagnosis.json``."""

from __future__ import annotations

from typing import Any

from gtpin.diagnosis.result import HealthCheck
from gtpin.report.diagnosis_json import diagnosis_json


def health_json(check: HealthCheck) -> dict[str, Any]:
    """The content of ``diagnosis.json``: that of a diagnosis, and the key ``against``."""
    found = diagnosis_json(check)
    found["gap"]["method"] = "each pose left out in turn, and predicted by the earlier model and all other poses"
    found["against"] = {
        "robot": check.baseline.robot.name,
        "poses": check.poses,
        "set_aside": list(check.set_aside),
        "frame": "free" if check.free_frame else "robot",
        "false_alarm": check.false_alarm,
        "threshold": check.threshold,
        "power": check.power,
        "assumed": list(check.assumed),
        "unexplained": {
            "position": check.unexplained_before.position,
            "orientation": check.unexplained_before.orientation,
            "noise_known": check.noise_known,
        },
        "smallest": [
            {"effect": s.effect, "site": s.site, "parameter": s.parameter, "value": s.value, "unit": s.unit}
            for s in check.smallest
        ],
    }
    return found
