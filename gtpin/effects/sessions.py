"""Sessions as columns."""

from __future__ import annotations

import numpy as np

from gtpin.effects.effect import Floats
from gtpin.effects.situation import Situation
from gtpin.errors import ModelError, warn


def session_columns(at: Situation) -> Floats:
    """(N, sessions) one where a pose belongs to the session, else zero.

    A session that the fit has not seen belongs to all of them alike, so that it has the mean shift, with a warning.

    Raises
    ------
    ModelError
        If there is no column ``session``.
    """
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
