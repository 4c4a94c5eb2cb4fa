"""A model's compliance as springs of its mechanism, and its drive scales as scales of its drives."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.effects.active import ActiveEffect
from gtpin.effects.situation import Situation
from gtpin.export.mechanism import Joint, Mechanism, Spring
from gtpin.kinematics.posture import home
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.model.model import Model
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.robot import Robot
from gtpin.robot.rods import Rod

Floats = npt.NDArray[np.float64]

STIFFEST = 1e-11
"""m/N or rad/(N m) below which a fitted compliance, which may come out negative, counts as none."""
STEP = 1.0
"""N by which the load is varied to find a link's tangent compliance."""


def with_link_springs(mechanism: Mechanism, model: Model, robot: Robot) -> tuple[Mechanism, set[str]]:
    """Links with the compliance of a model's ``link_compliance``, linearised at the mean load of its fit.

    The link's end, with the part of its mass that weighs on the carrier, slides along it on a spring.

    Returns
    -------
    mechanism
        With a body ``LINK_end`` more for each such link.
    carried
        Names of the effects that it now holds.
    """
    active = [effect for effect in model.effects if effect.effect.exported_as == "link_spring"]
    if not active or not robot.rods:  # links of a chain bend, for which a mechanism of rigid bodies has no part
        return mechanism, set()
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
    return mechanism, {e.name for e in active if e.site not in rigid and not (e.site == "arm" and rigid)}


def with_cart_springs(mechanism: Mechanism, model: Model, robot: Robot) -> tuple[Mechanism, set[str]]:
    """Carts with the translational and rotational compliance of a model's ``cart_compliance`` at its usual load.

    The joints of such a cart sit together on a massless body ``CART_seat`` on three springs along and three about the track
    and the two axes across it; returns as :func:`with_link_springs`.
    """
    carried = set()
    placements = mechanism.placements()
    for active in model.effects:
        if active.effect.exported_as != "cart_springs":
            continue
        found = active.effect.parameters(active.coefficients, active.nonlinear)
        values = [
            found[n][0] if n in found else 0.0 for n in ("along", "across_a", "across_b", "roll", "tip_a", "tip_b")
        ]
        actuator = robot.sites.index(active.site)
        ends = [(robot.description.loops[r.loop].name, 1 - r.rod_end) for r in robot.rods if r.carrier == actuator]
        body = mechanism.loops[ends[0][0]][ends[0][1]].body
        axes = np.roll(rotation_axes(robot.actuators[actuator].axis), 1, axis=0) @ placements[body].rotation
        joints = [
            Joint(
                f"{active.site}_{'gives' if k < 3 else 'tips'}_{'along' if k % 3 == 0 else 'ab'[k % 3 - 1]}",
                "slide" if k < 3 else "hinge",
                axes[k % 3],
                np.zeros(3),
                0.0,
                spring=Spring(1.0 / value),
            )
            for k, value in enumerate(values)
            if value > STIFFEST
        ]
        if joints:
            mechanism = mechanism.on_springs(f"{active.site}_seat", ends, joints)
            carried.add(active.name)
    return mechanism, carried


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
