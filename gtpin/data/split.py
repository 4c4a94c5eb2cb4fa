"""Splitting a dataset into folds to be held out; visits to one pose always go together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gtpin.data.dataset import Dataset
from gtpin.data.ids import codes
from gtpin.errors import DatasetError
from gtpin.real import generator
from gtpin.typing import Floats, Mask


def by_session(dataset: Dataset) -> list[Mask]:
    """Give one (N,) mask of held-out rows for each session, in order of the session's id.

    A pose that was visited in several sessions is held out, with all its visits, in the session that has most of them (of
    equals, the first). Raises `DatasetError` where there is no column `session`, or where fewer than two sessions hold a pose.
    """
    if "session" not in dataset.covariates:
        hint = "add the column, or split otherwise"
        raise DatasetError("there are no sessions to split by", file=dataset.file, column="session", hint=hint)
    session, names = codes(dataset.covariates["session"])
    count = np.zeros((dataset.visits.max() + 1, len(names)), dtype=np.int64)
    np.add.at(count, (dataset.visits, session), 1)
    return _masks(dataset, np.argmax(count, axis=1), "sessions")


def by_region(dataset: Dataset, blocks: int) -> list[Mask]:
    """Give (N,) masks of held-out rows, one for each of ``blocks`` compact blocks of the measured positions.

    Blocks are made by repeated division across the longest side. Their numbers of poses differ by one at most.
    Raises `DatasetError` for fewer than 2 blocks or more than there are poses.
    """
    _check_number(dataset, blocks)
    visits = dataset.visits
    count = np.bincount(visits)
    centre = np.column_stack([np.bincount(visits, dataset.position[:, axis]) / count for axis in range(3)])
    fold = np.empty(len(count), dtype=np.int64)
    for index, block in enumerate(_cut(centre, np.arange(len(count)), blocks)):
        fold[block] = index
    return _masks(dataset, fold, "blocks")


def random(dataset: Dataset, folds: int, seed: int = 0) -> list[Mask]:
    """Give ``folds`` (N,) masks of held-out rows, drawn at random; their numbers of poses differ by one at most.

    The same seed and pose ids give the same folds, for any order of the rows. Raises `DatasetError` like `by_region`.
    """
    _check_number(dataset, folds)
    poses = dataset.visits.max() + 1
    return _masks(dataset, generator(seed).permutation(poses) % folds, "folds")


def _cut(centre: Floats, members: NDArray[np.intp], blocks: int) -> list[NDArray[np.intp]]:
    if blocks == 1:
        return [members]
    left = blocks // 2
    axis = np.argmax(np.ptp(centre[members], axis=0))
    members = members[np.argsort(centre[members, axis], kind="stable")]
    at = len(members) * left // blocks
    return _cut(centre, members[:at], left) + _cut(centre, members[at:], blocks - left)


def _check_number(dataset: Dataset, folds: int) -> None:
    poses = int(dataset.visits.max()) + 1
    if not 2 <= folds <= poses:
        hint = "take at least 2, and no more than there are poses"
        raise DatasetError(f"{poses} poses can't be split into {folds} folds", file=dataset.file, hint=hint)


def _masks(dataset: Dataset, fold: NDArray[np.intp], what: str) -> list[Mask]:
    """Turn the fold of each pose into masks of rows, leaving out folds without a pose."""
    row_fold = fold[dataset.visits]
    masks = [row_fold == index for index in np.unique(fold)]
    if len(masks) < 2:
        raise DatasetError(f"fewer than two {what} to split by", file=dataset.file, hint="split otherwise")
    return masks
