"""Causes that do not improve predictions: they only replace a change of the geometry that the tolerances make improbable."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.left_out_block import Block
from gtpin.diagnosis.hypotheses.hypothesis_set import HypothesisSet
from gtpin.diagnosis.inference.findings import Doubt
from gtpin.diagnosis.inference.verdict import Conclusion
from gtpin.diagnosis.linear.cross_validation import LeftOut, leave_out
from gtpin.diagnosis.linear.design import Design
from gtpin.diagnosis.linear.exchange import without
from gtpin.typing import Floats, Mask


def without_idle(hypotheses: HypothesisSet, found: Conclusion, blocks: list[Mask]) -> Conclusion:
    """The conclusion without causes that hardly increase the probability density of left-out poses.

    A real cause acts at other poses as well. A false cause may only replace a change of the geometry that the tolerances make
    improbable: it gains evidence, but does not improve predictions.

    Parameters
    ----------
    blocks
        (N,) masks of the poses left out together, a partition.
    """
    design, groups = hypotheses.design, hypotheses.groups
    columns = {cause: groups.columns(cause) * found.scale[cause] for cause in found.classes}
    kept = list(found.classes)
    for cause in found.classes:
        others = [columns[c] for c in kept if c != cause]
        gain = _log_density(design, [*others, columns[cause]], blocks) - _log_density(design, others, blocks)
        model = hypotheses.only(found.model, kept)
        evidence = model.log_evidence - without(groups, model, cause).log_evidence
        if gain <= hypotheses.priors.predicted * max(evidence, 0.0):
            kept = [c for c in kept if c != cause]
    return found if len(kept) == len(found.classes) else found.only(hypotheses, kept)


def with_smaller_errors(hypotheses: HypothesisSet, found: Conclusion, blocks: list[Mask], floor: Floats) -> Conclusion:
    """The conclusion; where all causes together do not make the errors of left-out poses smaller: without causes, with a doubt.

    The errors are those of positions. In two cases it is enough that the errors of measured orientations become smaller: where
    the position errors of the geometry alone are at the noise floor, and for robots without rods, whose wrist can rotate the
    tool and hardly shift it.

    Parameters
    ----------
    blocks
        (N,) masks of the poses left out together, a partition.
    floor
        (N,) expected squared length of each pose's position noise, m^2.
    """
    if not found.classes:
        return found
    columns = np.hstack([hypotheses.groups.columns(cause) * found.scale[cause] for cause in found.classes])
    alone, whole = (leave_out(hypotheses.design, some, blocks) for some in (columns[:, :0], columns))
    if any(float((b**2).sum()) < float((a**2).sum()) for a, b in _compared(hypotheses, alone, whole, floor)):
        return found
    return found.only(hypotheses, []).doubted(Doubt("held_out"))


def _compared(hypotheses: HypothesisSet, alone: LeftOut, whole: LeftOut, floor: Floats) -> list[tuple[Floats, Floats]]:
    """Errors without and with causes, of positions and of orientations, of which one must be smaller with causes."""
    at_noise = float((alone.errors**2).sum()) <= hypotheses.priors.silent**2 * float(floor.sum())
    found = [(alone.errors, whole.errors)]
    if alone.turned.size and (at_noise or not hypotheses.design.situation.robot.rods):
        found.append((alone.turned, whole.turned))
    return found


def _log_density(design: Design, causes: list[Floats], blocks: list[Mask]) -> float:
    """Sum over the blocks of the log probability density of each given the others, with the priors of geometry and causes."""
    J = np.hstack([design.B, *causes])
    prior = np.concatenate([design.prior, np.ones(J.shape[1] - len(design.prior))])
    root = np.linalg.inv(np.linalg.cholesky(J.T @ J + np.diag(prior))).T
    half = J @ root
    left = design.y - half @ (half.T @ design.y)
    total = 0.0
    for block in blocks:
        rows = np.flatnonzero(np.repeat(block, design.components))
        total += Block.of(half[rows], left[rows]).log_density
    return total
