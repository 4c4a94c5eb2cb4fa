"""Outliers that are no gross errors: they stand together over a command, a direction of approach or a load."""

from __future__ import annotations

import numpy as np
from scipy.special import bdtrc

from gtpin.data import Dataset
from gtpin.data.instrument_tables import SocketTable
from gtpin.diagnosis.linear.observed import Observed
from gtpin.diagnosis.preparation.prepare import Prepared
from gtpin.diagnosis.priors import Priors
from gtpin.effects.sites import joints
from gtpin.effects.situation import Situation
from gtpin.effects.smooth import own_load
from gtpin.errors import warn
from gtpin.typing import Floats, Mask


def readmit_outliers(prepared: Prepared, priors: Priors) -> Mask:
    """(N,) the rows that a search uses: those of the calibration, and its outliers that stand together."""
    dataset, baseline = prepared.dataset, prepared.baseline
    used = baseline.used(dataset)
    rows = np.flatnonzero(baseline.model.kinematics.forward(dataset.q).reached & ~_in_sockets(dataset))
    if (~used[rows]).any():
        at = Observed.of(dataset.take(rows), baseline).situation(baseline.model)
        together = rows[stand_together(at, ~used[rows], priors)]
        used[together] = True
        if len(together):
            named = ", ".join(dict.fromkeys(str(pose) for pose in dataset.pose[together]))
            warn(
                f"no gross errors, since they stand together over a command or a load: the diagnosis uses poses {named}"
            )
    return used


def stand_together(at: Situation, outliers: Mask, priors: Priors) -> Mask:
    """(N,) the outliers that stand together over a coordinate of the machine.

    Gross errors happen anywhere. Where at least half of the commands in an interval of one coordinate are outliers, something
    acts there: a pit of a track, play that a load takes up, a step near a track's end. For each interval that begins and ends
    at an outlier, the chance is that of so many outliers among its commands (binomial distribution, which bounds the
    hypergeometric one), times the number of such intervals of all coordinates (Bonferroni).

    ``outliers``: (N,) rows. Visits of one command count as one: what is wrong there can be wrong at each visit.
    """
    command = np.unique(at.q, axis=0, return_inverse=True)[1].ravel()
    bad = np.bincount(command, outliers) > 0
    count = int(bad.sum())
    together = np.zeros(len(bad), dtype=bool)
    if count < priors.readmitted:
        return together[command]
    # One row of each command: of those with outliers, an outlier, because directions of approach may differ.
    order = np.lexsort((~outliers, command))
    rows = order[np.flatnonzero(np.diff(command[order], prepend=-1))]
    coordinates = _coordinates(at)[rows]
    tries = coordinates.shape[1] * count * (count - 1) / 2.0
    for values in coordinates.T:
        ordered = np.argsort(values, kind="stable")
        before = np.concatenate([[0], np.cumsum(bad[ordered])])
        ends = np.unique(values[bad])
        low, high = (np.searchsorted(values[ordered], ends, side) for side in ("left", "right"))
        inside, hits = high[None] - low[:, None], before[high][None] - before[low][:, None]
        dense = (hits >= priors.readmitted) & (2 * hits >= inside)
        chance = bdtrc(np.maximum(hits - 1, 0), np.maximum(inside, 1), count / len(bad)) * tries
        for i, j in np.argwhere(dense & (chance < priors.together)):
            together |= bad & (values >= ends[i]) & (values <= ends[j])
    return outliers & together[command]


def _coordinates(at: Situation) -> Floats:
    """(N, m) commands, directions of approach, payload, and the loads of rods or joints."""
    names = [*(f"approach{k + 1}" for k in range(at.robot.n_actuators)), "payload"]
    columns = [at.q, *(at.covariate(name)[:, None] for name in names if at.varies(name))]
    columns += [at.force] if at.robot.rods else [own_load(at, site)[0][:, None] for site in joints(at.robot)]
    return np.hstack(columns)


def _in_sockets(dataset: Dataset) -> Mask:
    """(N,) rows of a ball in a socket: its visits have nearly the same command, so that its gross errors stand together."""
    sockets = [i for i, table in enumerate(dataset.readings.tables) if isinstance(table, SocketTable)]
    return np.isin(dataset.readings.of, sockets)
