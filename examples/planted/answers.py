"""Let gtpin answer the cases of a folder: ``python answers.py CASES DIAGNOSES [--halves] [--match 'ur5*']``.

What is answered already stays. With --halves: one half of the poses of each case whose planted cause was named, drawn by pose.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from background import answer

import gtpin

SURE = 0.9
Name = tuple[str, str]


def half(dataset: gtpin.Dataset) -> gtpin.Dataset:
    """One half of the poses, drawn at random with all their visits."""
    first = np.random.default_rng(0).permutation(int(dataset.visits.max()) + 1) % 2 == 0
    return dataset.take(first[dataset.visits])


def name(item: dict[str, Any]) -> Name:
    return item["effect"], item["site"]


def classes(said: dict[str, Any]) -> set[Name]:
    """Every effect at its site that is in the class of a cause."""
    return {name(m) for cause in said["causes"] for m in cause["class"]}


def main() -> None:
    parser = argparse.ArgumentParser(description="Diagnose the cases of a folder.")
    parser.add_argument("cases", type=Path)
    parser.add_argument("diagnoses", type=Path)
    parser.add_argument("--halves", action="store_true")
    parser.add_argument("--match", default="*", help="names of the cases")
    given = parser.parse_args()
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    folders = [
        file.with_name(file.name.removesuffix(".truth.json")) for file in given.cases.glob(f"{given.match}.truth.json")
    ]
    for case in sorted(folders, key=lambda path: path.name[-3:]):
        started = time.process_time()
        place = given.diagnoses / case.name
        if not given.halves:
            try:
                answer(gtpin.Dataset.read(case), place)
            except gtpin.GtpinError as error:  # counts as nothing named
                print(f"{case.name}: {error}")
                place.parent.mkdir(parents=True, exist_ok=True)
                refused = {"verdict": "refused", "causes": [], "unexplained": {"descriptions": []}}
                place.with_name(f"{place.name}.json").write_text(json.dumps(refused) + "\n")
        elif (file := place.with_name(f"{case.name}.json")).exists():
            truth = json.loads(case.with_suffix(".truth.json").read_text())
            if name(truth["effects"][0]) in classes(json.loads(file.read_text())):
                answer(half(gtpin.Dataset.read(case)), place.with_name(f"{case.name}.half"))
        print(f"{case.name}: {time.process_time() - started:.1f} s of CPU", flush=True)


if __name__ == "__main__":
    main()
