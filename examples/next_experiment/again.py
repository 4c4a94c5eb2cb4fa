"""Measures a machine of the plant again, and adds the rows to its dataset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.bench.simulator import Case, measure_at
from gtpin.data import Commands, Dataset
from gtpin.data.table import Column
from gtpin.diagnosis.trials import INTERVAL, LATER, NIGHT

Floats = npt.NDArray[np.float64]


def again(case: Case, q: Floats, covariates: Mapping[str, Column], seed: int) -> Dataset:
    """The case's dataset with further rows, those on a cold machine after a night.

    Covariates that the dataset lacks are added to it: one session ``0`` for all its rows, and zero of everything else.
    """
    cold = np.zeros(len(q), dtype=bool)
    for name in [n for n in covariates if n.startswith("temp_")]:
        cold |= np.asarray(covariates[name], dtype=float) == case.dataset.conditions.reference_temperature
    session = covariates.get("session", np.zeros(len(q)))
    order = np.lexsort([cold, np.unique(np.asarray(session).astype(str), return_inverse=True)[1]])
    first = float(np.asarray(case.dataset.covariates["time"], dtype=float).max()) + LATER
    told = {name: values[order] for name, values in covariates.items()}
    nights = np.cumsum(np.diff(cold[order].astype(int), prepend=0) != 0)
    told.setdefault("time", first + INTERVAL * np.arange(len(q)) + NIGHT * nights)
    pose = np.array([f"later{i}" for i in range(len(q))], dtype=object)
    return together(case.dataset, measure_at(case, Commands(pose, q[order], told), seed))


def together(old: Dataset, later: Dataset) -> Dataset:
    """Both datasets in one."""
    assert old.orientation is not None
    assert later.orientation is not None
    absent = {n: np.full(len(old), "0" if n == "session" else 0.0) for n in later.covariates if n not in old.covariates}
    both = {n: np.concatenate([v, later.covariates[n]]) for n, v in {**old.covariates, **absent}.items()}
    return replace(
        old,
        pose=np.concatenate([old.pose, later.pose]),
        q=np.vstack([old.q, later.q]),
        position=np.vstack([old.position, later.position]),
        orientation=np.vstack([old.orientation, later.orientation]),
        covariates=both,
        row=np.arange(2, 2 + len(old) + len(later)),
    )
