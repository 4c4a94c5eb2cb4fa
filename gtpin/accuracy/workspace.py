"""Reachable TCP positions, and the robot's dexterity there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.accuracy.dexterity import Dexterity, dexterity
from gtpin.accuracy.rods import rod_kinematics
from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.inverse import commands_for
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.typing import Floats, Mask

CONDITIONED = 1.5
"""Largest accepted motion of the TCP by unit commands, relative to that at home."""
SOUND = 0.5
"""Smallest accepted distance from singularity, relative to that at home."""
TRIES = 4
"""Number of commands that are tried for each one wanted."""
SMALLEST_BOX = 1.0 / 64.0
"""Fraction of the ranges below which the search for commands ends."""


@dataclass(frozen=True)
class Workspace:
    """A box grid of TCP positions.

    Parameters
    ----------
    axes
        Coordinates, m, of the grid along x, y and z of the base frame; nx, ny and nz of them.
    reachable
        (nx, ny, nz) whether the TCP can be brought there within the actuators' ranges.
    q
        (M, n) commands of the M reachable points, m or rad, in the order of the grid (z varies fastest).
    poses
        (M) the poses there, base frame.
    dexterity
        The dexterity at the reachable points.
    """

    axes: tuple[Floats, Floats, Floats]
    reachable: Mask
    q: Floats
    poses: Poses
    dexterity: Dexterity

    @property
    def across(self) -> int:
        """Index of the axis that slices are orthogonal to: x."""
        return 0

    def on_grid(self, values: Floats) -> Floats:
        """(nx, ny, nz) grid with the values (M,) of the reachable points; NaN elsewhere."""
        table = np.full(self.reachable.shape, np.nan)
        table[self.reachable] = values
        return table

    @property
    def volume(self) -> float:
        """Volume, m^3, of the cells about the reachable points."""
        cell = np.prod([np.diff(axis).mean() if len(axis) > 1 else 0.0 for axis in self.axes])
        return float(self.reachable.sum() * cell)


def workspace(model: Model, lower: Floats, upper: Floats, counts: tuple[int, int, int] = (5, 15, 15)) -> Workspace:
    """Find the reachable points of a box; the orientation is free.

    Parameters
    ----------
    lower, upper
        (3,) corners of the box, base frame, m.
    counts
        Points along x, y and z.

    Raises
    ------
    ModelError
        If the robot has no rods, or the corners give no box.
    UnreachableError
        If the robot can reach no point of the box.
    """
    kinematics = rod_kinematics(model)
    if min(counts) < 1 or not (np.asarray(lower) <= np.asarray(upper)).all():
        raise ModelError(
            "a box without points", hint="give its lower corner, its upper corner and at least one point a side"
        )
    axes = [np.linspace(a, b, count) for a, b, count in zip(lower, upper, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    q, poses = commands_for(kinematics, points)
    robot = model.robot
    inside = poses.reached
    inside[inside] = ((q[inside] >= robot.lower) & (q[inside] <= robot.upper)).all(axis=1)
    if not inside.any():
        raise UnreachableError(f"{robot.name} reaches no point of the box", hint="give a box about its home")
    there = poses[inside]
    return Workspace(
        (axes[0], axes[1], axes[2]), inside.reshape(counts), q[inside], there, dexterity(model, q[inside], there)
    )


def default_commands(model: Model, count: int = 180) -> Floats:
    """(count, n) commands spread evenly (Halton) over the ranges, where the dexterity is about as good as at home.

    An actuator without limits is taken from -pi to pi. Where the robot reaches hardly any combination of these commands, the
    ranges are reduced around home.

    Raises
    ------
    ModelError
        If the robot has no rods.
    UnreachableError
        If the robot reaches hardly any of its range even near home.
    """
    robot = model.robot
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    size = 1.0
    while size >= SMALLEST_BOX:
        a, b = robot.home_q + size * (lower - robot.home_q), robot.home_q + size * (upper - robot.home_q)
        found = _fit_to_work(model, a, b, count)
        if len(found) == count:
            return found
        size /= 2.0
    raise UnreachableError(f"{robot.name} reaches hardly any of its range", hint="give commands")


def _fit_to_work(model: Model, lower: Floats, upper: Floats, count: int) -> Floats:
    """At most ``count`` commands of a box that can be reached and are well conditioned, out of ``TRIES`` times as many."""
    from scipy.stats import qmc

    kinematics, home_q = rod_kinematics(model), model.robot.home_q[None]
    at_home = np.linalg.norm(kinematics.command_jacobian(home_q, kinematics.forward(home_q)))
    sequence = qmc.Halton(model.robot.n_actuators, scramble=False)
    sequence.fast_forward(1)  # its first point is the corner of the box
    found = np.zeros((0, home_q.shape[1]))
    for _ in range(TRIES):
        q = lower + sequence.random(count) * (upper - lower)
        poses = kinematics.forward(q)
        q, poses = q[poses.reached], poses[poses.reached]
        gain = np.linalg.norm(kinematics.command_jacobian(q, poses), axis=(1, 2))
        sound = dexterity(model, q, poses).singularity >= SOUND
        found = np.vstack([found, q[sound & (gain <= CONDITIONED * at_home)]])
        if len(found) >= count:
            break
    return found[:count]
