"""A plan of poses as the content of ``plan.json``."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from gtpin.health.plan import PosePlan


def plan_json(plan: PosePlan) -> dict[str, Any]:
    """The content of ``plan.json``; docs/health.md explains the keys."""
    found: dict[str, Any] = {
        "schema": "gtpin-plan/1",
        "for": plan.purpose,
        "robot": plan.model.robot.name,
        "poses": len(plan.commands),
        "frame": plan.frame,
        "noise": {
            "position_sigma": plan.noise.position_sigma,
            "orientation_sigma": plan.noise.orientation_sigma,
            "drives": plan.noise.along_drives,
        },
    }
    if plan.purpose == "health":
        found |= {"false_alarm": plan.false_alarm, "power": plan.power, "threshold": plan.threshold}
        found["smallest"] = [asdict(one) for one in plan.smallest]
    elif plan.purpose == "discrimination":
        found["told"] = [asdict(one) for one in plan.told]
    elif plan.information is not None:
        found |= asdict(plan.information)
    return found
