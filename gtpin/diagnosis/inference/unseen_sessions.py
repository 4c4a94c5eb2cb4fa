"""Predictions for a session that was not fitted, by a cause with separate coefficients for each session."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.linear.design import Design
from gtpin.effects.situation import Situation
from gtpin.errors import unheard
from gtpin.typing import Floats, Mask


def as_unseen(design: Design, cause: Hypothesis, columns: Floats, blocks: list[Mask]) -> Floats:
    """Whitened displacements (N c, m) at each pose as predicted by a model that was fitted without the pose's block.

    A session that is completely in one block has no fitted coefficients then: it gets the mean of the other sessions, as in
    :func:`~gtpin.effects.smooth.session_columns`.

    Parameters
    ----------
    columns
        (N c, m) whitened displacements of all poses, for coefficients of typical size.
    blocks
        (N,) masks of the poses left out together, a partition.
    """
    at = design.situation
    if "session" not in cause.covariates(at.robot):
        return columns
    sessions = np.array([str(name) for name in at.covariates["session"]])
    found = columns.copy()
    for block in blocks:
        lost = set(sessions[block]) - set(sessions[~block])
        if not lost:
            continue
        rows = np.repeat(block, design.components)
        elsewhere = columns[~rows].any(axis=0)
        unseen = _columns(design, cause, block, lost)
        if unseen.shape[1] != elsewhere.sum():
            continue  # a user's own effect, with other coefficients than those of the sessions
        found[rows] = 0.0
        found[np.ix_(rows, elsewhere)] = unseen
    return found


def _columns(design: Design, cause: Hypothesis, block: Mask, lost: set[str]) -> Floats:
    """(n c, m') whitened displacements of the poses of a block, in a fit without some sessions."""
    at = design.situation
    known = tuple(name for name in at.references.sessions if name not in lost)
    some = Situation(
        at.kinematics,
        at.q[block],
        at.poses[block],
        {name: values[block] for name, values in at.covariates.items()},
        replace(at.references, sessions=known),
        at.temperature,
        at.unusable,
    )
    with unheard():  # of sessions that were not fitted: here they are intended
        basis = cause.basis(some)
    moved = basis.displacement(some) * basis.sigma
    seen = design.measured.take(block).seen(moved, design.model, some.poses)
    return np.asarray(design.whitening[block] @ seen).reshape(-1, moved.shape[2])
