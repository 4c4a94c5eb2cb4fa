"""Turn a log of Jugglebot's poses into a dataset: python convert.py LOG.csv DATASET [--free].

The log has a row for each pose: ``rev1 .. rev6`` (revolutions of the legs' motors), ``x_mm y_mm z_mm`` (the platform's position
by motion capture, mm), ``qw qx qy qz`` (its orientation) and, where there are several days, ``session``. Everything else that a
dataset may know (payload, temperatures, direction of approach) is copied as it is. ``--free``: motion capture was not aligned
with the base.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from gtpin import Dataset
from gtpin.data import Instrument

METRES_PER_REVOLUTION = np.array([0.0756920, 0.0711967, 0.0723416, 0.0708009, 0.0706211, 0.0712628])
"""Cord paid out by each leg's spool for one turn of its motor, as measured on a rig."""
POSITION, ORIENTATION = ["x_mm", "y_mm", "z_mm"], ["qw", "qx", "qy", "qz"]
REVOLUTIONS = [f"rev{i}" for i in range(1, 7)]


def dataset_of(log: pd.DataFrame, free: bool = False) -> Dataset:
    """The dataset of a log: commands and positions in metres; nothing is said of the noise, which nobody declared."""
    known = {*REVOLUTIONS, *POSITION, *ORIENTATION, "pose"}
    return Dataset(
        robot="stewart_jugglebot",
        pose=np.array(log.get("pose", pd.Series(range(len(log)))).astype(str), dtype=object),
        q=log[REVOLUTIONS].to_numpy(dtype=float) * METRES_PER_REVOLUTION,
        position=log[POSITION].to_numpy(dtype=float) / 1000.0,
        orientation=log[ORIENTATION].to_numpy(dtype=float),
        covariates={
            str(name): np.array(values.astype(str), dtype=object) if name == "session" else values.to_numpy(dtype=float)
            for name, values in log.items()
            if name not in known
        },
        instrument=Instrument(frame="free" if free else "robot"),
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="turn a log of Jugglebot's poses into a dataset")
    parser.add_argument("log", type=Path)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--free", action="store_true", help="motion capture was not aligned with the base")
    told = parser.parse_args()
    dataset_of(pd.read_csv(told.log, dtype={"pose": str, "session": str}), told.free).write(told.dataset)
