"""How far the paper's Tables I and II come out of the twin, over many draws of its errors.

python examples/dressler2010/seeds.py 24
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from machine import Twin
from measure import POSES, measure
from paper_closures import closure_costs, fit_closures, held_out, measured_poses
from paper_grid import RECOVERED
from paper_tables import tables

import gtpin
from gtpin.comparison.compare import compare, within_tracks
from gtpin.data import random
from gtpin.paper.models import model_geometry

Floats = npt.NDArray[np.float64]

PAIRS = (*pairwise(range(5)), (0, 2), (1, 3), (2, 4))
"""Models less one, the first worse than the second in the paper's Table I."""
EVERY = "figures/paper_draws.csv"
"""Every draw, beside the page."""


@dataclass(frozen=True)
class Draws:
    """What came out of so many draws of the twin's errors.

    Parameters
    ----------
    poses
        Poses within the carts' measured range.
    pose, closure, recovered
        (draws, 5, 2) mean and largest held-out error of models 1 to 5, um: fitted by pose residuals, by the paper's closure
        cost, and by pose residuals on the grid that Table III gives.
    recovered_poses
        Poses of that grid within the range.
    rods
        By model 1 to 4, (draws, k) what the final cost of each link stands for, um of rod length.
    set_aside
        How many of the 10 comparisons of a model by pose residuals in each draw set poses aside.
    """

    poses: int
    pose: Floats
    closure: Floats
    recovered: Floats
    recovered_poses: int
    rods: dict[int, Floats]
    set_aside: int

    def __len__(self) -> int:
        return len(self.pose)


def order(errors: Floats) -> list[int]:
    """By pair of ``PAIRS``, in how many draws the first model's mean error is the larger, as in the paper."""
    mean = errors[:, :, 0]
    return [int(np.count_nonzero(mean[:, a] > mean[:, b])) for a, b in PAIRS]


def draw(seeds: int) -> Draws:
    """Measure and compare the twins of seeds 0, 1, ..."""
    found: dict[str, list[Floats]] = {"pose": [], "closure": [], "recovered": []}
    rods: dict[int, list[Floats]] = {n: [] for n in (1, 2, 3, 4)}
    poses, set_aside = {}, 0
    for seed in range(seeds):
        dataset, _ = measure(seed)
        other, _ = measure(seed, RECOVERED.points(Twin(seed).rods)[:POSES])
        for n, sizes in fitted_rods(dataset).items():
            rods[n].append(sizes)
        errors, _ = held_out(dataset)
        found["closure"].append(1e6 * np.column_stack([errors.mean(axis=1), errors.max(axis=1)]))
        for kind, data in (("pose", dataset), ("recovered", other)):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", gtpin.GtpinWarning)
                table = compare(data).table()
            set_aside += sum("set aside" in str(w.message) for w in caught)
            found[kind].append(table[["mean_um", "max_um"]].to_numpy())
            poses[kind] = int(table["poses"].iloc[0])
    arrays = {kind: np.array(values) for kind, values in found.items()}
    return Draws(
        poses["pose"],
        **arrays,
        recovered_poses=poses["recovered"],
        rods={n: np.array(values) for n, values in rods.items()},
        set_aside=set_aside,
    )


def fitted_rods(dataset: gtpin.Dataset) -> dict[int, Floats]:
    """By model, what the final cost by link of a fit to half of the poses within range stands for, um of rod length."""
    robot = gtpin.load_robot("gantry_tau")
    inside = dataset.take(within_tracks(robot, dataset))
    half = inside.take(random(inside, 2, seed=0)[0])
    poses, found = measured_poses(half), {}
    for n in (1, 2, 3, 4):
        fitted = fit_closures(model_geometry(n, robot, half), half.q, poses)
        cost = closure_costs(fitted, half.q, poses) / len(half)
        found[n] = rod_length(cost[[0, 1, 3]] if n < 3 else cost)
    return found


def printed_rods(model: int) -> Floats:
    """The same of the costs that the paper prints, over its 61 poses."""
    return rod_length(tables().costs(model) / tables().measurement.calibration_poses)


def turning_alone() -> Floats:
    """(3,) what the plate's turning leaves of each cart's links in a reduced arm, um of rod length.

    Of Table II's geometry at the twin's poses, without any other error.
    """
    robot = gtpin.load_robot("gantry_tau")
    dataset, _ = measure()
    q = dataset.q[within_tracks(robot, dataset)]
    poses = gtpin.Model(gtpin.Geometry.nominal(robot)).predict(q)
    cost = closure_costs(fit_closures(model_geometry(1, robot, dataset), q, poses), q, poses)
    return rod_length(cost[[0, 1, 3]] / len(q))


def rod_length(square: Floats) -> Floats:
    """Error of a rod's length, um, that a mean squared closure residual, m^4, stands for: the residual of L^2 is 2 L dL."""
    return np.asarray(1e6 * np.sqrt(square) / (2.0 * tables().calibrated[3].length.mean()))


def markdown(draws: Draws) -> str:
    """The tables of the page: Table II and Table I, paper and twin."""
    paper = tables()
    lines = ["| model | 1 | 2 or 2a | 2b | 3 or 3a | 3b | 3c |", "|---" * 7 + "|"]
    for n, found in draws.rods.items():
        cells = [f"{p:.0f}/{t:.0f}" for p, t in zip(printed_rods(n), found.mean(axis=0), strict=True)]
        lines.append(f"| {n} | " + " | ".join(cells if n > 2 else [cells[0], cells[1], "", cells[2], "", ""]) + " |")
    lines += [
        "",
        "The final cost of each link as an rms error of rod length, micrometres: the paper / the twin.",
        "",
    ]
    kinds = {"pose cost": draws.pose, "the paper's cost": draws.closure, "grid of Table III": draws.recovered}
    head = [f"{what}, {kind}" for what in ("mean", "largest") for kind in ("paper", *kinds)]
    lines += ["| model | " + " | ".join(head) + " |", "|---" * 9 + "|"]
    for i in range(5):
        cells = []
        for j, printed in enumerate((paper.mean_um, paper.max_um)):
            cells.append(f"{printed[i]:.0f}")
            cells += [f"{e[:, i, j].mean():.0f} ± {e[:, i, j].std():.0f}" for e in kinds.values()]
        lines.append(f"| {i + 1} | " + " | ".join(cells) + " |")
    lines += [
        "",
        f"Held-out error, micrometres: mean over {len(draws)} draws ± the standard deviation between draws.",
        "",
    ]
    lines.append(f"Mean and largest held-out error of every draw (pose cost): [{EVERY}]({EVERY}).")
    return "\n".join(lines) + "\n"


def every_draw(draws: Draws) -> str:
    """Mean and largest held-out error of each model in each draw, pose cost, micrometres, as CSV."""
    lines = [",".join(["seed", *(f"{what}_um_{model}" for model in range(1, 6) for what in ("mean", "max"))])]
    for seed, errors in enumerate(draws.pose):
        lines.append(",".join([str(seed), *(f"{mean:.1f},{largest:.0f}" for mean, largest in errors)]))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    result = draw(int(sys.argv[1]) if len(sys.argv) > 1 else 12)
    print(markdown(result))
    print(f"{result.set_aside} fits set poses aside")
