"""How far each step gets on left-out poses: python ladder.py DATASET [--name NAME] [--folds N] [--poses N] [--left-out random].

Three models predict poses that were left out when they were fitted: the nominal robot with the instrument's frame and the
target fitted, the calibrated geometry, and the geometry with the causes of a diagnosis. Left out are the poses of one region
after the other, or with ``--left-out random`` any poses. Every part is calibrated and diagnosed anew. Positions that the
dataset gives in a frame of its own want ``frame = "free"``; where the target is not at the robot's TCP, ``--free-target``
identifies it as well, whatever dataset.toml says. ``--name`` keeps the figures in docs/figures/real_arms.json, from which
``python examples/pages/refresh.py`` makes the tables of docs/real_arms.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

import gtpin
from gtpin.data import by_region, random

Floats = npt.NDArray[np.float64]

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "real_arms.json"
STEPS = ("nominal", "geometry", "diagnosis")


def off(model: gtpin.Model, dataset: gtpin.Dataset) -> Floats:
    """(N,) lengths of the position errors of a model, mm."""
    predicted = model.predict(dataset.q, dataset.covariates)
    return np.asarray(1e3 * np.linalg.norm(dataset.position - predicted.T, axis=1))


def steps(dataset: gtpin.Dataset, folds: int, left_out: str) -> dict[str, Floats]:
    """Of each step the (N,) position errors, mm, of poses that were left out, part by part: regions, or any poses."""
    found: dict[str, list[Floats]] = {step: [] for step in STEPS}
    for held in (random if left_out == "random" else by_region)(dataset, folds):
        known, other = dataset.take(~held), dataset.take(held)
        nominal = gtpin.calibrate(known, without=["placement"]).model
        diagnosis = gtpin.diagnose(known)
        for step, model in zip(STEPS, (nominal, diagnosis.baseline.model, diagnosis.model), strict=True):
            found[step].append(off(model, other))
    return {step: np.concatenate(values) for step, values in found.items()}


def ladder(dataset: gtpin.Dataset, folds: int, left_out: str) -> dict[str, object]:
    """The errors of each step on left-out poses."""
    errors_of = steps(dataset, folds, left_out)
    return {
        "robot": Path(dataset.robot).stem,
        "poses": len(dataset),
        "folds": folds,
        "left_out_by": left_out,
        "left_out": {
            step: {"rms": float(np.sqrt((errors**2).mean())), "mean": float(errors.mean()), "max": float(errors.max())}
            for step, errors in errors_of.items()
        },
    }


def said(dataset: gtpin.Dataset) -> dict[str, object]:
    """What a diagnosis of all poses of a dataset says."""
    began = time.process_time()
    whole = gtpin.diagnose(dataset)
    seconds = time.process_time() - began
    gap = whole.gap
    return {
        "verdict": whole.verdict,
        "doubts": [[doubt.reason, doubt.site, list(doubt.over)] for doubt in whole.doubts],
        "causes": [
            {
                "effect": c.effect,
                "site": c.site,
                "probability": c.probability,
                "class": [[member.effect, member.site, member.probability] for member in c.members],
                "parameters": {name: [p.value, p.sigma, p.unit] for name, p in c.parameters.items()},
            }
            for c in whole.causes
        ],
        "gap": [1e3 * value for value in (gap.before, gap.after, gap.floor)],
        "shrinkage": [gap.explained_fraction, *(gap.interval or (None, None))],
        "untestable": [sum(not c.testable for c in whole.candidates), len(whole.candidates)],
        "set_aside": len(whole.set_aside),
        "seconds": seconds,
    }


def read(folder: Path, free_target: bool, poses: int | None) -> gtpin.Dataset:
    """The dataset, or so many poses of it drawn at random (always the same)."""
    dataset = gtpin.Dataset.read(folder)
    if free_target:
        dataset = replace(dataset, instrument=dataset.instrument.model_copy(update={"target": "free"}))
    if poses is not None and poses < len(dataset):
        dataset = dataset.take(np.sort(np.random.default_rng(0).permutation(len(dataset))[:poses]))
    return dataset


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--name", help="keep the figures under this name")
    parser.add_argument("--folds", type=int, default=5, help="parts that are left out in turn")
    parser.add_argument("--left-out", choices=("region", "random"), default="region", help="what a part is")
    parser.add_argument("--ladder-only", action="store_true", help="no diagnosis of all poses")
    parser.add_argument("--poses", type=int, help="take only so many poses, drawn at random")
    parser.add_argument("--free-target", action="store_true", help="identify where the target sits on the flange")
    given = parser.parse_args(arguments)
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    try:
        dataset = read(given.dataset, given.free_target, given.poses)
        found = {} if given.ladder_only else said(dataset)
        found |= ladder(dataset, given.folds, given.left_out)
    except (OSError, gtpin.GtpinError) as error:
        sys.exit(f"{given.dataset}: {' '.join(str(error).split())}")
    print(json.dumps(found, indent=1))
    if given.name:
        kept = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
        text = json.dumps({**kept, given.name: found}, indent=1, sort_keys=True)
        RECORD.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
