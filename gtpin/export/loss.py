"""The error of the TCP that results if a file leaves out a part of a model, or represents it with an error."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from gtpin.accuracy.expected import Undetermined, unexplained_error
from gtpin.accuracy.workspace import well_conditioned
from gtpin.compensation.machine import geometric_scales, needed_by
from gtpin.data.names import is_approach
from gtpin.effects.active import ActiveEffect
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model, root_of
from gtpin.model.place import free_motions, movers, without_free
from gtpin.paper.geometry import PaperGeometry
from gtpin.robot.parameters import DIRECTIONS
from gtpin.typing import Floats

POSES = 512
"""Number of commands at which a loss is computed."""
WARMER = 1.0
"""Difference from the reference temperature, K, for which the loss of a thermal effect is stated."""
SPEED = 0.1
"""Speed, m/s or rad/s, for which the loss of an effect of speed is stated."""
FORCES = ("fx", "fy", "fz")
"""Columns of the force on the tool, N."""
LEVER = 0.1
"""Distance from the TCP, m, at which an error of the orientation counts. Assumed: about the length of a tool."""
LEAST = 1e-7
"""Smallest error, m, of an effect in a file that is reported."""


def with_losses(model: Model, names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of parts of a model, each with the root mean square displacement of the TCP that this part causes, um.

    The mean is over commands that fill the ranges of the fit (without a fit: of the robot), over the time and the sessions of
    the fit, and over both directions of approach, with loads on the tool as in the fit; to first order. It is without motions
    of the machine and of the tool that the instrument does not show. Effects of a temperature are stated for 1 K, those of a
    speed for 0.1 m/s or rad/s. Parts with unknown conditions have no number.
    """
    if not names:
        return names
    whole, model = model, model.of_tool()
    q, poses = postures(model)
    active = {effect.name: effect for effect in model.effects}
    found = []
    for name in names:
        moved, words = None, ""
        if name == "drive scales":
            off = (np.array([*geometric_scales(model).values()]) - 1.0) * q
            moved = np.einsum("nij,nj->ni", model.kinematics.command_jacobian(q, poses)[:, :6], off)
        elif name in active and (stated := _conditions(model, active[name])) is not None:
            moved, words = by_effect(active[name], conditions(model, active[name])), stated
        found.append(name if moved is None else f"{name} ({um(rms(without_free(whole, moved, poses)))} um{words})")
    return tuple(found)


def with_remainders(model: Model, shown: Mapping[str, Floats], session: str | None = None) -> tuple[str, ...]:
    """Names of effects that a file represents with an error, each with the root mean square of this error at the TCP.

    ``shown``: by name, the (N, 6) motion of the TCP, m and rad, by the file at the poses of :func:`conditions`.
    """
    found = []
    for active in model.effects:
        if active.name in shown:
            left = rms(by_effect(active, conditions(model, active, session)) - shown[active.name])
            if left > LEAST:
                found.append(f"{active.name} to within {1e6 * left:.2g} um")
    return tuple(found)


def rms(moved: Floats) -> float:
    """Root mean square of the positions' part of motions (N, 6) of the TCP, m."""
    return float(np.sqrt((moved[:, :3] ** 2).sum(axis=1).mean()))


def um(metres: float) -> str:
    """A length as text, um."""
    size = 1e6 * metres
    if size < 0.01:
        return "under 0.01"
    return f"{size:.3g}" if size < 999.5 else f"{size:.0f}"


def ranges(model: Model) -> tuple[Floats, Floats]:
    """(n,) smallest and largest commands of the fit; where they are not known, the robot's limits, or -pi and pi where it has
    none."""
    if ranges_known(model):
        assert model.fit is not None
        return np.array(model.fit.lower), np.array(model.fit.upper)
    lower, upper = model.robot.ends
    for active in model.effects:
        if len(active.references.commands[0]) == len(lower):
            lower, upper = active.references.commands
    return lower, upper


def ranges_known(model: Model) -> bool:
    """Whether a model has the ranges of the commands of its fit."""
    return model.fit is not None and len(model.fit.lower) == model.robot.n_actuators == len(model.fit.upper)


