"""Reachable TCP positions, the robot's dexterity there, and commands that fill the workspace."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gtpin.accuracy.dexterity import Dexterity, dexterity, singularity
from gtpin.errors import ModelError, UnreachableError
from gtpin.kinematics.first_guess import halton
from gtpin.kinematics.inverse import commands_for
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.real import generator
from gtpin.typing import Floats, Mask

COUNTS = (7, 21, 21)
"""Numbers of grid points of a box along x, y and z."""
POSTURES = (128, 1800, 8192)
"""Numbers of postures of a map, reached or not, with one, two, and more actuators: 8,192 over 5 * 17 * 17 cells, and 1,800 over
the 17 * 17 of a surface, are about six for each cell."""
CELLS = (5, 17)
"""Numbers of cells of such a map along its thinnest direction, and along the other two."""
ENDLESS = 2048
"""Number of postures for a robot with loops and drives without limits: many of its commands are far, or can't be reached."""
FLAT = 0.01
"""Extent in a direction, relative to the largest, below which a workspace counts as flat: a planar robot that is calibrated
leaves its plane by some thousandths."""
POSES = (24, 60, 200)
"""Numbers of default commands of a robot without rods, with one, two, and more actuators."""
ROD_POSES = 180
"""Number of default commands of a robot with rods."""
CONDITIONED = (1.5, 10.0)
"""Largest motion of the TCP by unit commands, relative to that at home, of a robot with rods and with other loops: nearer to a
singularity, a small error of the geometry can open the loops."""
SOUND = 0.5
"""Smallest accepted distance from singularity of a robot with rods, relative to that at home."""
TRIES = 4
"""Number of commands that are tried for each one wanted."""
SLICES = 3
"""Largest number of slices of a map."""
SMALLEST_BOX = 1.0 / 64.0
"""Fraction of the ranges below which the search for commands ends."""


