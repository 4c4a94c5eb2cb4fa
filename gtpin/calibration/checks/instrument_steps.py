"""An instrument that moved once, or for a while, during the measurement: steps of its frame are searched for along the rows.

The computation is that of :mod:`gtpin.calibration.checks.prior_conflict`, with a motion of the frame from some row on, and
back from a later one. Rows are in the order of the file, and also in the order of time where it was recorded.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.frame_scan import EDGE, FrameScan
from gtpin.calibration.checks.shifted_rows import own_session
from gtpin.calibration.checks.suspected import Size, suspect
from gtpin.calibration.noise_estimator import ENOUGH
from gtpin.calibration.problem import Point, Problem
from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.typing import Floats

RATIO = 2.0
"""Power of the residuals without steps over that with them from which steps are the reason. Assumed: a moved frame
explains all residuals, other causes only a part."""
LARGE = 4.0
"""Size of the step at the median pose, in standard deviations of the remaining residuals, from which data are refused. Assumed:
smaller steps are left to a diagnosis, which compares them with drift and other causes."""
AHEAD = 1.2
"""Ratio of the best alternative's residual power to that of steps, above which steps are the reason. The alternatives are
motions in proportion to time (to its third power), temperatures, payload or another recorded column that changes slowly.
Assumed; with 150 poses of six numbers it is a log likelihood ratio of 80 nats."""


def check_instrument_steps(dataset: Dataset, problem: Problem, point: Point, noise: ReadingNoise) -> None:
    """Suspect data during which the instrument moved by much more than its noise.

    ``dataset``: the rows of the problem. ``problem``, ``point``: the fitted problem, and the point about which it is
    linearised. ``noise``: noise of these rows, without repeatability, since a step between visits of one pose looks like
    it.

    Raises `DatasetError` if one or two steps of the frame explain the residuals; it names the rows.
    """
    if len(dataset) < 4 * EDGE:
        return
    if len(dataset) > ENOUGH:  # of very many rows, evenly spaced ones are enough
        rows = np.arange(0, len(dataset), 1 + len(dataset) // ENOUGH)
        dataset, noise = dataset.take(rows), noise.take(rows)
        problem = replace(problem, measured=problem.measured.take(rows), whitening=problem.whitening[rows])
        point = replace(point, poses=point.poses[rows])
    orders = {"": np.arange(len(dataset))}
    if "time" in dataset.covariates:
        orders[", in the order of the column time,"] = np.argsort(dataset.covariates["time"], kind="stable")
    whole = FrameScan.of(problem, point, noise)
    for words, order in orders.items():
        scan = whole.ordered(order)
        steps: list[int] = []
        while len(steps) < 2 and scan.ratio(steps) < RATIO:
            steps = sorted([*steps, scan.best(steps)])
        rows = scan.rows[steps[0] : steps[1] if len(steps) > 1 else None]
        size, moved = scan.size(steps)
        if scan.ratio(steps) < RATIO or size < LARGE or own_session(dataset, rows):
            continue
        if scan.left_by(_alternatives(dataset, scan.rows)) < AHEAD * scan.left(steps):
            continue
        lines = dataset.row[rows]
        error = DatasetError(
            f"rows {lines[0]} to {lines[-1]}{words} read {moved * 1e3:.2g} mm off what the others say, all by the same motion: "
            "the instrument was bumped or set up anew, or a drive's zero moved",
            file=dataset.file,
            row=int(lines[0]),
            hint="give these rows a session of their own in the column session, or leave them out",
        )
        before, after = (_size(scan, noise, steps) for steps in ([], steps))
        return suspect(error, dataset, before, after)


def _size(scan: FrameScan, noise: ReadingNoise, steps: list[int]) -> Size:
    """Standard deviations of the residuals with some steps, m and rad."""
    times = float(np.sqrt(2.0 * scan.left(steps) / scan.y.size))
    return times * float(noise.sigma[0]), times * float(noise.sigma[1]) if scan.y.shape[1] == 6 else 0.0


def _alternatives(dataset: Dataset, rows: npt.NDArray[np.intp]) -> Floats:
    """(M, k) alternatives to steps of the frame: powers of the rows' order, and all numeric columns but directions and
    speeds."""
    t = np.linspace(-1.0, 1.0, len(rows))
    columns = [t, t**2, t**3]
    for name, values in dataset.covariates.items():
        if name != "session" and not name.startswith(("approach", "speed")):
            column = np.asarray(values, dtype=float)[rows]
            spread = float(column.std())
            columns += [(column - column.mean()) / spread] if spread > 0.0 else []
    return np.stack(columns, axis=1)