def postures(model: Model) -> tuple[Floats, Poses]:
    """Commands that fill the ranges, and their poses by geometry alone, base frame: without those near singularities, where
    they are not all so."""
    from scipy.stats import qmc  # its sequence has any number of coordinates

    lower, upper = ranges(model)
    q = lower + (upper - lower) * qmc.Halton(len(lower), scramble=False).random(POSES)
    poses = model.kinematics.forward(q)
    kept = poses.reached
    sound = kept.copy()
    sound[kept] = well_conditioned(model, q[kept], poses[kept])
    kept = sound if sound.any() else kept
    return q[kept], poses[kept]


def both_approaches(count: int) -> Floats:
    """(count,) alternating directions of approach, +1 and -1."""
    return np.where(np.arange(count) % 2, 1.0, -1.0)


def by_effect(active: ActiveEffect, at: OperatingPoints) -> Floats:
    """(N, 6) motion of the TCP by an effect, m and rad, to first order."""
    return np.asarray(active.basis(at).displacement(at)[:, :6] @ active.coefficients)


def conditions(model: Model, active: ActiveEffect, session: str | None = None) -> OperatingPoints:
    """Poses and covariates at which the loss of an effect is computed; all sessions of the fit in turn, or one.

    Forces on the tool are drawn with the mean and the spread of the loads of the fit, where it had some.
    """
    q, poses = postures(model)
    references, count = active.references, len(q)
    start, span = references.time
    known: dict[str, Column] = {}
    for name in needed_by(model, active):
        if name == "session":
            sessions = [session] if session else references.sessions or [""]  # of none: a shift since an earlier model
            known[name] = np.resize(np.array(sessions, dtype=object), count)
        elif name == "time":
            known[name] = start + span * np.linspace(0.0, 1.0, count)
        elif name.startswith("temp_"):
            known[name] = np.full(count, references.temperature + WARMER)
        elif name.startswith("speed"):
            known[name] = np.full(count, SPEED)
        elif is_approach(name):
            known[name] = both_approaches(count)
        else:
            known[name] = np.zeros(count)
    at = OperatingPoints(model.kinematics, q, poses, known, fixed=references, temperature=references.temperature)
    return replace(at, covariates={**known, **_tool_forces(model, active, at)})


def _tool_forces(model: Model, active: ActiveEffect, at: OperatingPoints) -> dict[str, Column]:
    """Random forces on the tool, ``fx fy fz``, N, that load rods or joints as much as in the fit; along gravity if the dataset
    has only payloads."""
    references, gravity = active.references, np.array(model.robot.description.gravity)
    if not {"payload", *FORCES} & set(references.covariates) or not gravity.any():
        return {}
    ways = np.eye(3) if set(FORCES) & set(references.covariates) else gravity[None] / np.linalg.norm(gravity)
    unit = np.sqrt(3.0) * np.random.default_rng(0).uniform(-1.0, 1.0, (len(at), len(ways)))
    if model.robot.rod_sites:
        one = np.ones(len(at))
        response = np.stack([at.with_covariate(name, one).force - at.force for name in FORCES], axis=2) @ ways.T
        mean, spread = references.force
        middle = np.linalg.lstsq(response.mean(axis=0), mean - at.force.mean(axis=0), rcond=None)[0]
        more = float((spread**2 - at.force.var(axis=0)).sum())
        size = np.sqrt(max(more, 0.0) / float((response**2).sum(axis=(1, 2)).mean()))
        along = middle + size * unit
    else:
        power = float(sum((load[-1, :3] ** 2).sum() for load in references.joints))
        along = np.sqrt(power / len(ways)) * (np.abs(unit) if len(ways) == 1 else unit)
    return dict(zip(FORCES, (along @ ways).T, strict=True))


def _conditions(model: Model, active: ActiveEffect) -> str | None:
    """The conditions of a loss as text; None where the effect depends on a column of unknown meaning."""
    words = ""
    for name in active.effect.covariates(model.robot, active.site):
        if name.startswith("temp_"):
            words = f" for each K off the file's {active.references.temperature:g} degC"
        elif name.startswith("speed"):
            words = f" at {SPEED:g} m/s or rad/s"
        elif name not in ("session", "time", "payload", *FORCES) and not is_approach(name):
            return None
    return words


