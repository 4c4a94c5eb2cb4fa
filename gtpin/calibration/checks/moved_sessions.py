"""An instrument that was at another place in each session: each session fits with a separate frame, but not with one frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gtpin.calibration.checks.moved_rows import FrameScan, nominal_problem
from gtpin.calibration.checks.recognise import expected_errors
from gtpin.calibration.checks.suspected import refuse
from gtpin.calibration.problem import Measured, Problem, measured_poses, rough_frame
from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Frame, Model
from gtpin.noise.estimate import ENOUGH
from gtpin.typing import Mask

FEWEST = 6
"""Fewest rows from which the frame of a session is determined. Assumed."""
FAR = 0.01
"""Motion, m, from which data are refused before a fit. Assumed: with such motions no diagnosis is linear about one frame."""
FAILED = 1e-3
"""Motion, m, from which data are refused after a fit has failed. Assumed."""
CLEAR = 4.0
"""Ratio of a motion to the residuals with a separate frame for each session, above which the motion is clear. Assumed."""
EXPECTED = 3.0
"""Ratio of a motion to the expected error of the nominal model, above which the motion is clear: the best frame for a part of
the workspace absorbs such errors. Assumed."""
BEYOND = 0.1
"""Motion, m, that is too large to be an error of the geometry. Assumed."""
LINE = 0.1
"""Ratio of the width of a session's poses to the length of the workspace, below which positions do not determine a rotation.
Assumed."""
RATIO = 4.0
"""Power of the residuals without motions over that with them from which motions are why a fit failed. Assumed."""
NAMED = 5
"""Largest number of sessions that an error names."""


def check_sessions(dataset: Dataset, nominal: Model, poses: Poses) -> None:
    """Check that the instrument had the same pose in all sessions.

    ``poses``: (N) poses of the nominal model at the dataset's commands, base frame; NaN where it can't reach.

    Raises `DatasetError` if the pose differs; it names the sessions, and the distance of each from the largest one, m.
    """
    there = np.flatnonzero(poses.reached)
    if not len(there):
        return
    part, poses = dataset.take(there), poses[there]
    measured = measured_poses(part)
    moved = _moved(part, nominal, measured, poses)
    if FAR <= max(moved.values(), default=0.0) < BEYOND:
        free = dataset.instrument.frame == "free"
        frame = rough_frame(poses, measured) if free else Frame()
        own = Readings.of(part, nominal.robot)
        c = own.components
        unit = np.broadcast_to(np.eye(c), (len(part), c, c))
        moved = _moved_linear(part, Problem(replace(nominal, frame=frame), own, unit, free), poses)
    _suspect(dataset, moved, FAR)


def check_sessions_linear(dataset: Dataset, problem: Problem, near: Poses) -> None:
    """As :func:`check_sessions`, after a fit has failed: with one geometry for all sessions, it finds smaller motions.

    ``problem``, ``near``: the problem about the nominal machine, and the machine's poses, base frame.

    Raises `DatasetError` if motions of the frame between sessions explain most of the power of the residuals.
    """
    _suspect(dataset, _moved_linear(dataset, problem, near), FAILED)


def _moved_linear(dataset: Dataset, problem: Problem, near: Poses) -> dict[str, float]:
    """As `_moved`, by a linear fit of one geometry and of each session's frame."""
    sessions, names = _sessions(dataset)
    if len(names) < 2:
        return {}
    rows = np.arange(0, len(dataset), 1 + len(dataset) // ENOUGH)
    thin, noise = nominal_problem(problem.take(rows, problem.whitening[rows]))
    scan = FrameScan.of(thin, thin.point(np.zeros(thin.size), near[rows]), noise)
    columns = (sessions[rows, None] == np.array(names[1:])).astype(float)
    left, _, moved = scan.moved_with(columns)
    return {} if scan.left(()) < RATIO * left else dict(zip(names, [0.0, *moved.tolist()], strict=True))


def _suspect(dataset: Dataset, moved: dict[str, float], least: float) -> None:
    """Suspect an instrument that moved by ``least`` m or more; ``moved``: distances from the first session, m."""
    first, *others = moved or [""]
    far = sorted((name for name in others if moved[name] >= least), key=lambda name: -moved[name])
    if not far:
        return
    moves = ", ".join(f"{1e3 * moved[name]:.3g} mm in session {name}" for name in far[:NAMED])
    more = f" and {len(far) - NAMED} more sessions" if len(far) > NAMED else ""
    error = DatasetError(
        f"the instrument moved between sessions: from where it stood in session {first} by {moves}{more}",
        file=dataset.file,
        column="session",
        hint="make a dataset of each session, or register the sessions to common marks and give all poses in one frame",
    )
    refuse(error, dataset)


def _sessions(dataset: Dataset) -> tuple[NDArray[np.str_], list[str]]:
    """The session of each row, and the names of the sessions with at least `FEWEST` rows, the largest first."""
    if "session" not in dataset.covariates:
        return np.full(len(dataset), ""), []
    sessions = np.array([str(name) for name in dataset.covariates["session"]])
    names, counts = np.unique(sessions, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return sessions, [str(names[k]) for k in order if counts[k] >= FEWEST]


def _moved(dataset: Dataset, nominal: Model, measured: Measured, poses: Poses) -> dict[str, float]:
    """Distance, m, of each session's poses from where the frame of the largest session puts them; empty where not clear."""
    sessions, names = _sessions(dataset)
    names = [name for name in names if _tells_frame(measured, poses, sessions == name)]
    if len(names) < 2:
        return {}
    places, left = {}, np.full(len(poses), np.nan)
    for name in names:
        own = sessions == name
        frame = rough_frame(poses[own], measured.take(np.flatnonzero(own)))
        places[name] = frame
        left[own] = np.linalg.norm(measured.T[own] - poses[own].moved(frame.T, frame.R).T, axis=1)
    first = places[names[0]]
    moved = {}
    for name, frame in places.items():
        apart = poses.T[sessions == name] @ (frame.R - first.R).T + (frame.T - first.T)
        moved[name] = float(np.median(np.linalg.norm(apart, axis=1)))
    some = np.linspace(0, len(poses) - 1, min(len(poses), 100)).astype(int)
    expected = expected_errors(nominal, measured.q[some], poses[some])[0]
    clear = max(CLEAR * float(np.nanmedian(left)), EXPECTED * expected)
    return moved if max(moved.values()) > clear else {}


def _tells_frame(measured: Measured, poses: Poses, own: Mask) -> bool:
    """Whether a session's rows determine a frame: by orientations, or by positions that do not lie on a line."""
    if measured.R is not None:
        return True
    all_, mine = (
        np.linalg.svd(T - T.mean(axis=0), compute_uv=False) / np.sqrt(len(T)) for T in (poses.T, poses.T[own])
    )
    return bool(mine[1] > LINE * all_[0])
