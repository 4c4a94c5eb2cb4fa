"""Fit models 1 to 5 to each half of a dataset, and predict the other half."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.calibrate import calibrate_geometry, without_sigmas
from gtpin.comparison.result import Comparison, Held
from gtpin.data import Dataset, random
from gtpin.data.duplicates import counted_once
from gtpin.data.instrument_rows import POSES
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.errors import DatasetError, ModelError, UnreachableError, check_kind, noted, unheard, warn
from gtpin.instruments.predicted import predicted_readings
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions
from gtpin.model.measured_robot import robot_of
from gtpin.model.model import Model
from gtpin.paper.models import MEASURED, MODELS, model_geometry
from gtpin.read_only import gives_read_only
from gtpin.robot.chain import Chain
from gtpin.threads import in_one_thread

HALVES = 2
"""Each half is predicted by models that were fitted to the other half; the paper did so with one of them."""


@in_one_thread
@gives_read_only
def compare(
    dataset: Dataset,
    robot: Chain | None = None,
    *,
    orientations: bool = False,
    seed: int = 0,
    progress: Callable[[str, int, float], None] | None = None,
) -> Comparison:
    """Compare models 1 to 5 of Dressler et al. 2010 on poses that they were not fitted to.

    The poses are divided at random into two halves; each half is predicted by models that were fitted to the other, as
    :func:`~gtpin.calibration.calibrate.calibrate` fits them. All models are judged on the same poses: those within the carts'
    measured range. Models 2, 4 and 5 need ``carts.csv``.

    Parameters
    ----------
    dataset
        Poses measured by one tracker, also from several stations.
    robot
        The nominal robot; by default the one that the dataset names.
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
        If there are too few poses.
    UnreachableError
        If a fitted model can't reach a held-out pose.

    Warns
    -----
    GtpinWarning
        Names the poses that the fit of a model sets aside. The model is judged on these poses too.
    """
    check_kind(dataset, Dataset)
    check_kind(robot, Chain, type(None))
    if len(dataset.readings.tables) > 1 or not any(dataset.readings.stations):
        dataset.refuse_readings(
            "models are compared by measured poses, and these are readings of other instruments",
            "calibrate each by itself: gtpin calibrate --model 1 ...",
        )
    robot = robot_of(dataset) if robot is None else robot
    if not robot.rod_sites:
        what = f"models 1 to 5 are for carts on tracks, which {robot.name} has not"
        raise ModelError(what, hint="use gtpin calibrate")
    data = counted_once(dataset)  # a copy in the other half would not be held out
    data = data.take(within_tracks(robot, data))
    if len(data) < 2 * HALVES:
        raise DatasetError(f"{len(data)} poses lie within the measured tracks", file=data.file, hint="add some")
    held = []
    with noted() as texts:
        for number in MODELS:
            if number in MEASURED and data.carts is None:
                continue
            poses = Poses.unknown(len(data))
            with _warned_once(number):
                for half, rows in enumerate(random(data, HALVES, seed)):
                    if progress is not None:
                        progress(f"model {number}, half {half + 1}", 0, float("nan"))
                    fitted = without_sigmas(data.take(~rows))
                    geometry = model_geometry(number, robot, fitted, orientations=orientations)
                    found = _read(calibrate_geometry(fitted, geometry, lacking=True).model, data.take(rows))
                    poses.T[rows], poses.R[rows] = found.T, found.R
            if not poses.reached.all():
                lost = data.pose[~poses.reached][0]
                raise UnreachableError(f"model {number} can't reach pose {lost}", file=data.file, hint="leave it out")
            held.append(Held.of(number, _as_read(data), poses))
    return Comparison(tuple(held), seed, dataset, dataset.all_warnings(texts))


def _read(model: Model, data: Dataset) -> Poses:
    """(N) poses that the instrument would read by a model; of a tracker with stations, each in the frame of its session."""
    poses = model.predict(data.q)
    if not model.instruments:
        return poses
    ids = {"session": data.readings.columns["session"]}
    read = predicted_readings(model, poses, model.instruments[0].name, ids)
    turned = from_quaternions(np.column_stack([read[n] for n in ORIENTATION])) if "qw" in read else poses.R
    return Poses(np.column_stack([read[n] for n in POSITION]), turned)


def _as_read(data: Dataset) -> Dataset:
    """The dataset with what was read as its poses, also where that was in the frames of several stations."""
    if not any(data.readings.stations):
        return data
    columns = data.readings.columns
    wxyz = np.column_stack([columns[n] for n in ORIENTATION]) if "qw" in columns else None
    return replace(data, position=np.column_stack([columns[n] for n in POSITION]), orientation=wxyz, readings=POSES)


@contextmanager
def _warned_once(number: int) -> Iterator[None]:
    """Give each warning of a model's fits once, with the model's number: models reject different rows."""
    with unheard(), noted() as texts:
        yield
    for text in dict.fromkeys(texts):
        warn(f"model {number}: {text}")


def within_tracks(robot: Chain, dataset: Dataset) -> npt.NDArray[np.bool_]:
    """(N,) the poses whose commands lie in the measured range of all carts; all of them where no cart was measured."""
    if dataset.carts is None:
        return np.ones(len(dataset), dtype=bool)
    return ~model_geometry(4, robot, dataset).outside(dataset.q)
