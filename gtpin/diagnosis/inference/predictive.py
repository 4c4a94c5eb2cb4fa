"""What causes predict of poses that were not fitted: the gap, and causes that do not improve predictions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from gtpin.diagnosis.hypotheses.hypothesis import Hypothesis
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Conclusion, Doubt
from gtpin.diagnosis.linear.cross_validation import Gap, gap, leave_out
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.priors import UNDECIDED
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import unheard
from gtpin.typing import Floats, Mask

Place = tuple[str, str]


def gaps(
    hypotheses: HypothesisSet,
    found: Conclusion,
    floor: Floats,
    blocks: list[Mask],
    rng: np.random.Generator,
    of_blocks: bool = False,
    inferred: Floats | None = None,
) -> tuple[Gap, dict[Place, Gap]]:
    """The gap with all causes; and, by cause, the gap without it.

    The parameters are those of :func:`~gtpin.diagnosis.linear.cross_validation.gap`.
    """
    design, groups = hypotheses.design, hypotheses.groups
    columns = {c.place: groups.columns(c) * found.scale[c] for c in found.classes}
    unseen = {c.place: as_unseen(design, c, groups.columns(c), blocks) * found.scale[c] for c in found.classes}

    def of(places: Iterable[Place]) -> Gap:
        none, places = np.zeros((len(design.y), 0)), tuple(places)
        causes, new = (np.hstack([none, *(some[p] for p in places)]) for some in (columns, unseen))
        return gap(
            design, causes, floor, blocks, rng, None if np.array_equal(causes, new) else new, of_blocks, inferred
        )

    return of(columns), {place: of(p for p in columns if p != place) for place in columns}


def lost(whole: Gap, less: Gap) -> float:
    """Explained fraction of the gap that is lost without a cause, with one noise floor for both. ``less``: the gap without it.

    A fit without the cause takes a part of its displacements for noise.
    """
    return float(np.clip((less.after**2 - whole.after**2) / max(whole.before**2 - whole.floor**2, 1e-300), -1.0, 1.0))


def as_unseen(design: Design, cause: Hypothesis, columns: Floats, blocks: list[Mask]) -> Floats:
    """Whitened displacements (N c, m) at each pose as predicted by a model that was fitted without the pose's block.

    A session that is completely in one block has no fitted coefficients then: it gets the mean of the other sessions, as in
    :func:`~gtpin.effects.smooth.session_columns`. ``columns``: (N c, m) displacements for coefficients of typical size.
    """
    at = design.operating_points
    if "session" not in cause.covariates(at.robot) or not at.has("session"):
        return columns
    sessions = np.array([str(name) for name in at.covariates["session"]])
    found = columns.copy()
    for block in blocks:
        lost = set(sessions[block]) - set(sessions[~block])
        if not lost:
            continue
        rows = np.repeat(block, design.components)
        elsewhere = columns[~rows].any(axis=0)
        some = OperatingPoints(
            at.kinematics,
            at.q[block],
            at.poses[block],
            {name: values[block] for name, values in at.covariates.items()},
            replace(at.references, sessions=tuple(name for name in at.references.sessions if name not in lost)),
            at.temperature,
            at.unusable,
        )
        with unheard():  # of sessions that were not fitted: here they are intended
            basis = cause.basis(some)
        moved = basis.displacement(some) * basis.sigma
        seen = design.measured.take(block).change_by(moved, design.model, some.poses)
        unseen = np.asarray(design.whitening[block] @ seen).reshape(-1, moved.shape[2])
        if unseen.shape[1] != elsewhere.sum():
            continue  # a user's own effect, with other coefficients than those of the sessions
        found[rows] = 0.0
        found[np.ix_(rows, elsewhere)] = unseen
    return found


def with_smaller_errors(hypotheses: HypothesisSet, found: Conclusion, blocks: list[Mask]) -> Conclusion:
    """The conclusion; where all causes together do not make the errors of left-out poses smaller: without causes, with a doubt.

    Errors are smaller where the product of two ratios is below 1, those of the mean squares of positions and of measured
    orientations: a wrist rotates the tool and hardly shifts it. The model that users get has no smooth terms, so none is here.

    ``blocks``: (N,) masks of the poses left out together, a partition.
    """
    if not found.classes:
        return found
    nothing = np.zeros((len(hypotheses.design.y), 0))
    alone, whole = (leave_out(hypotheses.design, some, blocks) for some in (nothing, hypotheses.columns(found.model)))
    compared = [(alone.errors, whole.errors)] + [(alone.turned, whole.turned)] * bool(alone.turned.size)
    if np.prod([(after**2).sum() / (before**2).sum() for before, after in compared]) < 1.0:
        return found
    return found.only(hypotheses, []).doubted(Doubt("held_out"))


def without_certainty(found: Conclusion, whole: Gap, less: Mapping[Place, Gap]) -> Conclusion:
    """The conclusion, in which a cause without which the errors of left-out poses are no larger is at most as likely as not.

    Errors are compared as in :func:`with_smaller_errors`. ``whole``, ``less``: as :func:`gaps` returns them.
    """

    def size(of: Gap) -> float:
        return of.after if of.turns is None else of.after * of.turns.after

    return found.bounded([c for c in found.classes if size(whole) >= size(less[c.place])], UNDECIDED)
