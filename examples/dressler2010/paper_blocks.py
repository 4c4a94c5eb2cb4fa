"""The paper's numbers, and gtpin's beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from paper_grid import OF_ALL, RECOVERED, Grid
from paper_table1 import expected_table1
from paper_tables import tables
from scipy.spatial.transform import Rotation

from gtpin.accuracy.sensitivity import PARAMETERS, STEP, SmallError, sensitivity, step_sums
from gtpin.kinematics.kinematics import reached_poses
from gtpin.kinematics.rotations import zyz
from gtpin.model.model import Model
from gtpin.robot.placement_frames import frame_of_anchor

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """Printed numbers that belong together.

    Parameters
    ----------
    name, unit
        What they are.
    rows, columns
        Names of the rows and columns.
    printed, ours
        (r, c) the paper's numbers and gtpin's.
    spread
        (r, c) standard deviation of gtpin's from one set of poses to the next; None where there is none.
    """

    name: str
    unit: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    printed: Floats
    ours: Floats
    spread: Floats | None = None

    @property
    def ratio(self) -> Floats:
        """(r, c) gtpin's numbers over the paper's."""
        return self.ours / self.printed

    @property
    def worst(self) -> float:
        """Largest relative deviation."""
        return float(np.abs(self.ratio - 1.0).max())

    @property
    def rms(self) -> float:
        """Root mean square of the relative deviations."""
        return float(np.sqrt(((self.ratio - 1.0) ** 2).mean()))


def compare_table3(model: Model, grid: Grid = RECOVERED) -> tuple[Block, ...]:
    """Table III: blocks S_pos, S_rot and S_cost, each first for the rows L, P and C, then for the track directions.

    Sums over 61 poses are 61 times the mean over the grid; S_cost is the expectation over Gaussian residuals of model 5's
    costs. Links 2a and 2b have no track direction in model 5: see :func:`compare_frame_angles`.
    """
    printed = tables()
    q = grid.commands(model)
    found = sensitivity(model, q, sigmas=printed.closure_sigmas(5)).exact
    assert found.cost is not None
    share = printed.measurement.calibration_poses / len(q)
    own = np.array([source == 3 for source in printed.source])
    directions = tuple(name for name in PARAMETERS if name not in OF_ALL)
    blocks = []
    for rows, columns, what in ((OF_ALL, np.ones_like(own), ""), (directions, own, ", track directions")):
        index = [PARAMETERS.index(name) for name in rows]
        names = tuple(name for name, there in zip(printed.links, columns, strict=True) if there)
        sums: tuple[tuple[str, str, Mapping[str, Floats], Floats], ...] = (
            ("S_pos", "mm", printed.position_mm, 1e3 * found.position),
            ("S_rot", "rad", printed.rotation_rad, found.rotation),
            ("S_cost", "m^4", printed.cost_m4, found.cost),
        )
        for name, unit, told, ours in sums:
            table = np.array([told[row] for row in rows])[:, columns]
            blocks.append(Block(name + what, unit, rows, names, table, share * ours[index][:, columns]))
    return tuple(blocks)


def compare_frame_angles(model: Model, grid: Grid = RECOVERED) -> tuple[Block, ...]:
    """Table III's last rows for links 2a and 2b, which model 5 takes from model 4: Euler angles between two tracker frames.

    A joint on cart 2 is C = t + R m(q), with R = Rz(a) Ry(b) Rx(c) of Table II's angles, in degrees, t its offset and m(q) the
    measured track. m(q) is not printed, but R m(q) = C - t is: C by model 3's offset and direction, t by model 4's offset. A
    step of an angle turns that lever arm about the angle's axis.
    """
    printed = tables()
    calibrated = printed.calibrated[4]
    assert calibrated.orientation is not None
    q = grid.commands(model)
    kinematics, robot = model.kinematics, model.robot
    poses = reached_poses(kinematics, q)
    motion, (_, on_carriers) = kinematics.motion(q, poses), kinematics.rod_ends(q, poses)
    share = printed.measurement.calibration_poses / len(q)
    rods = [rod for rod, source in enumerate(printed.source) if source == 4]
    ours = np.zeros((3, 3, len(rods)))
    for column, rod in enumerate(rods):
        lever, seat = on_carriers[:, rod] - calibrated.offset[rod], frame_of_anchor(robot, robot.rods[rod].seat)
        a, b, _ = np.deg2rad(calibrated.orientation[rod])
        first = Rotation.from_euler("Z", a)
        axes = (np.eye(3)[2], first.apply(np.eye(3)[1]), (first * Rotation.from_euler("Y", b)).apply(np.eye(3)[0]))
        for row, axis in enumerate(axes):
            moved = np.cross(axis, lever)
            local = np.einsum("nji,nj->ni", motion.frame(seat)[0], moved)
            turn = SmallError("turn", robot.rods[rod].name, seat, np.hstack([local, 0.0 * local]), rod, 0.0, -moved)
            sums = step_sums(kinematics, q, poses, turn, float(printed.closure_sigmas(5)[rod]), STEP)
            ours[:, row, column] = share * sums * [1e3, 1.0, 1.0]
    names = tuple(printed.links[rod] for rod in rods)
    rows = tuple(name for name in PARAMETERS if name not in OF_ALL)
    told = (printed.position_mm, printed.rotation_rad, printed.cost_m4)
    kinds = (("S_pos", "mm"), ("S_rot", "rad"), ("S_cost", "m^4"))
    return tuple(
        Block(f"{name}, Euler angles", unit, ("Z", "Y", "X"), names, np.array([t[row] for row in rows])[:, rods], found)
        for (name, unit), t, found in zip(kinds, told, ours, strict=True)
    )


def compare_table1(model: Model, grid: Grid = RECOVERED, seed: int = 0) -> tuple[Block, ...]:
    """Table I from Table II's costs: mean, and the largest of 61 poses."""
    printed = tables()
    found = expected_table1(model, grid.commands(model), seed=seed)
    models = ("1", "2", "3", "4", "5")
    told = np.array(
        [(e.position.mean, e.position.maximum, e.position.mean_spread, e.position.maximum_spread) for e in found]
    )
    mean, largest, mean_spread, largest_spread = 1e6 * told.T[:, None]
    return (
        Block("Table I, mean", "um", ("mean",), models, printed.mean_um[None], mean, mean_spread),
        Block("Table I, maximum", "um", ("max",), models, printed.max_um[None], largest, largest_spread),
    )


def compare_orientation(model: Model, grid: Grid = RECOVERED) -> Block:
    """Ranges of the ZYZ angles alpha and beta over the whole grid; the paper prints one digit of each."""
    _, poses = grid.all_commands(model)
    ranges = np.rad2deg(np.ptp(zyz(poses.R), axis=0))[None, :2]
    told = tables().measurement.orientation_range_deg
    names = ("alpha", "beta")
    return Block("ZYZ ranges", "deg", ("range",), names, np.array([[told[name] for name in names]]), ranges)
