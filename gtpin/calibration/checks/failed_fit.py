"""Searches the data for the reason why a fit has failed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from gtpin.calibration.checks.coarse_commands import coarse_commands
from gtpin.calibration.checks.moved_sessions import check_sessions_linear
from gtpin.calibration.checks.shifted_rows import check_stretch
from gtpin.calibration.problem import Measured
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data import Dataset
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.typing import Mask

POOR = 1e-3
"""Position error, m, that no effect of the catalogue leaves after a calibration. Assumed."""


@contextlib.contextmanager
def explained(dataset: Dataset, fit: RobustFit, measured: Measured, far: Mask) -> Iterator[None]:
    """Context of a fit: if it fails because of sessions with different frames, or of coarse commands, the error says so.

    So does a stretch of rows that is shifted, among those ``far`` (N,) from the nominal machine. Errors that name rows are left
    as they are.
    """
    try:
        yield
    except (ConvergenceError, DatasetError) as error:
        if error.row is not None:
            raise
        check_stretch(dataset, measured, fit.whole.start.seen(fit.near), far)
        check_sessions_linear(dataset, fit.whole, fit.near)
        coarse = coarse_commands(fit.whole.start, measured, fit.near)
        if coarse is None:
            raise
        hint = f"give commands with more digits; if they are exact: {error.what}"
        columns = f"q1 .. q{measured.q.shape[1]}"
        raise DatasetError(coarse, file=dataset.file, column=columns, hint=hint) from None


def check_poor(dataset: Dataset, fit: RobustFit, measured: Measured, left: float) -> None:
    """As :func:`explained`, for a fit that leaves more than any effect: sessions are refused, coarse commands are warned of.

    ``left``: root mean square position error, m.
    """
    if left <= POOR:
        return
    check_sessions_linear(dataset, fit.whole, fit.near)
    if coarse := coarse_commands(fit.whole.start, measured, fit.near):
        warn(f"{coarse}; give commands with more digits")
