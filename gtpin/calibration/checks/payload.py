"""Other readings of recorded payloads: the load's absence, a mark of a load, or another unit in place of kg."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gtpin.calibration.gauss_newton import Fit
from gtpin.data import Dataset
from gtpin.data.files import warn_of
from gtpin.kinematics.rotations import frame_motions
from gtpin.robot.placement_frames import frame_of_joint
from gtpin.typing import Floats

MISREAD = "payload looks "
"""Beginning of what a warning says of a column that is misread: a diagnosis leaves it out."""
MARK = "payload is 0 or 1 in all rows, and taken as kg; where it marks a load, write its mass: compliances are off by as much"
UNITS = (
    ("like g", "divide it by 1000", 1e-3),
    ("like N", "divide it by 9.81", 1.0 / 9.81),
    ("like pounds", "multiply it by 0.4536", 0.4536),
)
GAIN = 40.0
"""Logarithm of the ratio of the squared residuals of two readings, times the degrees of freedom, from which the better one is
named: a factor of exp(20) in likelihood, over some 200 readings. Assumed."""
LOADS = np.geomspace(0.05, 200.0, 100)
"""Masses, kg, that a mark may stand for."""
Way = tuple[str, str, float, float]
"""What a column looks like, a hint, and a and b: the payload is a + b times the column, kg."""


def _ways(column: Floats) -> Iterator[Way]:
    """Other readings of a column (N,)."""
    low, high = float(column.min()), float(column.max())
    mark, varies = bool(np.isin(column, (0.0, 1.0)).all()), high > low
    absent = "inverted (0 where the load is on)"
    if mark and varies:
        for mass in LOADS:
            yield "like a mark of the load", f"write the mass, about {mass:.2g} kg, in place of 1", 0.0, mass
            hint = f"write the mass, about {mass:.2g} kg, in place of 0, and 0 in place of 1"
            yield f"{absent}, and like a mark of the load", hint, mass, -mass
        return
    if varies:
        yield absent, f"write {high + low:g} less the column", high + low, -1.0
    for looks, hint, factor in UNITS:
        yield looks, hint, 0.0, factor


def check_payload(dataset: Dataset, fit: Fit) -> None:
    """Suspect recorded payloads with which compliant joints explain the residuals of a fit far worse than by another reading.

    Each joint of a robot without rods may give way about three axes (along three where it slides), in the direction of its
    load: dq = c M(m) with c >= 0 and the load M at the payload m. For each reading of the column the c are fitted to the
    residuals, linearly and together with the geometry and a frame that moves with the payload. A reading must be far better
    than no payload too: errors that depend on the commands alone can look like loads without one.

    ``dataset``: the rows of the fit. Warns: of a reading with which the residuals are much smaller, and of a column of 0 and 1,
    which may say no mass.
    """
    column = np.asarray(dataset.covariates.get("payload", np.zeros(1)), dtype=float)
    problem, point = fit.problem, fit.point
    kinematics, q, robot = point.model.kinematics, problem.measured.q, point.model.robot
    if robot.rod_sites or not column.any() or len(column) != len(q):
        return
    if np.isin(column, (0.0, 1.0)).all() and np.ptp(column):
        warn_of(dataset.file, MARK)
    given = [np.asarray(dataset.covariates.get(name, np.zeros(len(q))), dtype=float) for name in ("fx", "fy", "fz")]
    force, bodies = np.stack(given, axis=1), kinematics.motion(q, point.poses)
    bare, one = (kinematics.loads(q, point.poses, force, mass * np.ones(len(q))).joints for mass in (0.0, 1.0))
    root = np.sqrt(fit.weight)[:, None, None]
    per_mass, parts = one - bare, list[list[Floats]]()
    for joint in robot.moving_joints:
        turns = robot.model.joints[joint].shortname().startswith("JointModelR")
        frame, part = frame_of_joint(joint), slice(3, 6) if turns else slice(0, 3)
        moved = problem.measured.change_by(bodies.by_twist(frame, np.eye(6)[:, part]), point.model, point.poses)
        moved = root * (problem.whitening @ moved)
        own, per = bare[:, None, frame, part], per_mass[:, None, frame, part]
        parts.append([moved * own, moved * per, moved * per * column[:, None, None]])
    links, unit, read = (np.concatenate(found, axis=2) for found in zip(*parts, strict=True))
    shifts = frame_motions(point.poses.T - kinematics.home.T[0]) * column[:, None, None]
    others = bodies.by_twist(frame, np.eye(6)).shape[1] - 6  # measured links and joints, which do not move
    shifts = np.pad(shifts, ((0, 0), (0, others), (0, 0)))
    frames = problem.whitening @ problem.measured.change_by(shifts, point.model, point.poses)
    B = np.concatenate([problem.jacobian(point, rows) for rows in problem.chunks()])
    k, loads = B.shape[2], links.shape[2]
    y = problem.residual(point) + B @ point.x
    columns_of = [root * B, root * frames, links, unit, read, root * y[..., None]]
    above = np.concatenate(columns_of, axis=2).reshape(-1, k + 6 + 3 * loads + 1)
    below = np.pad(np.diag(np.sqrt(problem.prior)), ((0, 0), (0, 6 + 3 * loads + 1)))
    # Without what the geometry absorbs, and a frame that moves with the payload.
    R = np.asarray(np.linalg.qr(np.vstack([above, below]), mode="r"))[k + 6 :, k + 6 :]
    links, unit, read, left = R[:, :loads], R[:, loads : 2 * loads], R[:, 2 * loads : -1], R[:, -1]

    def squares(a: float, b: float) -> float:
        from scipy.optimize import nnls

        columns = links + a * unit + b * read
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        return float(nnls(columns / size, left)[1] ** 2)

    now, without = squares(0.0, 1.0), squares(0.0, 0.0)
    least, (looks, hint, *_) = min(
        ((squares(a, b), (looks, hint)) for looks, hint, a, b in _ways(column)), key=lambda x: x[0]
    )
    free = max(problem.count - fit.effective_parameters - loads, 1.0)
    if free * np.log(min(now, without) / least) > GAIN:
        times = f"compliant joints then leave {np.sqrt(least / now):.0%} of the residuals that they leave now"
        warn_of(dataset.file, f"{MISREAD}{looks}: {times}. {hint.capitalize()}, or leave the column out")
