"""Fit models 1 to 5 to each half of a dataset, and predict the other half."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Literal

import numpy as np
import numpy.typing as npt

from gtpin.calibration.calibrate import calibrate_geometry, without_sigmas
from gtpin.calibration.paper_models import MEASURED, MODELS, PAPERS_CHOICE, model_geometry
from gtpin.calibration.problem import measured_poses
from gtpin.comparison.closure_fit import closure_residual, fit_closures
from gtpin.comparison.result import Comparison, Cost, Held
from gtpin.data import Dataset, random
from gtpin.data.duplicates import counted_once
from gtpin.errors import DatasetError, GtpinWarning, ModelError, UnreachableError, check_kind, warn
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions, log, zyz_change
from gtpin.model.measured_robot import robot_of
from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry
from gtpin.threads import in_one_thread

Rows = npt.NDArray[np.intp]
Choice = Literal["paper", "validation"]

HALVES = 2
"""Each half is predicted by models that were fitted to the other half; the paper did so with one of them."""
FOLDS = 5
"""Number of parts of a half for the cross-validation by which model 5 chooses tracks."""


@in_one_thread
def compare(
    dataset: Dataset,
    robot: Chain | None = None,
    *,
    cost: Cost = "pose",
    choice: Choice = "paper",
    orientations: bool = False,
    seed: int = 0,
    progress: Callable[[str, int, float], None] | None = None,
) -> Comparison:
    """Compare models 1 to 5 of Dressler et al. 2010 on poses that they were not fitted to.

    The poses are divided at random into two halves; each half is predicted by models that were fitted to the other. All models
    are judged on the same poses: those within the carts' measured range. Models 2, 4 and 5 need ``carts.csv``.

    Parameters
    ----------
    dataset
        Poses measured by one tracker.
    robot
        The nominal robot; by default the one that the dataset names.
    cost
        What a fit minimises. ``pose``: pose residuals with tolerances as priors; their weights are estimated from the
        residuals of each model. ``closure``: the paper's squared closure residuals.
    choice
        The rods of model 5 on measured tracks. ``paper``: those of the paper. ``validation``: those whose closures are then
        predicted better within the fitted half.
    orientations
        Whether measured tracks also have the measured rotations of the carts, which the paper did not use.
    seed
        Seed of the division into halves.
    progress
        Called with the name of each step, 0 and NaN; None: no calls.

    Raises
    ------
    ModelError
        If the robot is not made for these models.
    DatasetError
        If there are too few poses, or closure residuals are wanted where no orientation was measured in the base frame.
    UnreachableError
        If a fitted model can't reach a held-out pose.

    Warns
    -----
    GtpinWarning
        Names the poses that the fit of a model sets aside. The model is judged on these poses too.
    """
    check_kind(dataset, Dataset)
    check_kind(robot, Chain, type(None))
    given = dataset
    dataset.refuse_readings(
        "models are compared by measured poses, and these are readings of other instruments",
        "calibrate each by itself: gtpin calibrate --model 1 ...",
    )
    robot = robot_of(dataset) if robot is None else robot
    if not robot.rod_sites:
        what = f"models 1 to 5 are for carts on tracks, which {robot.name} has not"
        raise ModelError(what, hint="use gtpin calibrate")
    if (cost == "closure" or choice == "validation") and not _closures_known(dataset):
        what = "closure residuals need orientations in the robot's frame"
        raise DatasetError(what, file=dataset.path, hint="use cost pose, choice paper")
    numbers = [n for n in MODELS if n not in MEASURED or dataset.carts is not None]
    dataset = counted_once(dataset)  # a copy in the other half would not be held out
    dataset = dataset.take(within_tracks(robot, dataset))
    if len(dataset) < 2 * HALVES:
        raise DatasetError(f"{len(dataset)} poses lie within the measured tracks", file=dataset.file, hint="add some")

    def held_out(number: int, fitted: Dataset, held: Dataset, row: Rows) -> Held:
        """The errors, on held-out poses, of a model fitted to others."""
        measured: Sequence[bool] = PAPERS_CHOICE
        if number == 5 and choice == "validation":
            measured = better_measured(robot, fitted, orientations=orientations)
        geometry = model_geometry(number, robot, fitted, measured=measured, orientations=orientations)
        model = _fitted(geometry, fitted, cost)
        poses = model.predict(held.q)
        if not poses.reached.all():
            lost = held.pose[~poses.reached][0]
            raise UnreachableError(f"model {number} can't reach pose {lost}", file=held.file, hint="leave it out")
        seen = None if held.orientation is None else from_quaternions(held.orientation)
        return Held(
            number,
            row,
            held.pose,
            np.linalg.norm(held.position - poses.T, axis=1),
            None if seen is None else np.linalg.norm(log(seen @ np.swapaxes(poses.R, 1, 2)), axis=1),
            None if seen is None else zyz_change(seen, poses.R),
            _closure_cost(model, held) if _closures_known(held) else None,
            tuple(geometry.track(i) is not None for i in range(len(robot.rod_sites))),
        )

    found = []
    for number in numbers:
        parts = []
        with _warned_once(number):
            for half, rows in enumerate(random(dataset, HALVES, seed)):
                if progress is not None:
                    progress(f"model {number}, half {half + 1}", 0, float("nan"))
                parts.append(held_out(number, dataset.take(~rows), dataset.take(rows), np.flatnonzero(rows)))
        found.append(Held.joined(parts))
    return Comparison(tuple(found), seed, cost, given)


@contextmanager
def _warned_once(number: int) -> Iterator[None]:
    """Give each warning of a model's fits once, with the model's number: models reject different rows."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", GtpinWarning)
        yield
    for text, category in dict.fromkeys((str(w.message), w.category) for w in caught):
        warn(f"model {number}: {text}", category)


