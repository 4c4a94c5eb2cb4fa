"""gtpin's calibration beside plain least squares, on left-out poses: python beside_plain.py DATASET ... [--names NAME ...].

Both are fitted to the same parts of a dataset and predict the same left-out poses, drawn at random: once with positions and
orientations, where both were measured, and once with positions alone. The target on the flange is identified by both.
``--names`` keeps the figures in docs/figures/real_plain.json, from which ``python examples/pages/refresh.py`` makes the table
of docs/real_arms.md.
"""

from __future__ import annotations

import argparse
import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from plain import Plain

import gtpin
from gtpin.data import random
from gtpin.model.measured_robot import robot_of

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "real_plain.json"


def errors(dataset: gtpin.Dataset, folds: int) -> dict[str, float]:
    """Root mean square position errors, mm, of poses that were left out in turn: by both fits."""
    robot, found = robot_of(dataset), {"plain": [], "gtpin": []}
    for held in random(dataset, folds):
        known, other = dataset.take(~held), dataset.take(held)
        predicted = {
            "plain": Plain(known, robot).predict(other.q)[0],
            "gtpin": gtpin.calibrate(known).model.predict(other.q).T,
        }
        for name, T in predicted.items():
            found[name].append(other.position - T)
    return {name: 1e3 * float(np.sqrt((np.concatenate(e) ** 2).sum(axis=1).mean())) for name, e in found.items()}


def rows(folder: Path, poses: int, folds: int) -> dict[str, object]:
    """Of a dataset, or so many poses of it drawn at random: the errors with orientations and without."""
    dataset = gtpin.Dataset.read(folder)
    if poses < len(dataset):
        dataset = dataset.take(np.sort(np.random.default_rng(0).permutation(len(dataset))[:poses]))
    free = dataset.instrument.model_copy(update={"frame": "free", "target": "free"})
    dataset = replace(dataset, instrument=free)
    found: dict[str, object] = {"robot": Path(dataset.robot).stem, "poses": len(dataset), "folds": folds}
    if dataset.orientation is not None:
        found["poses_measured"] = errors(dataset, folds)
    return {**found, "positions": errors(replace(dataset, orientation=None), folds)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("datasets", nargs="+", type=Path)
    parser.add_argument("--names", nargs="+", default=[], help="keep the figures under these names")
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--folds", type=int, default=4)
    given = parser.parse_args()
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    for place, folder in enumerate(given.datasets):
        found = rows(folder, given.poses, given.folds)
        print(folder, json.dumps(found), flush=True)
        if given.names:
            kept = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
            text = json.dumps({**kept, given.names[place]: found}, indent=1, sort_keys=True)
            RECORD.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
