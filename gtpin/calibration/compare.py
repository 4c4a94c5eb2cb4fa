"""Models 1 to 5 side by side on poses that they were not fitted to: Table I for any dataset."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd

from gtpin.calibration.calibrate import calibrate_geometry, measured_poses
from gtpin.calibration.closure_fit import closure_residual, fit_closures
from gtpin.calibration.paper_models import MEASURED, MODELS, PAPERS_CHOICE, model_geometry
from gtpin.data import Dataset, random
from gtpin.errors import DatasetError
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions, log
from gtpin.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.robot.library import load_robot
from gtpin.robot.robot import Robot

Floats = npt.NDArray[np.float64]
Cost = Literal["pose", "closure"]
Choice = Literal["paper", "validation"]

RESAMPLES = 2000
"""Bootstrap samples behind every interval."""
FOLDS = 2
"""Halves: each is predicted by models fitted to the other, as the paper did with one of them."""


@dataclass(frozen=True)
class Held:
    """One model's errors on held-out poses.

    Parameters
    ----------
    model
        1 to 5.
    position, orientation
        (N,) length of each error, m, and its rotation angle, rad; orientation None where it was not measured.
    pose
        (N,) ids, in the order of the errors.
    closure_cost
        (k,) squared closure residuals of each rod summed over the held-out poses, m^4; None where they can't be had.
    measured
        (k,) rods whose track was taken as measured.
    """

    model: int
    position: Floats
    orientation: Floats | None
    pose: npt.NDArray[np.object_]
    closure_cost: Floats | None
    measured: tuple[bool, ...]

    def figures(self, rows: npt.NDArray[np.intp] | slice = slice(None)) -> dict[str, float | None]:
        """Mean, largest and root mean square error of some of the poses, in the units of the columns' names."""
        p = self.position[rows] * 1e6
        o = None if self.orientation is None else float(np.sqrt((self.orientation[rows] ** 2).mean()) * 1e3)
        return {
            "mean_um": float(p.mean()),
            "max_um": float(p.max()),
            "rms_um": float(np.sqrt((p**2).mean())),
            "orientation_rms_mrad": o,
        }


@dataclass(frozen=True)
class Comparison:
    """The models that the dataset allows, side by side.

    Parameters
    ----------
    held
        One entry a model, in their order.
    seed
        Of the halves and of the bootstrap.
    cost
        What the models were fitted by.
    """

    held: tuple[Held, ...]
    seed: int
    cost: Cost

    def table(self) -> pd.DataFrame:
        """``model, mean_um, max_um, rms_um, orientation_rms_mrad, poses``, one row a model."""
        return pd.DataFrame([{"model": h.model, **h.figures(), "poses": len(h.position)} for h in self.held])

    def intervals(self) -> list[dict[str, tuple[float, float] | None]]:
        """95 % bootstrap intervals of every figure, one entry a model; visits of a pose are drawn together."""
        return [_intervals(h, np.random.default_rng(self.seed)) for h in self.held]

    def to_json(self) -> dict[str, Any]:
        """The content of ``compare.json``."""
        rows = []
        for held, interval in zip(self.held, self.intervals(), strict=True):
            rows.append(
                {
                    "model": held.model,
                    **held.figures(),
                    "poses": len(held.position),
                    "interval": {name: None if ends is None else list(ends) for name, ends in interval.items()},
                    "closure_cost_m4": None if held.closure_cost is None else held.closure_cost.tolist(),
                    "measured_tracks": list(held.measured),
                }
            )
        return {"schema": "gtpin-compare/1", "cost": self.cost, "seed": self.seed, "models": rows}


def compare(
    dataset: Dataset,
    robot: Robot | None = None,
    *,
    cost: Cost = "pose",
    choice: Choice = "paper",
    seed: int = 0,
    progress: Callable[[str, int, float], None] | None = None,
) -> Comparison:
    """Fit models 1 to 5 to each half of a dataset and predict the other.

    All are judged on the same poses: those within the carts' measured range. Models 2, 4 and 5 need ``carts.csv``.

    Parameters
    ----------
    cost
        ``pose``: pose residuals with tolerances as priors. ``closure``: the paper's squared closure residuals.
    choice
        For model 5: the paper's rods on measured tracks, or those that predict closures better within the fitted half.
    seed
        Of the halves.

    Raises
    ------
    DatasetError
        If there are too few poses, or the paper's cost is wanted where no orientation was measured in the base frame.
    """
    robot = load_robot(dataset.robot_reference) if robot is None else robot
    closures_known = dataset.orientation is not None and dataset.instrument.frame == "robot"
    if (cost == "closure" or choice == "validation") and not closures_known:
        raise DatasetError(
            "closure residuals need orientations in the robot's frame",
            file=dataset.path,
            hint="use cost pose, choice paper",
        )
    numbers = [n for n in MODELS if n not in MEASURED or dataset.carts is not None]
    dataset = _within_tracks(dataset, robot, numbers)
    held_out = random(dataset, FOLDS, seed)
    found = []
    for number in numbers:
        parts = []
        for fold, rows in enumerate(held_out):
            if progress is not None:
                progress(f"model {number}, half {fold + 1}", 0, float("nan"))
            parts.append(_held(number, robot, dataset.take(~rows), dataset.take(rows), cost, choice, closures_known))
        found.append(_joined(parts))
    return Comparison(tuple(found), seed, cost)


