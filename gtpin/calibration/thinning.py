"""Fewer poses of very many: a random half, and those that determine the geometry best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.before_fit import fittable
from gtpin.data import Dataset
from gtpin.errors import ModelError, unheard, warn
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats, Indices, Mask

PER_CHOSEN, CANDIDATES = 4, (5_000, 40_000)
"""Number of poses drawn at random for each that is chosen, and the fewest and most of them. It does not grow with the dataset,
so that the choice takes a time that is linear in the rows."""
VISITS = 10
"""Most rows of a pose."""


def thinned(dataset: Dataset, geometry: Geometry, poses: int) -> Dataset:
    """The dataset with as many of its poses, each with at most ``VISITS`` of its rows in their order.

    A half is drawn at random, so that errors which the model does not describe have the weight that they have in the whole. The
    others are those of a larger random choice that together determine the parameters of ``geometry`` and the instruments'
    unknowns best: greedily, those of the largest gain in log det(I + B'B), with B the derivative by the parameters in units of
    their tolerances, whitened by the declared noise (D-optimality; Pronzato and Wang, Sequential online subsampling for
    thinning experimental designs, 2021). Measured values have no influence but that of rows that no calibration can use. The
    same dataset gives the same poses.

    Raises `ModelError` if ``poses`` is no number of poses, and errors of a calibration's checks.
    Warns: says how many rows are used. A dataset that has no more poses is returned as it is.
    """
    if isinstance(poses, bool) or not isinstance(poses, (int, np.integer)) or poses < 1:
        raise ModelError(f"poses={poses!r}", hint="give an integer of 1 or more")
    count = int(dataset.visits.max()) + 1
    if poses >= count:
        return dataset
    drawn = np.random.default_rng(0).permutation(count)[: max(poses, int(np.clip(PER_CHOSEN * poses, *CANDIDATES)))]
    by_pose = np.argsort(dataset.visits, kind="stable")
    ordered = dataset.visits[by_pose]
    earlier = np.arange(len(dataset)) - np.searchsorted(ordered, ordered)
    rows = np.sort(by_pose[earlier < VISITS])
    some = dataset.take(rows[np.isin(dataset.visits[rows], drawn)])
    chosen = np.zeros(count, dtype=bool)
    chosen[drawn[: poses - poses // 2]] = True
    order = np.sort(drawn)  # as ``some.visits`` counts them
    chosen[order[_most_telling(some, geometry, chosen[order], poses)]] = True
    found = dataset.take(rows[chosen[dataset.visits[rows]]])
    warn(
        f"{len(found):,} of {len(dataset):,} rows are used: {poses:,} poses, a half of them at random, the others those that "
        "determine the geometry best"
    )
    return replace(found, rows_of=dataset.rows_of or len(dataset))


def _most_telling(some: Dataset, geometry: Geometry, chosen: Mask, poses: int) -> Indices:
    """Indices of the poses of ``some`` that bring the number of ``chosen`` ones to ``poses``."""
    with unheard():  # the calibration of what is chosen warns again
        _, _, _, kept, near, problem, _ = fittable(some, geometry)
    sigma = problem.measured.initial_sigma[problem.measured.group]
    point = problem.point(problem.first, near)
    B = np.concatenate([problem.jacobian(point, rows) for rows in problem.chunks()]) / sigma[:, :, None]
    pose = np.searchsorted(np.unique(some.pose), kept.pose)
    taken, added, information = chosen.copy(), chosen, np.diag(problem.prior)
    while True:
        flat = B[added[pose]].reshape(-1, B.shape[2])
        information = information + flat.T @ flat
        gain = np.bincount(pose, gains(B, information), minlength=len(chosen))
        gain[taken] = 0.0
        best = np.argsort(-gain, kind="stable")[: min(poses - int(taken.sum()), -(-poses // 64))]
        best = best[gain[best] > 0.0]
        if not len(best):
            return np.flatnonzero(taken & ~chosen)
        added = np.zeros_like(taken)
        added[best] = taken[best] = True


def gains(B: Floats, information: Floats) -> Floats:
    """(N,) gain of information by each of N measurements, nats: log det(I + B M^-1 B').

    ``B``: (N, c, p) derivatives of their whitened numbers by the unknowns. ``information``: (p, p) M, that before, with the
    priors'.
    """
    half = B @ np.linalg.inv(np.linalg.cholesky(information)).T
    return np.asarray(np.linalg.slogdet(np.eye(B.shape[1]) + half @ np.swapaxes(half, 1, 2))[1])
