"""Columns that can't be right: directions of approach and speeds, sessions and the order of the rows, too many sessions."""

from __future__ import annotations

import numpy as np

from gtpin.data import Dataset
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.errors import warn


def without_contradictions(dataset: Dataset, priors: Priors = PRIORS) -> Dataset:
    """The dataset without columns that can't be right; they count as missing.

    These are ``approach`` and ``speed`` of an actuator where the two contradict each other, and ``session`` where the
    sessions alternate both in the order of time and in the order of the rows, or are too many or too short.

    A direction of approach that belongs to other rows, or to another drive, makes backlash look like servo lag, and the
    reverse. Nothing tells which of the two columns is wrong, so both count as missing.

    Warns
    -----
    GtpinWarning
        Names the columns.
    """
    wrong: list[str] = []
    for actuator in range(1, dataset.n_actuators + 1):
        names = (f"approach{actuator}", f"speed{actuator}")
        if any(name not in dataset.covariates for name in names):
            continue
        approach, speed = (np.asarray(dataset.covariates[name], dtype=float) for name in names)
        moving = speed != 0.0
        if moving.sum() < priors.fewest_moving:
            continue
        same = float((np.sign(speed[moving]) == approach[moving]).mean())
        if 1.0 - priors.agree < same < priors.agree:
            wrong += names
            text = (
                f"{names[0]} and {names[1]} contradict each other in {100.0 * (1.0 - same):.0f} % of the rows in motion"
            )
            hint = "one of them belongs to other rows or another drive, so that neither is used"
            warn(f"{dataset.file}: {text}: {hint}" if dataset.file else f"{text}: {hint}")
    text = _too_many(dataset, priors)
    if not text and _interleaved(dataset, priors):
        text = "the column session is in order neither of time nor of the rows, so that it is not used"
    if text:
        wrong.append("session")
        warn(f"{dataset.file}: {text}" if dataset.file else text)
    if not wrong:
        return dataset
    return dataset.without(wrong)


def _too_many(dataset: Dataset, priors: Priors) -> str:
    """Why the sessions can't be tested, because they are too many or too short; empty where they can."""
    if "session" not in dataset.covariates:
        return ""
    count, rows = len(set(map(str, dataset.covariates["session"]))), len(dataset)
    hint = "give rows without a new set-up in between the same session, and the time of each row in a column time"
    if count == rows > 1:
        return f"every row has its own session: looks like a time, so that the column session is not used; {hint}"
    if count > min(priors.most_sessions, rows / priors.session_rows):
        most = f"up to {priors.most_sessions} sessions of {priors.session_rows:g} rows or more on average can be tested"
        return f"{count} sessions in {rows} rows: {most}, so that the column session is not used; {hint}"
    return ""


def _interleaved(dataset: Dataset, priors: Priors) -> bool:
    """Whether sessions alternate, both in the order of the file and in the order of time; False without a column ``time``."""
    if "session" not in dataset.covariates or "time" not in dataset.covariates:
        return False
    names, session = np.unique(dataset.covariates["session"].astype(str), return_inverse=True)
    least = max(len(names) - 1, 1)
    orders = (np.argsort(dataset.row, kind="stable"), np.argsort(dataset.covariates["time"], kind="stable"))
    changes = [int((np.diff(session[order]) != 0).sum()) for order in orders]
    return len(names) > 1 and min(changes) > max(priors.interleaved * least, priors.fewest_moving)
