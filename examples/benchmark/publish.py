"""Publishes a set: makes its cases, and writes their digests and D.

    python examples/benchmark/publish.py FOLDER

A set is published once. If the plant changes so that its numbers change, a new set with other seeds is published, and the
tables of the old one stay with the version of gtpin that made them.
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import numpy as np

import gtpin
from gtpin.bench.benchmark.public_set import CASES, FILE, SCHEMA, Block, MadeCase, PublicSet, make, rounded_energy
from gtpin.bench.blind.judged import difficulty_of, gradable
from gtpin.bench.simulator.recipe import digest
from gtpin.calibration.calibrate import calibrate
from gtpin.data import Dataset

SEED = 1795458999
"""Seconds of the clock when the set was drawn."""
BLOCKS = (
    Block(name="tau-tracker", robot="gantry_tau", cases=30, seed=SEED),
    Block(name="tau-range", robot="gantry_tau", instrument="range", cases=20, seed=SEED + 1),
    Block(name="ur5-tracker", robot="ur5", cases=20, seed=SEED + 2),
    Block(name="ur5-plane", robot="ur5", instrument="plane", cases=10, seed=SEED + 3),
    Block(name="fivebar-tracker", robot="five_bar.urdf", cases=20, seed=SEED + 4),
)


def leaves(case: MadeCase, folder: Path) -> float | None:
    """D of a single effect of the catalogue, to four digits; None for other cases, and where the data can't be calibrated."""
    dataset = Dataset.read(folder / CASES / case.name)
    if len(case.truth.effects) != 1 or not gradable(dataset, case.truth):
        return None
    effect = case.truth.effects[0]
    try:
        left = difficulty_of(dataset, case.truth, calibrate(dataset)).left(np.array(effect.displacement))
    except gtpin.GtpinError:
        return None
    return rounded_energy(max(min(best.left for name, best in left.items() if name != effect.name), 0.0))


def main(folder: Path) -> None:
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    draft = PublicSet(schema=SCHEMA, plant=digest(), blocks=BLOCKS, cases={})
    cases = {}
    for one in draft.drafts().values():
        case = make(one, folder)
        cases[case.name] = case.digests.model_copy(update={"leaves": leaves(case, folder)})
        print(case.name, cases[case.name].leaves, flush=True)
    done = draft.model_copy(update={"cases": cases})
    FILE.write_text(json.dumps(done.model_dump(by_alias=True, exclude_none=True), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("give a folder for the cases: python publish.py FOLDER")
    main(Path(sys.argv[1]))
