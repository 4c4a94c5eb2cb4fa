"""Random commands of a machine on rods: the TCP all over its workspace, with random orientations where it can rotate."""

from __future__ import annotations

import numpy as np

from gtpin.bench.simulator.machine import Machine
from gtpin.bench.simulator.poses import Poses
from gtpin.bench.simulator.rotations import exp
from gtpin.errors import UnreachableError
from gtpin.typing import Floats

BOX = (0.232, 0.159, 0.147)
"""Half the sides of a gantry's box of TCP positions, in rod lengths, base frame; x along the tracks."""
CENTER = (-0.012, -0.011, 0.0)
"""Centre of this box relative to home, in rod lengths, base frame."""
WIDE, TURNED = 0.25, 0.25
"""Half the side of a hexapod's box about the middle of its ranges, in rod lengths, and its largest rotation per axis, rad."""
PARALLEL = 0.99
"""Smallest absolute cosine of the angle between parallel tracks."""
CONDITIONED = 1.5
"""Largest ratio of the TCP's motion by unit commands to that in the middle of the ranges: others are not used. This holds for
machines that are neither gantry nor hexapod."""
RESOLUTION = 1e-6
"""Step to which commands are rounded, m or rad."""
TRIES = 50


def reachable(machine: Machine, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) random commands, m or rad, with the TCP all over the workspace.

    Raises
    ------
    UnreachableError
        If hardly any of them are in the ranges.
    """
    robot = machine.robot
    draw = _in_box if _is_gantry(machine) else _hexapod if _is_hexapod(machine) else _in_ranges
    found = np.zeros((0, machine.n_carts))
    for _ in range(TRIES):
        q = np.round(draw(machine, count, rng) / RESOLUTION) * RESOLUTION
        inside = ((q >= robot.lower) & (q <= robot.upper)).all(axis=1)  # NaN is not inside
        found = np.vstack([found, q[inside]])
        if len(found) >= count:
            return found[:count]
    raise UnreachableError(f"{robot.name} reaches hardly any of its box", hint="widen the ranges in the URDF")


def _is_gantry(machine: Machine) -> bool:
    """Whether three carts on parallel tracks that are not vertical move the platform."""
    parallel = np.abs(machine.tracks @ machine.tracks[0]) > PARALLEL
    return (
        machine.n_carts == 3 and bool(machine.slides.all() and parallel.all()) and abs(machine.tracks[0, 2]) < PARALLEL
    )


def _is_hexapod(machine: Machine) -> bool:
    """Whether each rod has its own drive, a leg's or a cart's, so that the platform can rotate."""
    return machine.n_carts == 6 and bool((machine.slides | machine.is_leg).all())


def _in_box(machine: Machine, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) commands for random positions in home's orientation, which the machine nearly keeps; NaN out of reach."""
    home = machine.kinematics.home
    size = float(machine.kinematics.L0.mean())
    T = home.T[0] + size * (np.array(CENTER) + np.array(BOX) * rng.uniform(-1.0, 1.0, (count, 3)))
    q = _carts(machine, T[:, None, :] + machine.kinematics.P @ home.R[0].T)
    return np.column_stack([q[:, machine.driver == c].mean(axis=1) for c in range(machine.n_carts)])


def _hexapod(machine: Machine, count: int, rng: np.random.Generator) -> Floats:
    """(count, 6) commands for random poses about the middle of the ranges; NaN out of reach."""
    kinematics = machine.kinematics
    middle, pose = _middle(machine)
    size = float(kinematics.ends(middle).L.mean())
    T = pose.T[0] + size * WIDE * rng.uniform(-1.0, 1.0, (count, 3))
    R = exp(TURNED * rng.uniform(-1.0, 1.0, (count, 3))) @ pose.R[0]
    joints = T[:, None, :] + kinematics.P @ np.swapaxes(R, 1, 2)
    legs = np.linalg.norm(joints - kinematics.C0, axis=2) - kinematics.L0
    travel = np.where(machine.is_leg[machine.driver], legs, _carts(machine, joints)) / kinematics.scale
    q = np.empty_like(travel)
    q[:, machine.driver] = travel
    return q


def _in_ranges(machine: Machine, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) random commands in the ranges; NaN where the machine is worse conditioned than ``CONDITIONED`` allows."""
    robot = machine.robot
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    q = rng.uniform(lower, upper, (count, machine.n_carts))
    q[_gain(machine, q) > CONDITIONED * _gain(machine, _middle(machine)[0])] = np.nan
    return q


def _gain(machine: Machine, q: Floats) -> Floats:
    """(N,) motion of the TCP by unit commands: the norm of its derivative; infinite out of reach."""
    poses = machine.kinematics.forward(q)
    gain, there = np.full(len(q), np.inf), poses.reached
    gain[there] = np.linalg.norm(machine.kinematics.command_jacobian(q[there], poses[there]), axis=(1, 2))
    return gain


def _middle(machine: Machine) -> tuple[Floats, Poses]:
    """(1, n) commands in the middle of the ranges and the pose there; home where that can't be reached."""
    robot = machine.robot
    middle = (robot.lower + robot.upper) / 2.0
    q = np.where(np.isfinite(middle), middle, robot.home_q)[None]
    pose = machine.kinematics.forward(q)
    return (q, pose) if pose.reached.all() else (robot.home_q[None], machine.kinematics.home)


def _carts(machine: Machine, joints: Floats) -> Floats:
    """(N, k) travel, m, of the cart of each rod for positions of the platform's joints (N, k, 3), base frame; NaN out of
    reach."""
    kinematics = machine.kinematics
    # |T + R P - C0 - q v|^2 = L^2, a quadratic in q; the carts stay on home's side of the platform.
    a = joints - kinematics.C0
    along = np.einsum("nki,ki->nk", a, kinematics.v)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(along**2 - np.einsum("nki,nki->nk", a, a) + kinematics.L0**2)
    home_side = np.sign(np.einsum("ki,ki->k", kinematics.home.T[0] - kinematics.C0, kinematics.v))
    return np.asarray(along - home_side * root)