@dataclass(frozen=True)
class Workspace:
    """A box of cells, and M reachable postures with the cells of their TCPs.

    - ``axes``: coordinates, m, of the cells' middles along x, y and z of the base frame; nx, ny and nz of them.
    - ``across``: index of the axis that slices are orthogonal to.
    - ``cell``: (M, 3) indices of the cell in which each posture's TCP is.
    - ``q``, ``poses``, ``dexterity``: (M, n) commands of the postures, m or rad, their poses, base frame, and their
      dexterity.
    - ``volume``: volume, m^3, of the cells in which some posture's TCP is.
    - ``filled``: whether the postures fill the ranges of the commands, several to a cell; False: one posture has its TCP in
      the middle of each reachable cell of a given box.
    """

    axes: tuple[Floats, Floats, Floats]
    across: int
    cell: npt.NDArray[np.intp]
    q: Floats
    poses: Poses
    dexterity: Dexterity
    volume: float
    filled: bool

    @property
    def reachable(self) -> Mask:
        """(nx, ny, nz) whether the TCP of a posture is in the cell."""
        there = np.zeros([len(axis) for axis in self.axes], dtype=bool)
        there[tuple(self.cell.T)] = True
        return there

    @property
    def layers(self) -> list[int]:
        """Indices, along the axis ``across``, of the slices that maps show: in the middle of equal parts of what is reached."""
        there = np.flatnonzero(self.reachable.any(axis=tuple(i for i in range(3) if i != self.across)))
        count = min(SLICES, len(there))
        return [int(there[(2 * i + 1) * len(there) // (2 * count)]) for i in range(count)]

    def on_grid(self, values: Floats) -> Floats:
        """(nx, ny, nz) median of the finite ``values`` (M,) in each cell; NaN where there is none."""
        from scipy.ndimage import median  # only maps need it

        table = np.full([len(axis) for axis in self.axes], np.nan)
        good = np.isfinite(values)
        place = np.ravel_multi_index(tuple(self.cell[good].T), table.shape)
        there = np.unique(place)
        if there.size:
            table.flat[there] = median(values[good], place, there)
        return table


def workspace(model: Model, lower: Floats, upper: Floats, counts: tuple[int, int, int] = (5, 15, 15)) -> Workspace:
    """Find the reachable points of a box; the orientation is free.

    ``lower``, ``upper``: (3,) corners of the box, base frame, m. ``counts``: points along x, y and z.

    Raises `ModelError` if the corners give no box. `UnreachableError` if the robot can reach no point of the box.
    """
    if min(counts) < 1 or not (np.asarray(lower) <= np.asarray(upper)).all():
        raise ModelError(
            "a box without points", hint="give its lower corner, its upper corner and at least one point a side"
        )
    x, y, z = (np.linspace(a, b, count) for a, b, count in zip(lower, upper, counts, strict=True))
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    q, poses = commands_for(model.kinematics, points)
    robot = model.robot
    inside = poses.reached
    inside[inside] = ((q[inside] >= robot.lower) & (q[inside] <= robot.upper)).all(axis=1)
    if not inside.any():
        raise UnreachableError(f"{robot.name} reaches no point of the box", hint="give a box about its home")
    there, cell = poses[inside], np.argwhere(inside.reshape(counts))
    one = float(np.prod([np.diff(axis).mean() if len(axis) > 1 else 0.0 for axis in (x, y, z)]))
    found = dexterity(model, q[inside], there)
    return Workspace((x, y, z), 0, cell, q[inside], there, found, float(len(cell) * one), filled=False)


def filled_workspace(model: Model, seed: int = 0) -> Workspace:
    """The cells in which the TCP is, for many postures that fill the ranges of the commands.

    Raises `UnreachableError` if no posture can be reached.
    """
    endless = len(model.robot.constraints) > 0 and not np.isfinite(model.robot.upper - model.robot.lower).all()
    count = _by_actuators(POSTURES, model)
    q, poses = _filling(model, min(count, ENDLESS) if endless else count, seed)
    if not len(q):
        raise UnreachableError(f"{model.robot.name} reaches none of its range", hint="check the joints' limits")
    low, extent = poses.T.min(axis=0), np.ptp(poses.T, axis=0)
    across, flat = int(np.argmin(extent)), extent <= FLAT * extent.max()
    counts = np.where(flat, 1, np.where(np.arange(3) == across, CELLS[0], CELLS[1]))
    size = np.maximum(extent / counts, 1e-300)
    cell = np.clip(((poses.T - low) / size).astype(int), 0, counts - 1)
    x, y, z = (low[i] + size[i] * (np.arange(counts[i]) + 0.5) for i in range(3))
    volume = 0.0 if flat.any() else len(np.unique(cell, axis=0)) * float(np.prod(size))
    return Workspace((x, y, z), across, cell, q, poses, dexterity(model, q, poses), volume, filled=True)


def space_of(model: Model, q: Floats, seed: int = 0) -> Workspace:
    """The workspace for maps: with rods the box of the TCP's positions at commands q (N, n), else all that is reached."""
    if not model.robot.rod_sites:
        return filled_workspace(model, seed)
    T = model.kinematics.forward(q).T
    return workspace(model, T.min(axis=0), T.max(axis=0), COUNTS)


def default_commands(model: Model, count: int | None = None, seed: int = 0) -> Floats:
    """Reachable commands (N, n), m or rad, spread evenly (Halton) over the ranges.

    An actuator without limits is taken from -pi to pi. Of a robot with rods, N = ``count``: the dexterity is about as good as
    at home; where it reaches hardly any combination of these commands, the ranges are reduced around home. Of other robots,
    commands that can't be reached or, with loops, are near a singularity are left out of ``count``.

    ``count``: by default 180 with rods; else 200, or fewer with one or two actuators. ``seed``: seed of the commands of a robot
    without rods.

    Raises `UnreachableError` if a robot with rods reaches hardly any of its range even near home.
    """
    robot = model.robot
    if not robot.rod_sites:
        return _filling(model, count or _by_actuators(POSES, model), seed)[0]
    lower, upper = model.robot.ends
    size = 1.0
    while size >= SMALLEST_BOX:
        a, b = robot.home_q + size * (lower - robot.home_q), robot.home_q + size * (upper - robot.home_q)
        found = _fit_to_work(model, a, b, count or ROD_POSES)
        if len(found) == (count or ROD_POSES):
            return found
        size /= 2.0
    raise UnreachableError(f"{robot.name} reaches hardly any of its range", hint="give commands")


def _by_actuators(counts: tuple[int, int, int], model: Model) -> int:
    """The number for a robot with one, with two, or with more actuators."""
    return counts[min(model.robot.n_actuators, 3) - 1]


def _filling(model: Model, count: int, seed: int) -> tuple[Floats, Poses]:
    """Commands that fill the ranges, out of ``count``, without those that can't be reached or are near a singularity; and the
    poses there."""
    from scipy.stats import qmc

    robot = model.robot
    lower, upper = robot.ends
    q = lower + (upper - lower) * qmc.Halton(robot.n_actuators, rng=generator(seed)).random(count)
    poses = model.kinematics.forward(q)
    kept = poses.reached
    kept[kept] = well_conditioned(model, q[kept], poses[kept], rods=False)
    return q[kept], poses[kept]


def well_conditioned(model: Model, q: Floats, poses: Poses, *, rods: bool = True) -> Mask:
    """(N,) whether commands q (N, n), whose poses are reached, are about as far from a singularity as home.

    All are of a robot without loops. ``rods``: whether the stricter condition holds for a robot with rods.
    """
    if not model.robot.constraints:
        return np.ones(len(q), dtype=bool)
    if not (rods and model.robot.rod_sites):
        return _gain(model, q, poses) <= CONDITIONED[1]
    return (singularity(model.kinematics, q, poses)[0] >= SOUND) & (_gain(model, q, poses) <= CONDITIONED[0])


def _gain(model: Model, q: Floats, poses: Poses) -> Floats:
    """(N,) motion of the TCP by unit commands, relative to that at home."""
    kinematics, home_q = model.kinematics, model.robot.home_q[None]
    at_home = np.linalg.norm(kinematics.command_jacobian(home_q, kinematics.forward(home_q))[0, :6])
    return np.asarray(np.linalg.norm(kinematics.command_jacobian(q, poses)[:, :6], axis=(1, 2)) / at_home)


def _fit_to_work(model: Model, lower: Floats, upper: Floats, count: int) -> Floats:
    """At most ``count`` commands of a box that can be reached and are well conditioned, out of ``TRIES`` times as many."""
    found = np.zeros((0, model.robot.n_actuators))
    for shares in np.split(halton(model.robot.n_actuators, TRIES * count + 1)[1:], TRIES):  # the first is a corner
        q = lower + shares * (upper - lower)
        poses = model.kinematics.forward(q)
        q, poses = q[poses.reached], poses[poses.reached]
        found = np.vstack([found, q[well_conditioned(model, q, poses)]])
        if len(found) >= count:
            break
    return found[:count]
