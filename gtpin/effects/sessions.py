"""Indicator columns of sessions."""

from __future__ import annotations

import numpy as np

from gtpin.effects.situation import Situation
from gtpin.errors import ModelError, warn
from gtpin.typing import Floats


def session_columns(at: Situation) -> Floats:
    """(N, sessions) 1 where a pose belongs to the session, otherwise 0.

    A session that was not in the fit gets equal values in all columns. Its shift is then the mean shift. A warning says so.
    One column of ones where the fit had no sessions: what has changed since an earlier model is the same everywhere.

    Raises
    ------
    ModelError
        If there is no column ``session``.
    """
    if not at.has("session"):
        return np.ones((len(at), 1))
    if "session" not in at.covariates:
        raise ModelError("the covariate session is missing", column="session", hint="give a column session")
    names = np.array([str(name) for name in at.covariates["session"]])
    known = at.references.sessions
    unseen = sorted(set(names) - set(known))
    if unseen:
        warn(f"sessions never seen, which get the mean shift: {', '.join(unseen)}")
    columns = (names[:, None] == np.array(known)).astype(float)
    columns[np.isin(names, unseen)] = 1.0 / len(known)
    return np.asarray(columns)
