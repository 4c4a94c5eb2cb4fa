"""Effects that a controller can correct by tables of single actuators, and drive scales."""

from __future__ import annotations

from dataclasses import replace

from gtpin.compensation.machine import CompensatedMachine
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import number
from gtpin.model.model import Model


def correctable(model: Model, session: str | None = None) -> tuple[ActiveEffect, ...]:
    """Effects along an actuator that depend only on its position, its direction of approach, and, if given, the session."""
    known = () if session is None else ("session",)
    robot = model.robot
    found = []
    for active in model.effects:
        if active.site in robot.sites:
            i = number(robot, active.site)
            own = {f"q{i}", f"approach{i}", *known}
            if set(active.effect.coordinates(robot, active.site)) <= own and _moves_along(model, active):
                found.append(active)
    return tuple(found)


def geometric_scales(model: Model) -> dict[str, float]:
    """Travel per command of each drive by site, from the geometry alone."""
    scales = dict.fromkeys(model.robot.sites, 1.0)
    for parameter, deviation in model.geometry.all_deviations:
        if parameter.kind == "scale" and parameter.part in scales:
            scales[parameter.part] += deviation
    return scales


def _moves_along(model: Model, active: ActiveEffect) -> bool:
    """Whether an effect moves its actuator in the actuator's own direction, as straightness does not."""
    q, known = model.robot.home_q[None], CompensatedMachine(replace(model, effects=(active,))).columns(1)
    at = OperatingPoints(model.kinematics, q, model.kinematics.forward(q), known, active.references)
    return active.basis(at).command is not None


def drive_scales(model: Model) -> tuple[dict[str, float], set[str]]:
    """Travel per command of each drive by site, from a model's scales and ``encoder_scale``, and the names of the parts of the
    model that these scales represent."""
    scales = geometric_scales(model)
    carried = set()
    for active in model.effects:
        if active.effect.exported_as == "drive_scale":
            scales[active.site] *= (
                1.0 + active.effect.parameters(active.coefficients, active.shape_parameter)["scale"][0]
            )
            carried.add(active.name)
    return scales, carried | {"drive scales"}
