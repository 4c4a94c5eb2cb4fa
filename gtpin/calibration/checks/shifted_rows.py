"""Measurements in the rows of other commands, and sequences of rows during which the instrument had moved."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.checks.suspected import suspect
from gtpin.calibration.problem import Measured, rough_frame
from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.kinematics.poses import Poses
from gtpin.typing import Floats, Indices, Mask

FEWEST = 8
"""Fewest rows of a stretch, a sequence of rows. Assumed: eight consecutive rows with large errors are not due to chance."""
SHARE = 0.1
"""Share of rows with large errors from which a stretch is searched for: the largest share that scattered gross errors have."""
WITHIN = 0.6
"""Smallest share of a stretch's rows that have large errors, and of all rows with large errors that are in it."""
MENDED = 0.1
"""Largest share of a stretch's error that remains after the correction. Assumed: a neighbour's command or a moved frame
explains the whole error or nothing."""
OWN = 0.8
"""Share of a session's rows that must lie in a stretch for the session to be the stretch's own."""
NEIGHBOURS = (1, -1)
"""Shifts of the commands, in rows, that are tried."""


def check_stretch(dataset: Dataset, measured: Measured, predicted: Poses, far: Mask, *, bumps: bool = True) -> None:
    """Suspect data in which a stretch of rows is shifted relative to its commands, or was measured from another place.

    ``measured``, ``predicted``: (N) measured poses, and poses that a model predicts at the commands of the same rows, both
    in the instrument's frame. ``far``: (N,) rows with large errors. ``bumps``: whether a motion of the instrument is
    searched for too: not before a fit, since a nominal robot that is far off looks like one.

    Raises `DatasetError` if one of the two explains a stretch; it names the rows by their lines in the file.
    """
    part = stretch(far)
    if part is None:
        return
    first, last = part.start, part.stop - 1
    off = _off(measured.T, predicted.T)
    usual = float(np.nanmedian(off[~far])) if not far.all() else 0.0
    rows = f"rows {dataset.row[first]} to {dataset.row[last]}"
    for by in NEIGHBOURS:
        neighbour = np.roll(predicted.T, by, axis=0)
        inner = slice(first + 1, last)  # the ends have no neighbour in the stretch
        left = np.nanmedian(_off(measured.T[inner], neighbour[inner]))
        if left < max(MENDED * np.nanmedian(off[part]), 3.0 * usual):
            error = DatasetError(
                f"the commands look one row off in {rows}: what was measured there fits the commands of the row "
                f"{'before' if by > 0 else 'after'}",
                file=dataset.file,
                row=int(dataset.row[first]),
                hint="move the commands of these rows, or export the table anew",
            )
            return suspect(error, dataset, (float(np.nanmedian(off[part])), 0.0), (float(left), 0.0))
    if not bumps:
        return
    moved = rough_frame(predicted[part], measured.take(part))
    left = np.nanmedian(_off(measured.T[part], predicted[part].moved(moved.T, moved.R).T))
    if left < max(MENDED * float(np.nanmedian(off[part])), 3.0 * usual) and not own_session(dataset, part):
        error = DatasetError(
            f"{rows} are {1e3 * np.nanmedian(off[part]):.3g} mm from where the other rows say, all by the same motion: the "
            "instrument was bumped or set up anew",
            file=dataset.file,
            row=int(dataset.row[first]),
            hint="give these rows a session of their own in the column session, or leave them out",
        )
        suspect(error, dataset, (float(np.nanmedian(off[part])), 0.0), (float(left), 0.0))


def stretch(far: Mask) -> slice | None:
    """The stretch of rows that contains most of the rows with large errors (``far``); None where these are few or scattered."""
    count = int(far.sum())
    if count < max(FEWEST, SHARE * len(far)):
        return None
    # The run of largest sum where a far row counts one and another one takes one away (Kadane).
    best, here, start, found = 0, 0, 0, slice(0, 1)
    for i, value in enumerate(np.where(far, 1, -1)):
        if here <= 0:
            here, start = 0, i
        here += int(value)
        if here > best:
            best, found = here, slice(start, i + 1)
    inside = far[found]
    if len(inside) < FEWEST or inside.mean() < WITHIN or inside.sum() < WITHIN * count:
        return None
    return found


def far_from_nominal(measured: Measured, nominal: Poses, reach: float) -> Mask:
    """(N,) True for rows that are farther from the nominal machine than its tolerances can displace it (``reach``, m)."""
    return np.asarray(_off(measured.T, nominal.T) > reach)


def _off(one: Floats, two: Floats) -> Floats:
    return np.asarray(np.linalg.norm(one - two, axis=1))


def own_session(dataset: Dataset, rows: Indices | slice) -> bool:
    """Whether some rows have sessions of their own, so that effects of sessions can account for them."""
    if "session" not in dataset.covariates:
        return False
    inside = np.zeros(len(dataset), dtype=bool)
    inside[rows] = True
    session = np.unique(dataset.covariates["session"], return_inverse=True)[1]
    share = np.bincount(session, inside) / np.bincount(session)
    return bool(len(share) > 1 and np.median(share[session[inside]]) > OWN)
