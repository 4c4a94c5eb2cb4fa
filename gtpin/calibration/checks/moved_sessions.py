"""An instrument that was set up elsewhere in each labelled session: each session fits by a frame of its own, not by one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import Measured, rough_frame
from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.kinematics.poses import Poses
from gtpin.model import Model

Floats = npt.NDArray[np.float64]

FEWEST = 6
"""Rows below which a session tells no frame."""
FAR = 0.01
"""Motion, m, from which data are refused before a fit. A stated assumption: no diagnosis is linear about one frame then, and
nobody calls two such setups one."""
FAILED = 1e-3
"""The same where a fit has failed."""
CLEAR = 4.0
"""Motion over the misfit that frames of their own leave, from which it is a motion. A stated assumption."""
EXPECTED = 3.0
"""Motion over the nominal model's expected error from which it is a motion: a frame in a part of the workspace follows such
errors. A stated assumption."""
NAMED = 5
"""Sessions that are named."""


def check_sessions(dataset: Dataset, nominal: Model, measured: Measured, poses: Poses, least: float = FAR) -> None:
    """Refuse data in which the instrument stood elsewhere in some sessions.

    Parameters
    ----------
    measured, poses
        (N) what was measured at the rows of the dataset, and what the nominal model has there, base frame; NaN where it can't
        reach.
    least
        Motion, m, below which data are let pass.

    Raises
    ------
    DatasetError
        If so; it names the sessions, and how far each is from the one with the most rows.
    """
    moved = _moved(dataset, nominal, measured, poses)
    if not moved or max(moved.values()) < least:
        return
    far = sorted((name for name in moved if moved[name] >= least), key=lambda name: -moved[name])
    usual = next(name for name in moved if moved[name] == 0.0)
    said = ", ".join(f"{1e3 * moved[name]:.2g} mm in session {name}" for name in far[:NAMED])
    more = f" and {len(far) - NAMED} more sessions" if len(far) > NAMED else ""
    raise DatasetError(
        f"the instrument moved between sessions: from where it stood in session {usual} by {said}{more}",
        file=dataset.file,
        column="session",
        hint="make a dataset of each session, or register the sessions to common marks and give all poses in one frame",
    )


def _moved(dataset: Dataset, nominal: Model, measured: Measured, poses: Poses) -> dict[str, float]:
    """By session, how far the instrument stood from where it stood in the largest, m; nothing where that is not clear."""
    if "session" not in dataset.covariates:
        return {}
    there = np.flatnonzero(poses.reached)
    sessions = np.array([str(name) for name in dataset.covariates["session"]])[there]
    names, counts = (list(part) for part in np.unique(sessions, return_counts=True))
    names = [
        str(name) for name, count in sorted(zip(names, counts, strict=True), key=lambda p: -p[1]) if count >= FEWEST
    ]
    if len(names) < 2:
        return {}
    measured, poses = measured.take(there), poses[there]
    middle = np.median(poses.T, axis=0)
    places, left = {}, np.full(len(there), np.nan)
    for name in names:
        own = sessions == name
        frame = rough_frame(poses[own], measured.take(np.flatnonzero(own)))
        places[name] = frame
        left[own] = np.linalg.norm(measured.T[own] - poses[own].moved(frame.T, frame.R).T, axis=1)
    first = places[names[0]]
    moved = {}
    for name, frame in places.items():
        own = poses.T[sessions == name] if name != names[0] else middle[None]
        apart = own @ (frame.R - first.R).T + (frame.T - first.T)
        moved[name] = float(np.median(np.linalg.norm(apart, axis=1)))
    clear = max(CLEAR * float(np.nanmedian(left)), EXPECTED * _expected(nominal, measured, poses))
    return moved if max(moved.values()) > clear else {}


def _expected(nominal: Model, measured: Measured, poses: Poses) -> float:
    """The nominal model's error by its tolerances, m, in the median."""
    some = np.linspace(0, len(poses) - 1, min(len(poses), 100)).astype(int)
    J = nominal.kinematics.geometry_jacobian(measured.q[some], poses[some])[:, :3] * nominal.geometry.tolerance
    return float(np.median(np.sqrt((J**2).sum(axis=(1, 2)))))
