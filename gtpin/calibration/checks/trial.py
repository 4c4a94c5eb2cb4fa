"""What a fit leaves of measured poses: a quick robust fit of the geometry, of a free frame and a free target, to some rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.suspected import NO_FIT, PLAUSIBLE, Size
from gtpin.calibration.free_target import with_target
from gtpin.calibration.gauss_newton import fit
from gtpin.calibration.problem import Measured, Problem, rough_frame
from gtpin.data import Dataset, Instrument
from gtpin.errors import ConvergenceError
from gtpin.instruments.readings import Readings
from gtpin.kinematics.frame_and_target import MEDIAN
from gtpin.model.model import Frame, Model
from gtpin.noise import weights
from gtpin.typing import Floats

ROWS = 150
"""Number of rows that are enough. Assumed."""
FEWEST = 6
"""Number of rows below which nothing is fitted."""
REACHED = 0.75
"""Share of the rows that the nominal robot must reach. Assumed."""
COARSE = 1e-3
"""Noise, m and rad, of the first fit: with less, the cost is a narrow curved valley far from its minimum."""
FAR_TOLERANCES, FAR = 50.0, {"m": 0.02, "rad": 0.05}
"""Deviation of a parameter from nominal, in units of its tolerance, and in m and rad, that no machine has. Assumed: a fit that
needs more makes up for a mistake."""
STEPS = 15
"""Largest number of steps of each fit."""


def left_after_fit(nominal: Model, measured: Measured, instrument: Instrument) -> Size:
    """Robust standard deviations of what a fit leaves; `NO_FIT` where it fails.

    ``nominal``: the nominal model; a free target is placed anew. ``measured``: the measured poses. ``instrument``: says
    what is free, and which noise is declared.
    """
    some = np.linspace(0, len(measured.T) - 1, min(len(measured.T), ROWS)).astype(int)
    measured, free = measured.take(some), instrument.frame == "free"
    if instrument.target == "free":
        nominal = replace(nominal, geometry=with_target(nominal.geometry, measured, free_frame=free)[0])
    poses = nominal.kinematics.forward(measured.q)
    there = poses.reached
    if there.sum() < FEWEST or there.mean() <= REACHED:
        return NO_FIT
    measured, poses = measured.take(there), poses[there]
    start = replace(nominal, frame=rough_frame(poses, measured) if free else Frame())
    last = (instrument.position_sigma or PLAUSIBLE[0], instrument.orientation_sigma or PLAUSIBLE[1])
    readings, c = Readings.of_poses(measured.q, measured.T, measured.R, nominal.robot), measured.components
    x = None
    try:
        for sigmas in ((COARSE, COARSE), last):
            whitening = np.diag(1.0 / np.repeat(sigmas, 3)[:c])
            problem = Problem(start, readings, np.broadcast_to(whitening, (len(poses), c, c)), free)
            found = fit(problem, weights.huber, x, near=poses, enough=STEPS)
            x, poses = found.point.x, found.point.poses
    except (ConvergenceError, np.linalg.LinAlgError):
        return NO_FIT
    if _absurd(found.problem, found.point.x):
        return NO_FIT
    return size_of(measured.minus(found.point.model.seen(poses)))


def _absurd(problem: Problem, x: Floats) -> bool:
    """Whether a fitted parameter is so far from nominal that the robot is another one."""
    geometry = problem.start.geometry
    x = np.abs(x[: problem.n_geometry])
    farthest = np.array([FAR.get(p.unit, np.inf) for p in geometry.parameters])
    return bool(((x > FAR_TOLERANCES) & (x * geometry.tolerance > farthest)).any())


def left_in(dataset: Dataset, nominal: Model, measured: Measured) -> Size:
    """As :func:`left_after_fit`, for a dataset's own instrument."""
    return left_after_fit(nominal, measured, dataset.instrument)


def size_of(left: Floats) -> Size:
    """Robust standard deviations of residuals (N, 3 or 6): positions, m, and rotations, rad (0 without)."""
    position, rotation = (np.linalg.norm(part, axis=1) for part in (left[:, :3], left[:, 3:]))
    return float(np.median(position)) / MEDIAN, float(np.median(rotation)) / MEDIAN
