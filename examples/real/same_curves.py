"""Whether two series of one arm show the same errors: python same_curves.py DATASET DIAGNOSIS DATASET DIAGNOSIS.

Each DIAGNOSIS is the folder that ``gtpin diagnose DATASET -o DIAGNOSIS`` wrote. Of every joint, the deviations that the two
diagnoses found are compared where both series have poses. What the geometry absorbs (a constant, a cosine and a sine of the
angle) is taken away from both. Then each series is predicted by the causes of the other, with only the geometry fitted.
Writes docs/figures/real_curves.json, from which ``python examples/pages/refresh.py`` makes tables of docs/real_arms.md.
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import gtpin
from gtpin.effects.operating_points import OperatingPoints

Floats = npt.NDArray[np.float64]

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "real_curves.json"
BIN = np.radians(5.0)
LEAST = 1.0 / 2000.0
"""Part of a series' poses that an angle's bin must have, so that the curve there is measured."""


def deviation(model: gtpin.Model, j: int, angle: Floats) -> Floats:
    """(N,) deviation of joint j by all effects of its travel, rad, at angles (N,), rad; other joints at home."""
    q = np.tile(model.robot.home_q, (len(angle), 1))
    q[:, j] = angle
    poses, total = model.kinematics.forward(q), np.zeros(len(angle))
    for active in model.effects:
        if active.site == model.robot.sites[j] and active.effect.of_travel:
            at = OperatingPoints(model.kinematics, q, poses, {}, fixed=active.references)
            moved = active.basis(at).command
            total += 0.0 if moved is None else moved[1] @ active.coefficients
    return total


def measured(q: Floats, angle: Floats) -> npt.NDArray[np.bool_]:
    """Whether each angle has poses near it, of a joint's commands q (N,)."""
    near = np.histogram(q, bins=np.append(angle - BIN / 2.0, angle[-1] + BIN / 2.0))[0]
    return np.asarray(near >= LEAST * len(q))


def compared(models: list[gtpin.Model], series: list[gtpin.Dataset], j: int) -> dict[str, float] | None:
    """How the two curves of a joint agree, mrad, where both series have poses; None where there are too few such angles."""
    best: dict[str, float] | None = None
    for turn in 2.0 * np.pi * np.arange(-1, 2):
        commands = [series[0].q[:, j], series[1].q[:, j] + turn]
        low, high = max(q.min() for q in commands), min(q.max() for q in commands)
        angle = np.arange(low + BIN / 2.0, high, BIN)
        if len(angle) < 6:
            continue
        both = measured(commands[0], angle) & measured(commands[1], angle)
        if both.sum() * BIN < np.radians(30.0) or (best and best["degrees"] >= np.degrees(both.sum() * BIN)):
            continue
        fine = (angle[both, None] + BIN * np.linspace(-0.4, 0.4, 5)).ravel()
        slow = np.stack([np.ones_like(fine), np.cos(fine), np.sin(fine)], axis=1)
        curves = [deviation(models[0], j, fine), deviation(models[1], j, fine - turn)]
        a, b = (c - slow @ np.linalg.lstsq(slow, c, rcond=None)[0] for c in curves)
        rms = [float(1e3 * np.sqrt((c**2).mean())) for c in (a, b, a - b)]
        best = {
            "degrees": float(np.degrees(both.sum() * BIN)),
            **dict(zip(("first", "second", "difference"), rms, strict=True)),
            "correlation": float(np.corrcoef(a, b)[0, 1]) if min(rms[:2]) > 0.0 else float("nan"),
        }
    return best


def left(dataset: gtpin.Dataset, effects: tuple[Any, ...]) -> float:
    """Root mean square position error, mm, with kept effects and the geometry fitted."""
    model = gtpin.calibrate(dataset, keep_effects=effects).model
    predicted = model.predict(dataset.q, dataset.covariates)
    return float(1e3 * np.sqrt(((dataset.position - predicted.T) ** 2).sum(axis=1).mean()))


def main(folders: list[Path]) -> None:
    series = [gtpin.Dataset.read(folder) for folder in folders[::2]]
    models = [gtpin.read_model(folder) for folder in folders[1::2]]
    sites = models[0].robot.sites
    found = {
        "series": [f"{folder.name}, {len(data):,} poses" for folder, data in zip(folders[::2], series, strict=True)],
        "joints": {site: compared(models, series, j) for j, site in enumerate(sites)},
        "geometry": [left(data, ()) for data in series],
        "kept": [left(data, other.effects) for data, other in zip(series, models[::-1], strict=True)],
    }
    RECORD.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit("python same_curves.py DATASET DIAGNOSIS DATASET DIAGNOSIS")
    warnings.simplefilter("ignore", gtpin.GtpinWarning)
    main([Path(argument) for argument in sys.argv[1:]])
