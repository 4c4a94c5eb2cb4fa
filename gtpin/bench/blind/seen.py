"""Changes of the measured numbers (poses, or readings of instruments) by motions of the platform, in units of the noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.instruments.readings import Readings, single
from gtpin.typing import Floats, Indices


@dataclass(frozen=True, eq=False)
class Seen:
    """The measurement of c numbers at each of N poses."""

    by_motion: (
        Floats  # (N, c, 6) or (c, 6) their derivative by the platform's motion, base frame, in units of the noise
    )
    # (N, c, k) the same by the instruments' unknowns in prior sigmas; None where there are none
    unknowns: Floats | None = None

    @staticmethod
    def of_poses(sigma: Floats) -> Seen:
        """Poses that a tracker measures with the noise (6,) or (N, 6), m and rad; infinite for what is not measured."""
        return Seen(np.eye(6) / sigma[..., None])

    @staticmethod
    def of_readings(
        dataset: Dataset, baseline: Calibration, noise: Mapping[str, Floats]
    ) -> tuple[Dataset, Indices, Seen]:
        """The readings of a dataset of schema 2, at its calibration.

        ``noise``: by instrument's name, the noise (M, c) of the numbers in its table, m or rad. Known distances of sockets are
        left out: they do not depend on the pose, and are not in E.

        Returns the rows, each with one number where the instruments' readings have different lengths; the (N,) index of each
        row in the dataset as it was read; and how they see motions.
        """
        split = single(dataset, baseline.model.robot)
        row, sigmas = noise_of_rows(dataset, split, noise)
        kept = np.flatnonzero([len(own) > 0 for own in sigmas])
        rows, sigma = split.take(kept), np.stack([sigmas[i] for i in kept])[..., None]
        readings = Readings.of(rows, baseline.model.robot, baseline.u)
        poses = baseline.model.kinematics.forward(rows.q)
        unknowns, _ = readings.unknown_columns(baseline.model, poses, False, None)
        return rows, row[kept], Seen(readings.by_motion(poses) / sigma, unknowns / sigma)

    def whitened(self, motions: Floats) -> Floats:
        """(N, c, m) change of the numbers in units of their noise, by motions (N, 6, m) of the platform, m and rad."""
        return np.asarray(self.by_motion @ motions)


def noise_of_rows(dataset: Dataset, split: Dataset, noise: Mapping[str, Floats]) -> tuple[Indices, list[Floats]]:
    """For each of the N rows of a dataset ``split`` by :func:`~gtpin.instruments.readings.single`: the index of the row of
    ``dataset`` of which it is a part, and the noise of its numbers, m or rad.

    ``noise`` as in :meth:`Seen.of_readings`. A known distance of sockets, which is in no table, has none.
    """
    whole, rows = dataset.readings, split.readings
    assert whole is not None
    assert rows is not None
    row, sigma = np.empty(len(split), dtype=np.intp), [np.zeros(0)] * len(split)
    for index, table in enumerate(rows.tables):
        own, mine = whole.rows_of(index), rows.rows_of(index)
        place = np.searchsorted(whole.line[own], rows.line[mine])
        row[mine] = own[place]
        for i, at, which in zip(mine, place, rows.component[mine], strict=True):
            sigma[i] = noise[table.name][at] if which < 0 else noise[table.name][at, which : which + 1]
    return row, sigma
