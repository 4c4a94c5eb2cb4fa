"""Which commands a machine is sent to: the TCP all over its workspace, turned at random where it can be turned."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.errors import UnreachableError
from gtpin.plant.machine import Machine
from gtpin.plant.poses import Poses
from gtpin.plant.rotations import exp

Floats = npt.NDArray[np.float64]

BOX = (0.232, 0.159, 0.147)
"""Half the sides of a gantry's box of TCP positions, in rod lengths: x along the tracks, base frame."""
CENTER = (-0.012, -0.011, 0.0)
"""Its centre from home, in rod lengths."""
WIDE, TURNED = 0.25, 0.25
"""Half the side of a hexapod's box about the middle of its ranges, in rod lengths, and how far it turns, rad."""
PARALLEL = 0.99
"""Cosine from which on tracks count as parallel."""
CONDITIONED = 1.5
"""Motion of other machines' TCP by their drives, over that in the middle of the ranges, beyond which nobody would measure."""
RESOLUTION = 1e-6
"""Commands are rounded to this, m or rad."""
TRIES = 50


def reachable(machine: Machine, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) commands that put the TCP all over the workspace, m or rad.

    Raises
    ------
    UnreachableError
        If the ranges hold hardly any of it.
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
    """Whether three carts on level, parallel tracks move the platform without turning it."""
    parallel = np.abs(machine.tracks @ machine.tracks[0]) > PARALLEL
    return (
        machine.n_carts == 3 and bool(machine.slides.all() and parallel.all()) and abs(machine.tracks[0, 2]) < PARALLEL
    )


def _is_hexapod(machine: Machine) -> bool:
    """Whether each rod has a drive of its own, so that the platform turns at will."""
    return machine.n_carts == 6 and bool((machine.slides | machine.is_leg).all())


def _in_box(machine: Machine, count: int, rng: np.random.Generator) -> Floats:
    """(count, n) commands for positions at random in home's orientation, which the machine all but keeps; NaN out of reach."""
    home = machine.kinematics.home
    size = float(machine.kinematics.L0.mean())
    T = home.T[0] + size * (np.array(CENTER) + np.array(BOX) * rng.uniform(-1.0, 1.0, (count, 3)))
    q = _carts(machine, T[:, None, :] + machine.kinematics.P @ home.R[0].T)
    return np.column_stack([q[:, machine.driver == c].mean(axis=1) for c in range(machine.n_carts)])


def _hexapod(machine: Machine, count: int, rng: np.random.Generator) -> Floats:
    """(count, 6) commands for positions and turns at random about the middle of the ranges; NaN out of reach."""
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
    """(count, n) commands at random in the ranges; NaN where the machine is not as well conditioned as in their middle."""
    robot = machine.robot
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    q = rng.uniform(lower, upper, (count, machine.n_carts))
    q[_gain(machine, q) > CONDITIONED * _gain(machine, _middle(machine)[0])] = np.nan
    return q


def _gain(machine: Machine, q: Floats) -> Floats:
    """(N,) motion of the TCP by unit motions of the drives; infinite where the machine can't go."""
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
    """(N, k) travel of each rod's own cart for joints on the platform (N, k, 3), base frame; NaN out of reach."""
    kinematics = machine.kinematics
    # |T + R P - C0 - q v|^2 = L^2, a quadratic in q; the carts stay on home's side of the platform.
    a = joints - kinematics.C0
    along = np.einsum("nki,ki->nk", a, kinematics.v)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(along**2 - np.einsum("nki,nki->nk", a, a) + kinematics.L0**2)
    home_side = np.sign(np.einsum("ki,ki->k", kinematics.home.T[0] - kinematics.C0, kinematics.v))
    return np.asarray(along - home_side * root)
