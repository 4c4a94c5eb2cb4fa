"""A model's compliance as springs of its mechanism, and its drive scales as scales of its drives."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Situation
from gtpin.export.lines import STIFFEST
from gtpin.export.loss import conditions
from gtpin.export.mechanism import Joint, Mechanism, Spring
from gtpin.kinematics.posture import home
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model.model import Model
from gtpin.robot.robot import Robot
from gtpin.robot.rods import Rod

Floats = npt.NDArray[np.float64]

STEP = 1.0
"""N by which the load is varied to find a link's tangent compliance."""


def with_link_springs(mechanism: Mechanism, model: Model, robot: Robot) -> tuple[Mechanism, dict[str, Floats]]:
    """Links with the compliance of a model's ``link_compliance``, linearised at the mean load of its fit.

    The link's end, with the part of its mass that weighs on the carrier, slides along it on a spring.

    Returns
    -------
    mechanism
        With a body ``LINK_end`` more for each such link.
    shown
        By name of each effect that it holds, the (N, 6) motion of the TCP at :func:`~gtpin.export.loss.conditions`.
    """
    active = [effect for effect in model.effects if effect.effect.exported_as == "link_spring"]
    if not active or not robot.rods:  # links of a chain bend
        return mechanism, {}
    force = active[0].references.force[0]
    below, at, above = (_stretch(model, active, force + step) for step in (-STEP, 0.0, STEP))
    compliance = (above - below) / (2.0 * STEP)
    soft = np.flatnonzero(compliance > STIFFEST)
    tcp = home(robot).tcp
    for i in soft:
        rod = robot.rods[i]
        spring = Spring(1.0 / float(compliance[i]), float(at[i] - compliance[i] * force[i]))
        mechanism = _sprung(mechanism, robot, rod, spring, tcp.act(rod.P))
    rigid = {rod.site for i, rod in enumerate(robot.rods) if i not in soft}
    held = [e for e in active if e.site not in rigid and not (e.site == "arm" and rigid)]
    return mechanism, {e.name: _linear(model, e, force) for e in held}


def _linear(model: Model, active: ActiveEffect, force: Floats) -> Floats:
    """(N, 6) motion of the TCP by the tangent to an effect at axial forces (k,)."""
    below, middle, above = (_stretch(model, [active], force + step) for step in (-STEP, 0.0, STEP))
    at = conditions(model, active)
    length = middle + (above - below) / (2.0 * STEP) * (at.force - force)
    return np.asarray(np.einsum("nik,nk->ni", at.response, length))


def drive_scales(model: Model) -> tuple[dict[str, float], set[str]]:
    """Travel per command of each drive by site, from a model's scales and ``encoder_scale``, and the names of these parts."""
    scales = dict.fromkeys(model.robot.sites, 1.0)
    for parameter, deviation in zip(model.geometry.parameters, model.geometry.deviation, strict=True):
        if parameter.kind == "scale" and parameter.per == "actuator":
            scales[model.robot.sites[parameter.owner]] += float(deviation)
    carried = set()
    for active in model.effects:
        if active.effect.exported_as == "drive_scale":
            scales[active.site] *= 1.0 + active.effect.parameters(active.coefficients, active.nonlinear)["scale"][0]
            carried.add(active.name)
    return scales, carried | {"drive scales"}


def _stretch(model: Model, effects: Collection[ActiveEffect], force: Floats) -> Floats:
    """(k,) how much longer the rods are under axial forces (k,), N, at home, m."""
    kinematics = model.kinematics
    assert isinstance(kinematics, RodKinematics)
    q = model.robot.home_q[None]
    total = np.zeros(len(force))
    for active in effects:
        # Only the given load; no direction of approach, which gives the mean of both.
        none = {name: np.zeros(1) for name in active.references.covariates if name != "session"}
        at = Situation(kinematics, q, kinematics.home, none, fixed=active.references)
        vars(at)["force"] = force[None]
        basis = active.basis(at)
        assert basis.length is not None
        total += (basis.length @ active.coefficients)[0]
    return total


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
    # What weighs on the carrier hangs beyond the spring, so that the spring bears the force at the rod's middle.
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
