"""What is left of Jugglebot's legs, in the sample and on poses that were not fitted: python cross_validate.py DATASET [FOLDS].

Every fold is calibrated and diagnosed anew, without the poses that it is judged by.
"""

from __future__ import annotations

import sys
import warnings

import numpy as np

import gtpin
from gtpin.data.split import random
from gtpin.kinematics.rotations import from_quaternions, log

Floats = np.ndarray


def legs(model: gtpin.Model, dataset: gtpin.Dataset) -> Floats:
    """(N, 6) by how much each leg is longer than the model has it, m: the poses' errors along the legs."""
    poses, kinematics = model.predict(dataset.q, dataset.covariates), model.kinematics
    turned = log(from_quaternions(dataset.orientation) @ np.swapaxes(poses.R, 1, 2))
    off = np.hstack([dataset.position - poses.T, turned])
    lengths = np.linalg.norm(kinematics.pose_jacobian(dataset.q, poses)[:, :, :3], axis=2)
    return np.einsum("nki,ni->nk", kinematics.pose_jacobian(dataset.q, poses), off) / lengths


def rms(values: list[Floats] | Floats) -> str:
    return f"{1e3 * np.sqrt((np.vstack(values) ** 2).mean()):.3f} mm"


def main(folder: str, folds: int) -> None:
    dataset = gtpin.Dataset.read(folder)
    whole = gtpin.diagnose(dataset)
    print(f"in the sample: {rms(legs(whole.baseline.model, dataset))} after calibration, ", end="")
    print(f"{rms(legs(whole.model, dataset))} with the causes; verdict {whole.verdict}")
    for cause in whole.causes:
        print(f"  {cause.effect} at {cause.site}: probability {cause.probability:.2f}, {cause.parameters}")
    without, with_causes = [], []
    for held in random(dataset, folds):
        found = gtpin.diagnose(dataset.take(~held))
        without.append(legs(found.baseline.model, dataset.take(held)))
        with_causes.append(legs(found.model, dataset.take(held)))
        print(
            f"  fold: {', '.join(f'{c.effect}@{c.site}' for c in found.causes)}: {rms(without[-1:])} to {rms(with_causes[-1:])}"
        )
    print(f"cross-validation in {folds} folds: {rms(without)} after calibration, {rms(with_causes)} with the causes")


if __name__ == "__main__":
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 8)