def _within_tracks(dataset: Dataset, robot: Robot, numbers: Sequence[int]) -> Dataset:
    inside = np.ones(len(dataset), dtype=bool)
    for number in numbers:
        inside &= ~model_geometry(number, robot, dataset).outside_tracks(dataset.q)
    if inside.sum() < 2 * FOLDS:
        raise DatasetError(
            f"{inside.sum()} poses lie within the measured tracks", file=dataset.file, hint="measure more"
        )
    return dataset.take(inside)


def _held(
    number: int, robot: Robot, fitted: Dataset, held: Dataset, cost: Cost, choice: Choice, closures_known: bool
) -> Held:
    measured: Sequence[bool] = PAPERS_CHOICE
    if number == 5 and choice == "validation":
        measured = better_measured(robot, fitted)
    geometry = model_geometry(number, robot, fitted, measured=measured)
    model = _fitted(geometry, fitted, cost)
    poses = model.predict(held.q)
    seen = None if held.orientation is None else from_quaternions(held.orientation)
    costs = None
    if closures_known and seen is not None:
        costs = (closure_residual(model.geometry, held.q, Poses(held.position, seen)) ** 2).sum(axis=0)
    return Held(
        number,
        np.linalg.norm(held.position - poses.T, axis=1),
        None if seen is None else np.linalg.norm(log(seen @ np.swapaxes(poses.R, 1, 2)), axis=1),
        held.pose,
        costs,
        tuple(geometry.track(i) is not None for i in range(len(robot.rods))),
    )


def _fitted(geometry: Geometry, dataset: Dataset, cost: Cost) -> Model:
    if cost == "pose":
        return calibrate_geometry(dataset, geometry).model
    measured = measured_poses(dataset)
    assert measured.R is not None
    return Model(fit_closures(geometry, measured.q, Poses(measured.T, measured.R)).geometry)


def better_measured(robot: Robot, dataset: Dataset, folds: int = 5) -> list[bool]:
    """By rod, whether model 4 predicts the squared closure residual of left-out poses better than model 3."""
    costs = {}
    for number in (3, 4):
        total = np.zeros(len(robot.rods))
        for rows in random(dataset, folds, 0):
            model = _fitted(model_geometry(number, robot, dataset), dataset.take(~rows), "closure")
            left = measured_poses(dataset.take(rows))
            assert left.R is not None
            total += (closure_residual(model.geometry, left.q, Poses(left.T, left.R)) ** 2).sum(axis=0)
        costs[number] = total
    return [bool(better) for better in costs[4] < costs[3]]


def _joined(parts: list[Held]) -> Held:
    orientations = [part.orientation for part in parts if part.orientation is not None]
    costs = [part.closure_cost for part in parts if part.closure_cost is not None]
    return replace(
        parts[0],
        position=np.concatenate([part.position for part in parts]),
        orientation=np.concatenate(orientations) if orientations else None,
        pose=np.concatenate([part.pose for part in parts]),
        closure_cost=np.sum(costs, axis=0) if costs else None,
    )


def _intervals(held: Held, rng: np.random.Generator) -> dict[str, tuple[float, float] | None]:
    _, visit = np.unique(held.pose.astype(str), return_inverse=True)
    order = np.argsort(visit, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(visit[order])) + 1)
    samples = []
    for _ in range(RESAMPLES):
        drawn = rng.integers(0, len(groups), len(groups))
        samples.append(held.figures(np.concatenate([groups[g] for g in drawn])))
    ends: dict[str, tuple[float, float] | None] = {}
    for name in samples[0]:
        values = [sample[name] for sample in samples]
        low_high = None if values[0] is None else np.percentile(np.array(values, dtype=float), (2.5, 97.5))
        ends[name] = None if low_high is None else (float(low_high[0]), float(low_high[1]))
    return ends
