"""Models 1 to 5, each fitted to one half of a dataset and compared by the errors on the other: the paper's Table I for any
dataset, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.calibrate import calibrate_geometry, without_sigmas
from gtpin.data import Dataset, random
from gtpin.data.instrument_rows import POSES
from gtpin.data.names import ORIENTATION, POSITION
from gtpin.data.plausible import counted_once
from gtpin.errors import DatasetError, ModelError, UnreachableError, check_kind, noted, unheard, warn
from gtpin.instruments.predicted import predicted_readings
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import from_quaternions, log, zyz_change
from gtpin.model.measured_robot import robot_of
from gtpin.model.model import Model
from gtpin.output.shown import SavedResult, present
from gtpin.paper.models import MEASURED, MODELS, model_geometry
from gtpin.read_only import gives_read_only
from gtpin.real import generator
from gtpin.robot.chain import Chain
from gtpin.threads import in_one_thread
from gtpin.typing import Floats

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure

RESAMPLES = 2000
"""Number of bootstrap samples for each interval."""


@dataclass(frozen=True)
class Held:
    """One model's errors on held-out poses.

    - ``model``: 1 to 5.
    - ``pose``: (N,) ids of the held-out poses.
    - ``position``: (N,) length of each position error, m.
    - ``orientation``: (N,) angle of each orientation error, rad; None where orientation was not measured.
    - ``angles``: (N, 3) measured less predicted ZYZ Euler angles, rad; None where orientation was not measured.
    """

    model: int
    pose: npt.NDArray[np.object_]
    position: Floats
    orientation: Floats | None
    angles: Floats | None

    @staticmethod
    def of(model: int, measured: Dataset, poses: Poses) -> Held:
        """The errors of a model that predicts ``poses`` (N) in place of those measured, both in the instrument's frame."""
        position = np.linalg.norm(measured.position - poses.T, axis=1)
        if measured.orientation is None:
            return Held(model, measured.pose, position, None, None)
        R = from_quaternions(measured.orientation)
        turned = np.linalg.norm(log(R @ np.swapaxes(poses.R, 1, 2)), axis=1)
        return Held(model, measured.pose, position, turned, zyz_change(R, poses.R))

    def figures(self, rows: npt.NDArray[np.intp] | slice = slice(None)) -> dict[str, float | None]:
        """Mean, largest and root mean square error of the poses ``rows``; the keys' last part is the unit (um, mrad)."""
        p = self.position[rows] * 1e6
        o = None if self.orientation is None else float(np.sqrt((self.orientation[rows] ** 2).mean()) * 1e3)
        return {
            "mean_um": float(p.mean()),
            "max_um": float(p.max()),
            "rms_um": float(np.sqrt((p**2).mean())),
            "orientation_rms_mrad": o,
        }

    def intervals(self, seed: int) -> dict[str, tuple[float, float] | None]:
        """95 % bootstrap intervals of :meth:`figures`; all visits to a pose are drawn together.

        The interval of the largest error ends at the largest observed error: resampling can't show poses that were not visited.
        """
        rng = generator(seed)
        names, visit = np.unique(self.pose.astype(str), return_inverse=True)
        samples = []
        for _ in range(RESAMPLES):
            times = np.bincount(rng.integers(0, len(names), len(names)), minlength=len(names))
            samples.append(self.figures(np.repeat(np.arange(len(visit)), times[visit])))
        return {name: _interval([sample[name] for sample in samples]) for name in samples[0]}


def _interval(values: Sequence[float | None]) -> tuple[float, float] | None:
    if values[0] is None:
        return None
    low, high = np.percentile(np.array(values, dtype=float), (2.5, 97.5))
    return float(low), float(high)


@dataclass(frozen=True, repr=False)
class Comparison(SavedResult):
    """The models that the dataset allows, side by side.

    Parameters
    ----------
    held
        The errors of each model, in the order of the models.
    seed
        Seed of the division into halves and of the bootstrap.
    dataset
        The data.
    warnings
        Texts of all warnings, also of those when the dataset was read.
    """

    held: tuple[Held, ...]
    seed: int
    dataset: Dataset
    warnings: tuple[str, ...] = ()

    def table(self) -> pd.DataFrame:
        """``model, mean_um, max_um, rms_um, orientation_rms_mrad, poses``, one row per model."""
        import pandas as pd

        return pd.DataFrame([{"model": h.model, **h.figures(), "poses": len(h.position)} for h in self.held])

    def intervals(self) -> list[dict[str, tuple[float, float] | None]]:
        """95 % bootstrap intervals of the errors in :meth:`table`, one entry per model."""
        return list(self._intervals)

    @cached_property
    def _intervals(self) -> list[dict[str, tuple[float, float] | None]]:
        return [held.intervals(self.seed) for held in self.held]

    def to_json(self) -> dict[str, Any]:
        """The content of ``compare.json``."""
        rows = [
            {
                "model": held.model,
                **held.figures(),
                "poses": len(held.position),
                "interval": {name: None if ends is None else list(ends) for name, ends in interval.items()},
            }
            for held, interval in zip(self.held, self.intervals(), strict=True)
        ]
        return {"schema": "gtpin-compare/1", "seed": self.seed, "models": rows, "warnings": list(self.warnings)}

    def plot_errors(self) -> Figure:
        """Mean, root mean square and largest position error of each model, with 95 % intervals."""
        figure: Figure = present(self).errors()
        return figure

    def plot_angles(self, angle: str = "alpha") -> Figure:
        """Plot the errors of an Euler angle (ZYZ: ``alpha``, ``beta`` or ``gamma``) at each held-out pose."""
        figure: Figure = present(self).angles(angle)
        return figure


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
