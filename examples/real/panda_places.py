"""Validate the calibration of a Panda by a ball in sockets on places that it has not seen.

    python panda_places.py DATASET -o panda.json

DATASET is what ``panda_sockets.py`` wrote. Each place of the tool is left out in turn. The geometry is calibrated on the
others. Then only the two sockets of the place, which nobody can know, are fitted to it: what is left is the scatter of the
ball about its socket, and how far the sockets' distance is from its known length.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import gtpin
from gtpin.data.instrument_tables import SocketTable
from gtpin.model.measured_robot import robot_of
from gtpin.model.model import Model

TARGET = "ball.target."


def places(dataset: gtpin.Dataset) -> dict[str, np.ndarray]:
    """Rows of each place: the first part of the sockets' ids."""
    ids = np.array([str(name).split("/")[0] for name in dataset.readings.columns["socket"]])
    return {str(name): ids == name for name in dict.fromkeys(ids)}


def part(dataset: gtpin.Dataset, rows: np.ndarray) -> gtpin.Dataset:
    """Some rows, with the known distances between their sockets."""
    some = dataset.take(rows)
    table = some.readings.tables[0]
    assert isinstance(table, SocketTable)
    left = {str(name) for name in some.readings.columns["socket"]}
    kept = table.model_copy(update={"distances": tuple(d for d in table.distances if set(d[:2]) <= left)})
    known = ({**some.readings.known[0], "socket": tuple(sorted(left))},)
    return replace(some, readings=replace(some.readings, tables=(kept,), known=known))


def scatter(model: Model, target: np.ndarray, dataset: gtpin.Dataset, length: float) -> tuple[float, float]:
    """RMS distance, m, of the ball from its socket, and the error of the sockets' distance, m."""
    poses = model.kinematics.forward(dataset.q)
    at = poses.T + poses.R @ target
    ids = dataset.readings.columns["socket"].astype(str)
    centres = {name: at[ids == name].mean(axis=0) for name in dict.fromkeys(ids)}
    off = at - np.array([centres[name] for name in ids])
    two = list(centres.values())
    apart = float(np.linalg.norm(two[0] - two[1])) - length if len(two) == 2 else float("nan")
    return float(np.sqrt((off**2).sum(axis=1).mean())), apart


def validated(dataset: gtpin.Dataset) -> dict[str, object]:
    """What is left of each place, nominal and calibrated on the others."""
    table = dataset.readings.tables[0]
    length, declared = table.distances[0][2], np.array(table.target)
    nominal = Model(gtpin.Geometry.nominal(robot_of(dataset)))
    rows = []
    for name, own in places(dataset).items():
        found = gtpin.calibrate(part(dataset, ~own))
        target = np.array([found.unknown(TARGET + axis).value for axis in "xyz"])
        kept = part(dataset, own)
        before, after = scatter(nominal, declared, kept, length), scatter(found.model, target, kept, length)
        rows.append(
            {
                "place": name,
                "rows": int(own.sum()),
                "scatter_nominal": before[0],
                "scatter": after[0],
                "distance_error_nominal": before[1],
                "distance_error": after[1],
            }
        )
    weight = np.array([row["rows"] for row in rows], dtype=float)

    def rms(key: str) -> float:
        return float(np.sqrt(np.average([row[key] ** 2 for row in rows], weights=weight)))

    return {"places": rows, "scatter_nominal": rms("scatter_nominal"), "scatter": rms("scatter")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    chosen = parser.parse_args()
    found = validated(gtpin.Dataset.read(chosen.dataset))
    chosen.output.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
