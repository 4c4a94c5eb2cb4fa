"""Quantities that an effect displaces: shifts of a cart along or across its track, its rotations, a link's length, the
frame."""

from __future__ import annotations

import numpy as np

from gtpin.effects.active import ActiveEffect
from gtpin.effects.basis import Basis, along_track, of_lengths
from gtpin.effects.situation import Situation
from gtpin.report import chain_effect_motions as of_chain
from gtpin.report.motion import Motion
from gtpin.robot.parameters import rotation_axes
from gtpin.typing import Floats

FREEDOMS = ("shift along x", "shift along y", "shift along z", "turn about x", "turn about y", "turn about z")


SMALLEST = 1e-9
"""Displacement by a coefficient of typical size, m or rad, up to which it is a rounding error."""


def motions(active: ActiveEffect, at: Situation) -> list[Motion]:
    """All quantities that an effect displaces by more than a rounding error."""
    basis = active.basis(at)
    found = [*(_of_rods(active, at, basis) if at.robot.rods else _of_chain(active, at, basis)), *_twist(at, basis)]
    return [motion for motion in found if np.abs(motion.columns * basis.sigma).max(initial=0.0) > SMALLEST]


def _of_rods(active: ActiveEffect, at: Situation, basis: Basis) -> list[Motion]:
    return [*_travel(at, basis), *_carrier_joints(active, at, basis), *_lengths(at, basis)]


def _of_chain(active: ActiveEffect, at: Situation, basis: Basis) -> list[Motion]:
    return [*of_chain.travel(at, basis), *of_chain.placements(at, active.site, basis)]


def _travel(at: Situation, basis: Basis) -> list[Motion]:
    if basis.command is None:
        return []
    actuator, columns = basis.command
    robot = at.robot
    site, turns = robot.sites[actuator], robot.actuators[actuator].revolute
    one = along_track(at, site, np.ones((len(at), 1)), np.ones(1))
    return [Motion(f"travel of {site}", "rad" if turns else "m", columns, one.displacement(at)[:, :, 0])]


def _carrier_joints(active: ActiveEffect, at: Situation, basis: Basis) -> list[Motion]:
    """Shifts of a cart along and across its track, and its rotations."""
    rods = [index for index, _ in basis.placements]
    if not rods or active.site not in at.robot.sites:
        return []
    axis = at.robot.actuators[at.robot.sites.index(active.site)].axis
    axes = (axis, *rotation_axes(axis)[:2])
    moved, places = basis.shifts(rods), at.carrier_joints[:, rods]
    lever = places - places.mean(axis=1, keepdims=True)
    found = []
    for number, direction in enumerate(axes):
        where = "along its track" if number == 0 else f"across its track, towards {_towards(direction)}"
        unit = np.broadcast_to(direction, (len(at), len(rods), 3))
        columns = np.einsum("nkim,i->nm", moved, direction) / len(rods)
        found.append(Motion(f"{active.site} {where}", "m", columns, _tcp(at, rods, unit), straightened=number > 0))
    if len(rods) > 1:
        inertia = np.einsum("nki,nki->n", lever, lever)[:, None, None] * np.eye(3) - np.einsum(
            "nki,nkj->nij", lever, lever
        )
        moment = np.cross(lever[..., None], moved, axisa=2, axisb=2, axisc=2).sum(axis=1)
        turn = np.linalg.pinv(inertia, rcond=1e-9) @ moment
        for number, direction in enumerate(axes):
            about = "its track (roll)" if number == 0 else f"an axis towards {_towards(direction)}"
            columns = np.einsum("nim,i->nm", turn, direction)
            found.append(
                Motion(f"{active.site} about {about}", "rad", columns, _tcp(at, rods, np.cross(direction, lever)))
            )
    return found


def _lengths(at: Situation, basis: Basis) -> list[Motion]:
    if basis.length is None:
        return []
    found = []
    for i, rod in enumerate(at.robot.rods):
        one = of_lengths(at, [i], np.ones((len(at), 1, 1)), np.ones(1))
        found.append(Motion(f"length of {rod.site}", "m", basis.length[:, i], one.displacement(at)[:, :, 0], i))
    return found


def _twist(at: Situation, basis: Basis) -> list[Motion]:
    if basis.twist is None:
        return []
    size = at.robot.motion_size
    return [
        Motion(name, "m" if k < 3 else "rad", basis.twist[:, k], np.broadcast_to(np.eye(size)[k], (len(at), size)))
        for k, name in enumerate(FREEDOMS)
    ]


def _tcp(at: Situation, rods: list[int], moved: Floats) -> Floats:
    """(N, 6) motion of the TCP by a motion (N, len(rods), 3) of the carrier joints of some rods."""
    parts = [at.bodies.response[:, :, i] @ moved[:, k, :, None] for k, i in enumerate(rods)]
    return np.asarray(np.sum(parts, axis=0)[..., 0])


def _towards(direction: Floats) -> str:
    """The base axis that a direction is nearest to, with its sign."""
    k = int(np.argmax(np.abs(direction)))
    return f"{'−' if direction[k] < 0.0 else '+'}{'xyz'[k]}"
