"""Do two halves of a real series tell the same? ``python halves.py REAL OUT [--record FILE]``.

Each series of plant.py is divided by pose (at random), by time (in the order of the rows) and by region (along the longest axis
of the predicted positions). A cause of .9 or more in one half that is in no class of the other half counts as false.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from answers import SURE, classes, half, name
from background import Background, answer
from numpy.typing import NDArray
from plant import backgrounds

import gtpin

SPLITS = ("pose", "time", "region")


def first_half(background: Background, split: str) -> NDArray[np.bool_]:
    """(N,) rows of one of the two halves."""
    data = background.dataset
    if split == "pose":
        return np.isin(data.row, half(data).row)
    if split == "time":
        order = data.covariates.get("time", data.row)
        return np.asarray(np.argsort(np.argsort(order, kind="stable")) < len(data) // 2)
    T = background.plain.predict(data.q).T
    along = (T - T.mean(axis=0)) @ np.linalg.svd(T - T.mean(axis=0), full_matrices=False)[2][0]
    return np.asarray(along < np.median(along))


def agree(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Whether all parameters of one cause in two halves differ by no more than two standard deviations."""
    both = [(one["parameters"][k], other["parameters"][k]) for k in one["parameters"] if k in other["parameters"]]
    return all(abs(a["value"] - b["value"]) <= 2.0 * np.hypot(a["sigma"], b["sigma"]) for a, b in both)


def compared(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """Of two answers: causes of .9 or more, those that the other half does not have, and how many have the same size."""
    sure, false, same, both = 0, [], 0, 0
    for mine, theirs in ((one, other), (other, one)):
        there = classes(theirs) | {name(m) for also in theirs["also"] for m in also["class"]}
        leaders = {name(c): c for c in theirs["causes"]}
        for cause in mine["causes"]:
            if cause["probability"] < SURE:
                continue
            sure += 1
            if name(cause) not in there:
                false.append("@".join(name(cause)))
            elif name(cause) in leaders:
                both += 1
                same += agree(cause, leaders[name(cause)])
    return {"sure": sure, "false": false, "in both": both, "same size": same}


def main() -> None:
    parser = argparse.ArgumentParser(description="Diagnose halves of real series.")
    parser.add_argument("real", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--record", type=Path, help="write the results to this JSON file")
    given = parser.parse_args()
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    found: dict[str, dict[str, Any]] = {}
    for background in backgrounds(given.real, given.out):
        for split in SPLITS:
            first = first_half(background, split)
            place = given.out / "halves" / f"{background.name}-{split}"
            said = [
                answer(background.dataset.take(rows), place.with_name(f"{place.name}-{k}"))
                for k, rows in enumerate((first, ~first))
            ]
            found.setdefault(background.name, {})[split] = compared(*said)
            print(background.name, split, [s["verdict"] for s in said], compared(*said), flush=True)
    if given.record:
        known = json.loads(given.record.read_text()) if given.record.exists() else {}
        given.record.write_text(json.dumps(known | {"halves": found}) + "\n")


if __name__ == "__main__":
    main()
