"""How often good data are accused of a mistake: a table of docs/dataset.md.

Machines are drawn by the plant and calibrated. Their data have no mistake, but everything else that makes residuals: effects of
the catalogue up to an energy of 5,000, effects outside the catalogue, heavy tails, gross errors, rounding, an instrument that
stands elsewhere with a target anywhere on the platform. Each ends in one of

- accepted: calibrated; no warning names a mistake;
- warned: calibrated, with a warning that names a mistake which the data do not have;
- refused: an error.

    python examples/mistakes/innocent.py [--machines 3] [-o innocent.csv]
"""

from __future__ import annotations

import argparse
import re
import tempfile
import warnings
import zlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

import gtpin
from gtpin.bench.simulator.build import build
from gtpin.bench.simulator.case import drawn_recipe
from gtpin.bench.simulator.instruments.build import build_measured
from gtpin.bench.simulator.recipe import SimulatedNoise

ANSWERS = ("accepted", "warned", "refused")
FIRST = 8_100_000
"""From here on nothing else draws its machines."""
POSES = 100
FIVE_BAR = str(Path(__file__).parents[1] / "loops" / "five_bar.urdf")
ROBOTS = {name: name for name in ("gantry_tau", "stewart", "linear_delta", "ur5", "panda")} | {"five_bar": FIVE_BAR}
RODS = ("gantry_tau", "stewart", "linear_delta")
INSTRUMENTS = {
    "range": ("gantry_tau", "ur5"),
    "plane": ("linear_delta", "ur5"),
    "socket": ("stewart", "ur5"),
    "tilt": ("stewart", "ur5"),
    "camera": ("gantry_tau", "ur5"),
    "encoder": ("five_bar",),
}
ACCUSES = re.compile(
    r"looks? (like|revers|swap|shift|invert|to |turned)|do not fit the others|bumped|moved between|one row off",
    re.IGNORECASE,
)
SORTS: Mapping[str, tuple[dict[str, Any], float, dict[str, Any]]] = {
    "no effect": ({"n_effects": 0}, 1.0, {}),
    "two effects, energy 5,000": ({"n_effects": 2}, 5000.0, {}),
    "effect outside the catalogue, 5,000": ({"unknown": True}, 5000.0, {}),
    "effect, 5,000, noise not declared": ({}, 5000.0, {"declared": False}),
    "effect, 5,000, frame and target free": ({}, 5000.0, {"free": True, "free_target": True}),
    "the same, positions alone, noise not declared": (
        {},
        5000.0,
        {"free": True, "free_target": True, "orientations": False, "declared": False},
    ),
    "effect, 500, gross errors": ({}, 500.0, {"gross": 0.05}),
    "effect, 500, heavy tails, positions rounded to 10 um": ({}, 500.0, {"tails": 4.0}),
}
"""Options of the plant, energy, and noise."""


def jobs(machines: int) -> list[dict[str, object]]:
    """Which machines are calibrated."""
    found = [{"data": s, "robot": r, "machine": n} for s in SORTS for r in ROBOTS for n in range(machines)]
    return found + [
        {"data": i, "robot": r, "machine": n} for i in INSTRUMENTS for r in INSTRUMENTS[i] for n in range(machines)
    ]


def measured(data: str, robot: str, machine: int) -> list[dict[str, str]]:
    """What a calibration says of a machine's data: one of ``ANSWERS``, and the words."""
    seed = FIRST + 100 * machine + zlib.crc32(f"{data} {robot}".encode()) % 1_000_000
    options, energy, noise = SORTS.get(data, ({}, 2000.0, {}))
    if robot in RODS and "free_target" in noise:
        noise = {**noise, "free_target": False}  # the joints on the platform are identified with it
    recipe = drawn_recipe(
        seed,
        robot=ROBOTS[robot],
        noncentrality=energy,
        poses=POSES,
        held_out=1,
        noise=SimulatedNoise(**noise),
        **options,
    )
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as place:
        warnings.simplefilter("ignore")
        folder = Path(place) / "measured"
        case = build_measured(recipe, [data]) if data in INSTRUMENTS else build(recipe)
        case.dataset.write(folder)
        dataset = gtpin.Dataset.read(folder)
        if "rounded" in data:
            dataset = replace(dataset, position=np.round(dataset.position, 5))
        try:
            said = gtpin.calibrate(dataset).warnings
        except gtpin.GtpinError as error:
            return [{"answer": "refused", "words": str(error)}]
    return [{"answer": "warned" if any(map(ACCUSES.search, said)) else "accepted", "words": "; ".join(said)}]


def table(records: pd.DataFrame) -> str:
    """Answers by kind of data."""
    lines = ["| data |" + "".join(f" {a} |" for a in ANSWERS), "|---|" + "---|" * len(ANSWERS)]
    for name, rows in records.groupby("data", sort=False):
        lines.append(f"| {name} |" + "".join(f" {int((rows['answer'] == a).sum())} |" for a in ANSWERS))
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=3)
    parser.add_argument("--output", "-o", type=Path, help="CSV file with every answer")
    chosen = parser.parse_args()
    work = jobs(chosen.machines)
    answers = Parallel(n_jobs=-1)(delayed(measured)(**job) for job in work)
    records = pd.DataFrame([{**job, **row} for job, rows in zip(work, answers, strict=True) for row in rows])
    if chosen.output:
        records.to_csv(chosen.output, index=False)
    print(table(records))


if __name__ == "__main__":
    main()