def within_tracks(robot: Chain, dataset: Dataset) -> npt.NDArray[np.bool_]:
    """(N,) the poses whose commands lie in the measured range of all carts; all of them where no cart was measured."""
    if dataset.carts is None:
        return np.ones(len(dataset), dtype=bool)
    return ~model_geometry(4, robot, dataset).outside_tracks(dataset.q)


def better_measured(robot: Chain, dataset: Dataset, *, orientations: bool = False) -> list[bool]:
    """By rod, whether model 4 predicts the squared closure residual of left-out poses better than model 3."""
    dataset = dataset.take(within_tracks(robot, dataset))
    costs = {}
    for number in (3, 4):
        geometry = model_geometry(number, robot, dataset, orientations=orientations)
        total = np.zeros(len(robot.rod_sites))
        for rows in random(dataset, FOLDS):
            total += _closure_cost(_fitted(geometry, dataset.take(~rows), "closure"), dataset.take(rows))
        costs[number] = total
    return [bool(better) for better in costs[4] < costs[3]]


def _closures_known(dataset: Dataset) -> bool:
    return dataset.orientation is not None and dataset.instrument.frame == "robot"


def _fitted(geometry: Geometry, dataset: Dataset, cost: Cost) -> Model:
    if cost == "pose":
        return calibrate_geometry(without_sigmas(dataset), geometry, lacking=True).model
    return Model(fit_closures(geometry, dataset.q, _poses(dataset)).geometry)


def _closure_cost(model: Model, dataset: Dataset) -> npt.NDArray[np.float64]:
    """(k,) squared closure residuals of each rod, summed over the poses, m^4."""
    return np.asarray((closure_residual(model.geometry, dataset.q, _poses(dataset)) ** 2).sum(axis=0))


def _poses(dataset: Dataset) -> Poses:
    """The measured poses of a dataset that has orientations."""
    measured = measured_poses(dataset)
    assert measured.R is not None
    return Poses(measured.T, measured.R)
