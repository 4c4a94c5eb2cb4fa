"""Turn a file of Jacobi's datasets into a dataset: python tsinghua.py CSV -o DATASET [--robot NAME_OR_URDF].

The files are those of github.com/pauljac7700/serial_robots_datasets (P. Jacobi, Master's thesis, Tsinghua University 2025; MIT
licence), ``UR5/*.csv`` and ``WAM/*.csv``: a row for each pose with the target position ``x_t y_t z_t`` (mm, from the
controller's own kinematics), ``x_dif y_dif z_dif``, the "difference or residual error between the target position and the
actual achieved position" (mm), and the commanded ``joint_1 .. joint_n`` (degrees). The measured position is target plus
difference: these sums have no more than six decimals, as an instrument writes them, and target minus difference has more. (The
text of the repository does not give the sign. ``--minus`` takes the other one; docs/real_arms.md has what a fitted geometry
leaves of each.)
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

ROBOTS = {6: "ur5", 7: str(Path(__file__).resolve().parent / "wam.urdf")}
"""The robot of so many joints, where none is given."""
TARGET = [f"{axis}_t" for axis in "xyz"]
DIFFERENCE = [f"{axis}_dif" for axis in "xyz"]


def dataset_of(table: pd.DataFrame, robot: str | None = None, sign: float = 1.0) -> Dataset:
    """The dataset of a table, in metres and radians; no noise is declared, frame and target are free.

    Raises ValueError where a column is missing, or holds anything but numbers.
    """
    joints = [name for name in table if str(name).startswith("joint_")]
    needed = ["step_order", *TARGET, *DIFFERENCE, *(joints or ["joint_1"])]
    missing = [name for name in needed if name not in table]
    if missing:
        raise ValueError(f"column {missing[0]} is missing")
    if robot is None and len(joints) not in ROBOTS:
        raise ValueError(f"{len(joints)} joints: give the robot (--robot)")
    target, difference = table[TARGET].to_numpy(dtype=float), table[DIFFERENCE].to_numpy(dtype=float)
    return Dataset(
        robot=robot or ROBOTS[len(joints)],
        pose=np.array(table["step_order"].astype(str), dtype=object),
        q=np.radians(table[joints].to_numpy(dtype=float)),
        position=(target + sign * difference) / 1000.0,
        covariates={"step": table["step_order"].to_numpy(dtype=float)},
        instrument=InstrumentSection(frame="free", target="free"),
    )


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("csv", type=Path)
    parser.add_argument("-o", dest="dataset", type=Path, required=True, help="folder to be written")
    parser.add_argument("--robot", help="name or URDF; by default ur5 for six joints, wam.urdf for seven")
    parser.add_argument("--minus", action="store_true", help="measured = target - difference")
    given = parser.parse_args(arguments)
    try:
        dataset = dataset_of(pd.read_csv(given.csv), given.robot, -1.0 if given.minus else 1.0)
        dataset.write(given.dataset, force=True)
    except (OSError, ValueError, gtpin.GtpinError) as error:
        sys.exit(f"{given.csv}: {' '.join(str(error).split())}")


if __name__ == "__main__":
    main(sys.argv[1:])
