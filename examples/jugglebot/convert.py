"""Turn a log of Jugglebot's poses into a dataset: python convert.py LOG.csv DATASET [--free].

The log is a CSV as Jugglebot's repository has it (experimenting/platform_calibration/zOld/108_calibration_poses.csv): a row for
each pose with ``leg_length_1 .. leg_length_6`` (positions of the legs' motors, revolutions), ``position_x``, ``position_y``,
``position_z`` (the platform's position by motion capture, mm) and ``orientation_x .. orientation_w`` (its orientation, a
quaternion). Any other column of numbers (payload, temperatures, direction of approach), and ``pose`` and ``session``, are
copied as they are. ``--free``: motion capture was not aligned with the base.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

import gtpin
from gtpin import Dataset
from gtpin.data import InstrumentSection

METRES_PER_REVOLUTION = 1.0 / np.array([13.21144, 14.0456, 13.8233, 14.124109, 14.16007, 14.03256])
"""Cord paid out by each leg's spool for one turn of its motor, m, from Jugglebot's own revolutions per metre.

"Manually measured" in zOld/optimize_robot_geometry.py, "found experimentally" in ros_ws/src/jugglebot/jugglebot/sp_ik.py since
commit 7cb4322 of 2025-02-13. Commit 4348767 of 2025-04-11 replaced them there by 14.18332, 14.19076, 14.08956, 14.18684,
14.26801 and 14.24951 revolutions a metre, up to 7 % more.
"""
MOTORS = [f"leg_length_{i}" for i in range(1, 7)]
POSITION = [f"position_{axis}" for axis in "xyz"]
ORIENTATION = [f"orientation_{axis}" for axis in "wxyz"]


def dataset_of(log: pd.DataFrame, free: bool = False) -> Dataset:
    """The dataset of a log: commands and positions in metres; no noise is declared, since nobody knows it.

    Raises ValueError where a column is missing, or holds anything but numbers.
    """
    needed = [*MOTORS, *POSITION, *ORIENTATION]
    missing = [name for name in needed if name not in log]
    if missing:
        raise ValueError(
            f"column {missing[0]} is missing; expected {', '.join(needed)} as in 108_calibration_poses.csv"
        )
    covariates = {
        str(name): np.array(values.astype(str), dtype=object) if name == "session" else values.to_numpy(dtype=float)
        for name, values in log.items()
        if name not in (*needed, "pose")
    }
    return Dataset(
        robot="stewart_jugglebot",
        pose=np.array(log.get("pose", pd.Series(range(len(log)))).astype(str), dtype=object),
        q=log[MOTORS].to_numpy(dtype=float) * METRES_PER_REVOLUTION,
        position=log[POSITION].to_numpy(dtype=float) / 1000.0,
        orientation=log[ORIENTATION].to_numpy(dtype=float),
        covariates=covariates,
        instrument=InstrumentSection(frame="free" if free else "robot"),
    )


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description="turn a log of Jugglebot's poses into a dataset")
    parser.add_argument("log", type=Path)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--free", action="store_true", help="motion capture was not aligned with the base")
    told = parser.parse_args(arguments)
    try:
        dataset_of(pd.read_csv(told.log, dtype={"pose": str, "session": str}), told.free).write(told.dataset)
    except (OSError, ValueError, gtpin.GtpinError) as error:
        sys.exit(f"{told.log}: {' '.join(str(error).split())}")


if __name__ == "__main__":
    main(sys.argv[1:])
