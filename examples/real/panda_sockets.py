"""Turn a set of MUKCa's measurements into a dataset of sockets: python panda_sockets.py FOLDER -o DATASET.

The files are those of github.com/platonics-delft/kinematics_calibration (MIT licence), ``data/panda_3`` for example. A ball
at the flange of a Franka Panda sat in one of two sockets of a printed tool, which was put to several places.
``PLACE/hole_0.csv`` and ``hole_1.csv`` have seven joint angles a row (rad), without a header. ``hole_0_pose.csv`` has what
the controller took for the TCP's pose (x y z qx qy qz qw); it is no measurement, and is left out. A folder with one table
``ball.csv`` (``pose, q1 .. q7, socket``) is read as well.

The README of these data says that the sockets are 50 mm apart, and that a caliper on the printed tool is off by less than
0.1 mm. The ball is about 31 mm beyond the hand's TCP, which is 103.4 mm from the flange (``ball_joint`` in the authors'
panda.urdf); how the printed holder sits on the flange is known to some millimetres.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

import gtpin
from gtpin.extras.importers.touches import write_instrument

JOINTS = [f"panda_joint{number}" for number in range(1, 8)]
COMMANDS = [f"q{number}" for number in range(1, 8)]
TCP = "panda_link8"
TARGET = [0.0, 0.0, 0.135]
"""The ball in the flange's frame, m."""
TARGET_SIGMA = 0.01
LENGTH, LENGTH_SIGMA = 0.05, 1e-4
"""Distance of a tool's two sockets, m, and how well it is known."""
HOLES = ("hole_0", "hole_1")


def table_of(folder: Path) -> pd.DataFrame:
    """The rows of a folder, in either layout: pose, q1 .. q7 and socket (PLACE/hole_0, PLACE/hole_1).

    Raises ValueError where there are none, or one is damaged.
    """
    if (folder / "ball.csv").is_file():
        table = pd.read_csv(folder / "ball.csv")
        missing = [name for name in ["pose", *COMMANDS, "socket"] if name not in table]
        if missing:
            raise ValueError(f"ball.csv: column {missing[0]} is missing")
        table = table[table["socket"].astype(str).str.split("/").str[-1].isin(HOLES)]
    else:
        parts = []
        for file in sorted(file for hole in HOLES for file in folder.glob(f"*/{hole}.csv")):
            rows = pd.read_csv(file, header=None)
            if rows.shape[1] != len(COMMANDS):
                raise ValueError(f"{file.relative_to(folder)}: {rows.shape[1]} columns where seven joint angles belong")
            rows.columns = pd.Index(COMMANDS)
            parts.append(rows.assign(socket=f"{file.parent.name}/{file.stem}"))
        table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*COMMANDS, "socket"])
        table.insert(0, "pose", np.arange(len(table)))
    if table.empty:
        raise ValueError("neither ball.csv nor PLACE/hole_0.csv has a row of a socket")
    if not np.isfinite(table[COMMANDS].to_numpy(dtype=float)).all():
        raise ValueError("a joint angle is no finite number")
    return table.reset_index(drop=True)


def instrument_of(table: pd.DataFrame) -> dict[str, object]:
    """The instrument: the ball in the sockets, two of each place 50 mm apart."""
    visited = set(table["socket"])
    places = sorted({name.rpartition("/")[0] for name in visited})
    pairs = [[f"{place}/{hole}" for hole in HOLES] for place in places]
    return {
        "name": "ball",
        "kind": "socket",
        "target": TARGET,
        "target_sigma": TARGET_SIGMA,
        "distances": [[*pair, LENGTH, LENGTH_SIGMA] for pair in pairs if visited.issuperset(pair)],
    }


def write(folder: Path, dataset: Path) -> int:
    """Write the dataset of a folder, and give the number of its rows."""
    table = table_of(folder)
    columns = {"pose": table["pose"].astype(str).to_numpy(dtype=object)}
    columns |= {name: table[name].to_numpy(dtype=float) for name in COMMANDS}
    columns |= {"socket": table["socket"].to_numpy(dtype=object)}
    write_instrument(dataset, "panda", instrument_of(table), columns, tcp=TCP, actuators=JOINTS, force=True)
    return len(table)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="a robot's set: data/panda_3")
    parser.add_argument("-o", dest="dataset", type=Path, required=True, help="folder to be written")
    given = parser.parse_args(arguments)
    try:
        rows = write(given.folder, given.dataset)
    except (OSError, ValueError, gtpin.GtpinError) as error:
        sys.exit(f"{given.folder}: {' '.join(str(error).split())}")
    print(f"{rows} rows. Written: {given.dataset}")


if __name__ == "__main__":
    main(sys.argv[1:])
