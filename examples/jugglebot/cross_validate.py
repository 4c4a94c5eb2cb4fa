"""What is left of Jugglebot's legs, in the sample and on poses that were not fitted: python cross_validate.py DATASET [FOLDS].

Every fold is calibrated and diagnosed anew, without the poses that it is judged by. Writes docs/figures/jugglebot.json;
``python examples/pages/refresh.py`` makes the table of docs/real_arms.md of it.
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import numpy as np

import gtpin
from gtpin.data.split import random
from gtpin.kinematics.rotations import from_quaternions, log

Floats = np.ndarray
RECORD = Path(__file__).parents[2] / "docs" / "figures" / "jugglebot.json"


def legs(model: gtpin.Model, dataset: gtpin.Dataset) -> Floats:
    """(N, 6) by how much each leg is longer than the model has it, m: the poses' errors along the legs."""
    poses, kinematics = model.predict(dataset.q, dataset.covariates), model.kinematics
    turned = log(from_quaternions(dataset.orientation) @ np.swapaxes(poses.R, 1, 2))
    on_platform, on_base = kinematics.rod_ends(dataset.q, poses)
    along = (on_platform - on_base) / np.linalg.norm(on_platform - on_base, axis=2)[..., None]
    moved = (dataset.position - poses.T)[:, None] + np.cross(turned[:, None], on_platform - poses.T[:, None])
    return np.einsum("nki,nki->nk", along, moved)


def rms(values: list[Floats] | Floats) -> float:
    """Root mean square, mm."""
    return float(1e3 * np.sqrt((np.vstack(values) ** 2).mean()))


def main(folder: str, folds: int) -> None:
    dataset = gtpin.Dataset.read(folder)
    whole = gtpin.diagnose(dataset)
    named = [[c.effect, c.site] for c in whole.causes]
    without, with_causes, again = [], [], 0
    for held in random(dataset, folds):
        found = gtpin.diagnose(dataset.take(~held))
        without.append(legs(found.baseline.model, dataset.take(held)))
        with_causes.append(legs(found.model, dataset.take(held)))
        again += [[c.effect, c.site] for c in found.causes] == named
    record = {
        "poses": len(dataset),
        "verdict": whole.verdict,
        "causes": [
            {"effect": c.effect, "site": c.site, "probability": c.probability, "parameters": c.parameters}
            for c in whole.causes
        ],
        "legs_sample": [rms(legs(model, dataset)) for model in (whole.baseline.model, whole.model)],
        "legs_left_out": [rms(without), rms(with_causes)],
        "gap": [1e3 * value for value in (whole.gap.before, whole.gap.after, whole.gap.floor)],
        "folds": folds,
        "same_cause": again,
        "untestable": [sum(not c.testable for c in whole.candidates), len(whole.candidates)],
    }
    RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(record, indent=1))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("give the dataset that convert.py wrote: python cross_validate.py DATASET [FOLDS]")
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 8)
