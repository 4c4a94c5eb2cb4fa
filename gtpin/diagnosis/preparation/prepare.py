"""The first step of a diagnosis: choose the usable rows and columns, and calibrate with them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.calibrate_readings import with_positions
from gtpin.calibration.checks.prepared import prepared
from gtpin.calibration.free_target import with_free_target
from gtpin.calibration.readings_result import ReadingsCalibration
from gtpin.calibration.result import Calibration
from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset
from gtpin.data.duplicates import counted_once
from gtpin.data.extremes import check_extremes
from gtpin.data.sane import sane_rows
from gtpin.diagnosis.preparation.contradictions import without_contradictions
from gtpin.diagnosis.preparation.filled_in import without_filled_in
from gtpin.diagnosis.preparation.frozen import without_frozen
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.errors import DatasetError
from gtpin.instruments.readings import Readings, single
from gtpin.model.model import Model
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot


@dataclass(frozen=True)
class Prepared:
    """The data that a diagnosis can use, and their calibration.

    Parameters
    ----------
    recorded
        All rows, in the order of the file.
    dataset
        The usable rows and columns, in an order that does not depend on the order of the file.
    baseline
        The calibration of ``dataset``.
    declared
        Declared sigma of each group of numbers, m or rad; None where none is declared, or where the data show less noise.
    """

    recorded: Dataset
    dataset: Dataset
    baseline: Calibration
    declared: tuple[float | None, ...]

    def undeclared(
        self, sigmas: Collection[str], nominal: Robot, progress: Progress | None, priors: Priors
    ) -> Prepared:
        """The same, with a calibration that estimates the sigmas of the instrument's keys ``sigmas``; ``declared`` stays."""
        instrument = self.recorded.instrument.model_copy(update=dict.fromkeys(sigmas))
        again = prepare(replace(self.recorded, instrument=instrument), nominal, progress, priors)
        return replace(again, declared=self.declared)


def prepare(dataset: Dataset, nominal: Robot, progress: Progress | None = None, priors: Priors = PRIORS) -> Prepared:
    """Check a dataset against the nominal robot, leave out rows and columns that cannot be right, and calibrate the rest.

    Raises
    ------
    GtpinError
        If the data can't be those of this robot.
    """
    if dataset.readings is not None:
        return _prepared_readings(dataset, nominal, progress, priors)
    geometry = with_free_target(Geometry.nominal(nominal), dataset)
    recorded = prepared(dataset, Model(geometry))
    usable = without_frozen(
        without_contradictions(without_filled_in(recorded.take(sane_rows(recorded))), priors), priors
    )
    _check_size(usable, len(geometry.parameters) + (6 if usable.instrument.frame == "free" else 0))
    baseline = calibrate(usable, nominal, progress=progress)
    # Random draws of rows must not depend on the order of the file.
    instrument = baseline.instrument
    turning = (instrument.orientation_sigma,) if usable.orientation is not None else ()
    dataset = replace(usable, instrument=instrument).in_order()
    return Prepared(recorded, dataset, baseline, (instrument.position_sigma, *turning))


def _check_size(dataset: Dataset, parameters: int) -> None:
    """Raise `DatasetError` unless there are more measured numbers than parameters: a geometry could fit any error.

    A calibration needs fewer: it has the tolerances. A verdict would only say what they are.
    """
    components = 3 if dataset.orientation is None else 6
    if len(dataset) * components <= parameters:
        raise DatasetError(
            f"{len(dataset)} usable rows give {len(dataset) * components} numbers for {parameters} parameters of the geometry",
            file=dataset.file,
            hint=f"for a diagnosis, measure at least {parameters // components + 1} poses",
        )


def _prepared_readings(dataset: Dataset, nominal: Robot, progress: Progress | None, priors: Priors) -> Prepared:
    """As :func:`prepare`, for readings of several instruments."""
    check_extremes(dataset)
    recorded = counted_once(with_positions(dataset, nominal))
    usable = without_frozen(
        without_contradictions(without_filled_in(recorded.take(sane_rows(recorded))), priors), priors
    )
    baseline = calibrate(usable, nominal, progress=progress)
    own = single(usable, nominal).in_order()
    assert isinstance(baseline, ReadingsCalibration)
    sigmas = zip(Readings.of(own, baseline.model.robot).declared, baseline.noise.estimated, strict=True)
    return Prepared(recorded, own, baseline, tuple(None if estimated else sigma for sigma, estimated in sigmas))
