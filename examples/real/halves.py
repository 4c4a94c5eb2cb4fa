"""Check one half of measured poses against a model of the other: python halves.py DATASET ... [--poses N] [--positions].

Nothing changed between the halves of one session, so that every change that a check names is a false alarm. The poses are
divided at random, with all visits of a pose in one half; the second half is checked as a whole and in parts of ten poses.
Datasets and parts that are missing or refused are left out. ``--positions`` leaves orientations out and identifies where
the target is.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

import gtpin

PARTS, POSES = 5, 10
"""Number of parts of the second half that are checked by themselves, and the poses of each."""


def halves(dataset: gtpin.Dataset, seed: int = 0) -> list[tuple[int, str, list[str]]]:
    """Of each check: the number of its rows, its verdict, and the changes that it names."""
    first = np.random.default_rng(seed).permutation(int(dataset.visits.max()) + 1) % 2 == 0
    known, other = dataset.take(first[dataset.visits]), dataset.take(~first[dataset.visits])
    model, found = gtpin.calibrate(known).model, []
    visits = other.visits
    order = np.random.default_rng(seed + 1).permutation(int(visits.max()) + 1)
    parts = [np.isin(visits, order[i * POSES : (i + 1) * POSES]) for i in range(min(PARTS, len(order) // POSES))]
    for rows in [np.ones(len(other), dtype=bool), *parts]:
        try:
            check = gtpin.diagnose(other.take(rows), against=model)
            told = check.verdict, [f"{c.effect}@{c.site}" for c in check.causes]
        except gtpin.GtpinError as error:  # ten readings without a declared sigma, for example
            told = f"left out: {' '.join(str(error).split())}", []
        found.append((int(rows.sum()), *told))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("datasets", nargs="+", type=Path)
    parser.add_argument("--poses", type=int, default=1000, help="take only so many rows, drawn at random")
    parser.add_argument("--positions", action="store_true", help="positions alone, with a free target")
    given = parser.parse_args()
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    for folder in given.datasets:
        try:
            dataset = gtpin.Dataset.read(folder)
            if len(dataset) > given.poses:
                dataset = dataset.take(np.sort(np.random.default_rng(0).permutation(len(dataset))[: given.poses]))
            if given.positions:
                free = dataset.instrument.model_copy(update={"target": "free"})
                dataset = replace(dataset, orientation=None, instrument=free)
            for rows, verdict, changes in halves(dataset):
                print(f"{folder}: {rows} rows: {verdict} {' '.join(changes)}", flush=True)
        except gtpin.GtpinError as error:
            print(f"{folder}: left out: {' '.join(str(error).split())}", flush=True)


if __name__ == "__main__":
    main()
