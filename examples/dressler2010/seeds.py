"""How far the paper's Tables I and II come out of the twin, over many draws of its errors.

python examples/dressler2010/seeds.py 24
"""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
from measure import measure

import gtpin
from gtpin.calibration.closure_fit import fit_closures
from gtpin.calibration.compare import compare, within_tracks
from gtpin.calibration.paper_models import model_geometry
from gtpin.data import random
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions

COSTS = {  # Table II, m^4, over 61 poses; the reduced arm's by cart
    1: (5.458e-6, 3.661e-6, 3.515e-7),
    2: (5.506e-6, 2.4647e-6, 5.5341e-7),
    3: (2.5339e-6, 2.9384e-6, 2.8946e-6, 4.4596e-7, 3.108e-7, 5.6626e-7),
    4: (2.6253e-6, 1.6629e-6, 1.5159e-6, 1.1687e-6, 1.3091e-6, 4.3551e-7),
}
MEAN, LARGEST = (140, 120, 110, 100, 90), (410, 440, 260, 340, 240)  # Table I, micrometres
KINDS = {  # rows of Table I: by what cost, and whether the carts' measured turning is used
    "pose residuals": {"cost": "pose"},
    "the paper's closure cost": {"cost": "closure"},
    "pose residuals, carts' turning": {"cost": "pose", "orientations": True},
}


def fitted_costs(dataset: gtpin.Dataset) -> dict[int, np.ndarray]:
    """By model, the final cost by link of a fit to half of the poses within range, scaled to 61 poses, m^4."""
    robot = gtpin.load_robot("gantry_tau")
    inside = dataset.take(within_tracks(robot, dataset))
    half = inside.take(random(inside, 2, seed=0)[0])
    poses = Poses(half.position, from_quaternions(half.orientation))
    costs = {n: fit_closures(model_geometry(n, robot, half), half.q, poses).cost * 61 / len(half) for n in COSTS}
    return {n: cost[[0, 1, 3]] if n < 3 else cost for n, cost in costs.items()}


def main(seeds: int) -> None:
    costs = {n: [] for n in COSTS}
    errors = {kind: [] for kind in KINDS}
    for seed in range(seeds):
        dataset, _ = measure(seed)
        for n, cost in fitted_costs(dataset).items():
            costs[n].append(cost)
        for kind, options in KINDS.items():
            errors[kind].append(compare(dataset, **options).table()[["mean_um", "max_um"]].to_numpy())
    print(f"Table II, rms of a rod's length, um (paper / twin), {seeds} seeds")
    for n, found in costs.items():
        pairs = zip(COSTS[n], np.mean(found, axis=0), strict=True)
        print(f"  model {n}: " + "  ".join(f"{_rod(paper):.0f} / {_rod(twin):.0f}" for paper, twin in pairs))
    print(f"Table I, um: the paper's means {MEAN}, largest {LARGEST}")
    for kind, found in errors.items():
        mean, largest = np.moveaxis(np.array(found), 2, 0)
        print(f"  {kind}: means {_row(mean.mean(axis=0))} +- {_row(mean.std(axis=0))} from seed to seed, "
              f"largest {_row(largest.mean(axis=0))} +- {_row(largest.std(axis=0))}")  # fmt: skip
        for a, b in [*pairwise(range(5)), (0, 2), (1, 3), (2, 4)]:
            print(f"    model {a + 1} worse than {b + 1}: {np.count_nonzero(mean[:, a] > mean[:, b])} of {seeds}")


def _rod(cost: float) -> float:
    """Error of a rod's length, um, that a cost over 61 poses stands for: the residual of L^2 is 2 L dL."""
    return 1e6 * np.sqrt(cost / 61) / (2 * 2.044)


def _row(values: np.ndarray) -> str:
    return " ".join(f"{value:.0f}" for value in values)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 12)
