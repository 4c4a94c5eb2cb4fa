"""A model's rod compliance as springs of a mechanism, and its drive scales as scales of its drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from gtpin.effects.active import ActiveEffect
from gtpin.export.lines import STIFFEST, line
from gtpin.export.loss import conditions
from gtpin.export.mechanism import Joint, Mechanism, Spring
from gtpin.kinematics.posture import home
from gtpin.model.model import Model
from gtpin.robot.robot import Robot
from gtpin.robot.rods import Rod
from gtpin.typing import Floats


def with_link_springs(mechanism: Mechanism, model: Model, robot: Robot) -> tuple[Mechanism, dict[str, Floats]]:
    """Rods with the compliance of a model's ``link_compliance``, fitted as linear in the loads at its conditions.

    The rod's end on the carrier, with the part of the rod's mass that the carrier supports, slides along the rod on a spring.

    Returns
    -------
    mechanism
        The mechanism with an additional body ``LINK_end`` for each such link.
    shown
        By name, for each effect in it: the (N, 6) motion of the TCP, m and rad, at :func:`~gtpin.export.loss.conditions`.
    """
    active = [effect for effect in model.effects if effect.effect.exported_as == "link_spring"]
    if not active or not robot.rods:  # for links of robots without rods, which bend: export/joint_springs.py
        return mechanism, {}
    laws = {effect.name: _lines(model, effect) for effect in active}
    compliance, rest = np.sum(list(laws.values()), axis=0)
    soft = np.flatnonzero(compliance > STIFFEST)
    tcp = home(robot).tcp
    for i in soft:
        rod = robot.rods[i]
        spring = Spring(1.0 / float(compliance[i]), float(rest[i]))
        mechanism = _sprung(mechanism, robot, rod, spring, tcp.act(rod.P))
    rigid = {rod.site for i, rod in enumerate(robot.rods) if i not in soft}
    held = [e for e in active if e.site not in rigid and not (e.site == "arm" and rigid)]
    return mechanism, {e.name: _at_tcp(model, e, *laws[e.name]) for e in held}


def _lines(model: Model, active: ActiveEffect) -> tuple[Floats, Floats]:
    """(k,) compliances of the rods, m/N, and (k,) their stretch without a load, m."""
    at = conditions(model, active)
    length = active.basis(at).length
    assert length is not None
    stretch = length @ active.coefficients
    found = [
        line(force, own, 0.0) if own.any() else (0.0, 0.0) for force, own in zip(at.force.T, stretch.T, strict=True)
    ]
    compliance, rest = np.array(found).T
    return compliance, rest


def _at_tcp(model: Model, active: ActiveEffect, compliance: Floats, rest: Floats) -> Floats:
    """(N, 6) motion of the TCP, m and rad, by rods that stretch by ``rest`` (k,) and in proportion to their load."""
    at = conditions(model, active)
    return np.asarray(np.einsum("nik,nk->ni", at.response[:, :6], rest + compliance * at.force))


def geometric_scales(model: Model) -> dict[str, float]:
    """Travel per command of each drive by site, from the geometry alone."""
    scales = dict.fromkeys(model.robot.sites, 1.0)
    for parameter, deviation in zip(model.geometry.parameters, model.geometry.deviation, strict=True):
        if parameter.kind == "scale" and parameter.per == "actuator":
            scales[model.robot.sites[parameter.owner]] += float(deviation)
    return scales


def drive_scales(model: Model) -> tuple[dict[str, float], set[str]]:
    """Travel per command of each drive by site, from a model's scales and ``encoder_scale``, and the names of the parts of the
    model that these scales represent."""
    scales = geometric_scales(model)
    carried = set()
    for active in model.effects:
        if active.effect.exported_as == "drive_scale":
            scales[active.site] *= 1.0 + active.effect.parameters(active.coefficients, active.nonlinear)["scale"][0]
            carried.add(active.name)
    return scales, carried | {"drive scales"}


def _sprung(mechanism: Mechanism, robot: Robot, rod: Rod, spring: Spring, root: Floats) -> Mechanism:
    """A rod whose end slides along it on a spring; ``root`` (3,) is its joint on the platform, base frame."""
    loop = robot.description.loops[rod.loop].name
    end = mechanism.loops[loop][rod.rod_end]
    placements = mechanism.placements()
    place = placements[end.body]
    along = place.act(end.point) - root
    length = float(np.linalg.norm(along))
    axis = place.rotation.T @ along / length
    old = mechanism.body(end.body)
    # The part of the rod's mass whose weight the carrier bears is on the carrier's side of the spring. The spring then bears
    # the force at the rod's middle, as in the effect.
    beyond = float(np.clip(1.0 - (end.point - old.inertia.lever) @ axis / length, 0.0, 0.99))
    joint = Joint(f"{rod.site}_stretch", "slide", axis, np.zeros(3), 0.0, spring=spring)
    sprung = mechanism.on_springs(f"{rod.site}_end", [(loop, rod.rod_end)], [joint])
    inertia = old.inertia
    near = pin.Inertia(inertia.mass * (1.0 - beyond), inertia.lever, inertia.inertia * (1.0 - beyond))
    far = pin.Inertia(inertia.mass * beyond, inertia.lever - end.point, inertia.inertia * beyond)
    bodies = tuple(
        replace(body, inertia={old.name: near, f"{rod.site}_end": far}.get(body.name, body.inertia))
        for body in sprung.bodies
    )
    return replace(sprung, bodies=bodies)
