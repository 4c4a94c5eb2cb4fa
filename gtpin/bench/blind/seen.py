"""Changes of the measured numbers (poses, or readings of instruments) by motions of the platform, in units of the noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gtpin.calibration.readings_result import ReadingsCalibration
from gtpin.data import Dataset
from gtpin.instruments.readings import Readings, single
from gtpin.typing import Floats, Indices


class Seen(Protocol):
    """The measurement of c numbers at each of N poses."""

    def whitened(self, motions: Floats) -> Floats:
        """(N, c, m) change of the numbers in units of their noise, by motions (N, 6, m) of the platform, m and rad, base
        frame."""

    @property
    def unknowns(self) -> Floats | None:
        """(N, c, k) derivative by the instruments' unknowns in prior sigmas, in units of the noise; None where there are
        none."""


@dataclass(frozen=True, eq=False)
class SeenPoses:
    """Poses that a tracker measures.

    Parameters
    ----------
    sigma
        (6,) or (N, 6) the noise, m and rad; infinite for components that are not measured.
    """

    sigma: Floats

    def whitened(self, motions: Floats) -> Floats:
        """See :class:`Seen`."""
        return np.asarray(motions / self.sigma[..., None])

    @property
    def unknowns(self) -> Floats | None:
        """See :class:`Seen`."""
        return None


@dataclass(frozen=True, eq=False)
class SeenReadings:
    """Numbers that any instruments read.

    Parameters
    ----------
    by_motion
        (N, c, 6) derivative of the numbers by the platform's motion, in units of the noise.
    unknowns
        As in :class:`Seen`.
    """

    by_motion: Floats
    unknowns: Floats | None

    def whitened(self, motions: Floats) -> Floats:
        """See :class:`Seen`."""
        return np.asarray(self.by_motion @ motions)


@dataclass(frozen=True, eq=False)
class NumberedRows:
    """The readings of a dataset, each of their numbers with its noise.

    Known distances of sockets are left out: they do not depend on the pose, and are not in E.

    Parameters
    ----------
    dataset
        The rows. Each row has one number where the instruments' readings have different lengths.
    row
        (N,) index of each row in the dataset as it was read.
    sigma
        (N, c) noise, m or rad.
    """

    dataset: Dataset
    row: Indices
    sigma: Floats

    @staticmethod
    def of(dataset: Dataset, baseline: ReadingsCalibration, noise: Mapping[str, Floats]) -> NumberedRows:
        """The rows of a dataset of schema 2. ``noise``: by instrument's name, the noise (M, c) of the numbers in its table."""
        split = single(dataset, baseline.model.robot)
        row, sigma = noise_of_rows(dataset, split, noise)
        kept = np.flatnonzero([len(own) > 0 for own in sigma])
        return NumberedRows(split.take(kept), row[kept], np.stack([sigma[i] for i in kept]))

    def seen(self, baseline: ReadingsCalibration) -> SeenReadings:
        """The derivatives of the readings, at a calibration."""
        readings = Readings.of(self.dataset, baseline.model.robot, baseline.u)
        poses = baseline.model.kinematics.forward(self.dataset.q)
        unknowns, _ = readings.unknown_columns(baseline.model, poses, False, None)
        sigma = self.sigma[..., None]
        return SeenReadings(readings.by_motion(poses) / sigma, unknowns / sigma)


def noise_of_rows(dataset: Dataset, split: Dataset, noise: Mapping[str, Floats]) -> tuple[Indices, list[Floats]]:
    """For each of the N rows of a dataset that was split by :func:`~gtpin.instruments.readings.single`, its row before and its
    noise.

    Parameters
    ----------
    dataset, split
        The dataset as it was read, and split.
    noise
        By the instruments' names, (M, c) noise of the numbers in the rows of their tables, m or rad.

    Returns
    -------
    row
        (N,) index of the row of ``dataset`` of which each row is a part.
    sigma
        The noise of each row's numbers, m or rad; empty for a known distance of sockets, which is in no table.
    """
    whole, rows = dataset.readings, split.readings
    assert whole is not None
    assert rows is not None
    row = np.empty(len(split), dtype=np.intp)
    sigma = [np.zeros(0)] * len(split)
    for index, table in enumerate(rows.tables):
        own, mine = whole.rows_of(index), rows.rows_of(index)
        place = np.searchsorted(whole.line[own], rows.line[mine])
        row[mine] = own[place]
        for i, at, which in zip(mine, place, rows.component[mine], strict=True):
            sigma[i] = noise[table.name][at] if which < 0 else noise[table.name][at, which : which + 1]
    return row, sigma