def assumed_tool(model: Model) -> tuple[str, ...]:
    """What is assumed of the tool, as a text, where the target was free; else none."""
    if not model.targets_free:
        return ()
    tool = {p.name: p.tolerance for p in model.geometry.at_tool().parameters if p.kind == "platform"}
    assumed = (
        f" (assumed: to {1e3 * tool['platform.x']:.2g} mm and {1e3 * tool['platform.rx']:.2g} mrad)" if tool else ""
    )
    places = (", ".join(f"{1e3 * at:.3f}" for at in place.translation) for place in model.targets.values())
    sat = f"; the target sat at {' mm and at '.join(places)} mm in the frame of the tool" if model.targets else ""
    return (
        f"has the tool, {model.robot.tcp_frame}, where the robot's own file has it{assumed}: a free target does not show "
        f"it{sat}",
    )


def not_determined(model: Model, *, of_target: bool = False) -> Undetermined | None:
    """What the data of a fit do not determine of the geometry, at commands that fill its ranges; None where not known.

    ``of_target``: of poses of a free target, in place of those of the tool.
    """
    tool, size = model if of_target else model.of_tool(), len(model.geometry.parameters)
    covariance = tool.covariance if tool.joint_covariance is None else tool.joint_covariance[:size, :size]
    if covariance is None:
        return None
    q, poses = postures(tool)
    return Undetermined.of(model, tool.kinematics.geometry_jacobian(q, poses)[:, :6] @ root_of(covariance), poses)


def not_oriented(model: Model, *, of_target: bool = False) -> tuple[str, ...]:
    """That the data do not determine orientations, as a text, where these displace a point at `LEVER` by more than the rest of
    the geometry displaces the TCP; else none. Of a tool that a free target does not show, see :func:`assumed_tool`."""
    parts = None if model.free_target and not of_target else not_determined(model, of_target=of_target)
    if parts is None or LEVER * parts.orientation <= parts.rest:
        return ()
    off = f"{1e3 * parts.orientation:.3g} mrad, {1e3 * LEVER * parts.orientation:.2g} mm at {LEVER:g} m from the TCP"
    return (f"has orientations that the data do not determine: expected to be off by {off}",)


def assumed_base(model: Model) -> tuple[str, ...]:
    """What is assumed of where the machine stands, as a text, as far as no instrument shows it, or its frame moves; else
    none."""
    if names := movers(model):
        return (f"is in the mean of the base frame over the measurements, which {', '.join(names)} moved",)
    if not free_motions(model).size:
        return ()
    words = "is in the base frame, as the tolerances give it: no instrument shows where the base stands"
    parts = not_determined(model)
    if parts is None:
        return (words,)
    sits = f"where the tool sits, {um(parts.tool)} um; " if parts.tool else ""
    return (
        f"{words} (expected at the TCP: {um(parts.base)} um; {sits}everything else of the geometry, {um(parts.rest)} um)",
    )


def not_explained(model: Model) -> tuple[str, ...]:
    """What a model does not explain of the data of its fit, as a text, where there is more than noise; else none."""
    left = model.unexplained
    if left is None or left.none:
        return ()
    q, poses = postures(model.of_tool())
    size = np.sqrt(3.0) * unexplained_error(model, model.of_tool().kinematics.command_jacobian(q, poses))[0]
    noise = "" if left.noise_known else "; noise of the instrument is in it, because it is not known"
    what = f"{um(size)} um" if left.position else f"{1e6 * left.orientation:.3g} urad"
    return (f"is of a model that leaves {what} of the data of its fit unexplained (errors from pose to pose{noise})",)


def notes_of_robots(model: Model) -> tuple[str, ...]:
    """What is assumed of where the machine stands, what the model does not explain, and whether the data do not determine
    orientations, as texts."""
    return (*assumed_base(model), *not_explained(model), *not_oriented(model))


def left_out(model: Model, carried: Collection[str] = ()) -> tuple[str, ...]:
    """Names of parts of a model, beyond straight tracks, rods and joints, that a file can't represent.

    ``carried``: parts that the file represents, of these names: ``effect@site``, ``drive scales``, ``directions of single
    rods``, ``measured tracks``.
    """
    geometry = model.geometry
    moved = [p for p, d in geometry.all_deviations if d != 0.0]
    has = {
        "drive scales": any(p.kind == "scale" for p in moved),
        "directions of single rods": any(p.kind in DIRECTIONS and p.part not in geometry.robot.sites for p in moved),
        "measured tracks": isinstance(geometry, PaperGeometry) and any(track is not None for track in geometry.tracks),
    }
    names = [name for name, there in has.items() if there] + [active.name for active in model.effects]
    return tuple(name for name in names if name not in carried)
