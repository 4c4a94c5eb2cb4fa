"""Positions that are in another unit than metres in a part of the rows: which rows, and which unit."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.checks import limits
from gtpin.calibration.checks.readings import UNITS
from gtpin.calibration.checks.suspected import suspect
from gtpin.calibration.problem import Measured, rough_frame
from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.instruments.frame_and_target import nearest
from gtpin.kinematics.poses import Poses
from gtpin.typing import Floats, Mask


def check_mixed_units(dataset: Dataset, poses: Poses) -> None:
    """Suspect positions that are in another unit in a part of the rows.

    ``poses``: (N) poses of the nominal model at the rows of the dataset, base frame; NaN where it can't reach.

    Raises `DatasetError` if there are such rows; it gives their number, and the lines of the first and the last in the
    file.
    """
    there = poses.reached
    found = _part(dataset.position[there], poses[there], dataset.instrument.frame == "free") if there.any() else None
    if found is None:
        return
    rows, unit, factor, before, after = found
    lines = dataset.row[there][rows]
    error = DatasetError(
        f"x y z look like {unit} in {rows.sum()} of {len(dataset)} rows, the first in line {lines.min()} and the last in line "
        f"{lines.max()} of the file, and like metres in the others",
        file=dataset.file,
        row=int(lines.min()),
        column="x y z",
        hint=f"multiply x, y and z of these rows by {factor:g}",
    )
    suspect(error, dataset, (before, 0.0), (after, 0.0))


def _part(T: Floats, poses: Poses, free: bool) -> tuple[Mask, str, float, float, float] | None:
    """The rows in another unit, its name, its length in metres, and the rows' median errors, m, as metres and in it."""
    least = max(limits.FEWEST_ROWS, int(np.ceil(limits.MIXED_SHARE * len(T))))
    if len(T) < 2 * least:
        return None
    near = (
        limits.ACCEPTED * float(np.median(np.linalg.norm(poses.T - np.median(poses.T, axis=0), axis=1)))
        + limits.ALLOWED
    )
    seen = _seen(T, poses, near) if free else poses.T
    off = _off(T, seen)
    fits = off[0] <= near
    tried = zip(UNITS, off[1:], strict=True)
    for (unit, factor), left in sorted(tried, key=lambda pair: -int((pair[1] <= near).sum())):
        rows = (left <= near) & (off[0] > limits.BETTER * left)
        if least <= rows.sum() <= len(T) - least and fits[~rows].mean() >= limits.MIXED_REST:
            return rows, unit, factor, float(np.median(off[0][rows])), float(np.median(left[rows]))
    return None


def _off(T: Floats, seen: Floats) -> Floats:
    """(1 + units, N) distances, m, of positions read in metres and in each other unit from where they should be."""
    return np.stack([np.linalg.norm(f * T - seen, axis=1) for f in (1.0, *(factor for _, factor in UNITS))])


def _seen(T: Floats, poses: Poses, near: float) -> Floats:
    """(N, 3) where a free instrument should see the poses, by the frame in which most rows fit in some unit."""
    some = np.linspace(0, len(T) - 1, min(len(T), limits.MIXED_ROWS)).astype(int)
    everywhere, T, poses = poses, T[some], poses[some]
    rng = np.random.default_rng(0)
    rows = np.argsort(rng.random((limits.TRIPLES, len(T))), axis=1)[:, :3]
    a, b = poses.T[rows], T[rows]
    centre_a, centre_b = a.mean(axis=1), b.mean(axis=1)
    R = nearest(np.swapaxes(b - centre_b[:, None], 1, 2) @ (a - centre_a[:, None]))
    shift = centre_b - (R @ centre_a[..., None])[..., 0]
    tried = [_off(T, poses.T @ R[k].T + shift[k]) for k in range(limits.TRIPLES)]
    off = max(tried, key=lambda off: (int((off.min(axis=0) <= near).sum()), -float(np.median(off.min(axis=0)))))
    good = off[0] <= near
    if good.sum() < limits.FEWEST_ROWS:  # no frame
        return np.full_like(everywhere.T, np.inf)
    # Three rows determine a frame roughly; all rows that fit in it determine it well.
    frame = rough_frame(poses[good], Measured(np.zeros((int(good.sum()), 0)), T[good], None))
    return np.asarray(everywhere.moved(frame.T, frame.R).T)
