"""The first step of a diagnosis: choose the usable rows and columns, and calibrate with them."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.checks.before_fit import prepared
from gtpin.calibration.checks.payload import MISREAD
from gtpin.calibration.checks.prior_conflict import PLACES
from gtpin.calibration.problem import with_free_target
from gtpin.calibration.result import Calibration
from gtpin.calibration.robust_fit import Progress
from gtpin.data import Dataset
from gtpin.data.files import warn_of
from gtpin.data.plausible import sane_rows
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.errors import DatasetError, withdraw
from gtpin.instruments.readings import Readings, single
from gtpin.model.model import Model
from gtpin.robot.chain import Chain
from gtpin.robot.geometry import Geometry

_NEVER_CONSTANT = re.compile(r"approach[0-9]+|time|temp_.*")
"""Columns that vary wherever they are recorded: a constant is a default value."""
_OF_PLACES = ("frame", *(key for keys in PLACES.values() for key in keys))
"""What a calibration may find other than declared of where an instrument stands."""
_SPEED = re.compile(r"speed[0-9]+")
"""A speed of 0 everywhere says that the machine stood still. Any other recorded speed varies in the last digit."""


@dataclass(frozen=True)
class Prepared:
    """The data that a diagnosis can use, and their calibration.

    ``recorded``: all rows, in the order of the file. ``dataset``: the usable rows and columns, in an order that does not depend
    on that of the file. ``declared``: declared sigma of each group of numbers, m or rad; None where none is declared, or where
    the data show less noise.
    """

    recorded: Dataset
    dataset: Dataset
    baseline: Calibration
    declared: tuple[float | None, ...]

    def undeclared(
        self, sigmas: Collection[str], nominal: Chain, progress: Progress | None, priors: Priors, *, widen: bool
    ) -> Prepared:
        """The same, with a calibration that estimates the sigmas of the instrument's keys ``sigmas``; ``declared`` stays.

        Takes back: the deferred warnings of the calibration with the declared sigmas that are not of these sigmas.
        """
        instrument = self.recorded.instrument.model_copy(update=dict.fromkeys(sigmas))
        again = prepare(replace(self.recorded, instrument=instrument), nominal, progress, priors, widen=widen)
        kept = again.baseline.warnings
        withdraw([t for t in self.baseline.warnings if t not in kept and not any(sigma in t for sigma in sigmas)])
        return replace(again, declared=self.declared)


def prepare(
    dataset: Dataset,
    nominal: Chain,
    progress: Progress | None = None,
    priors: Priors = PRIORS,
    *,
    widen: bool = True,
) -> Prepared:
    """Check a dataset against the nominal robot, leave out rows and columns that cannot be right, and calibrate the rest.

    ``widen``: whether tolerances that the data contradict are widened. Raises `GtpinError` if the data can't be those of this
    robot.
    """
    geometry = with_free_target(Geometry.nominal(nominal), dataset)
    recorded = prepared(dataset, Model(geometry))
    usable = without_frozen(
        without_contradictions(without_filled_in(recorded.take(sane_rows(recorded))), priors), priors
    )
    if dataset.readings.tracked:
        _check_size(usable, len(geometry.parameters) + (6 if usable.instrument.frame == "free" else 0))
    baseline = calibrate(usable, nominal, widen=widen, progress=progress)
    if any(MISREAD in text for text in baseline.warnings):  # it would load the wrong parts
        usable = usable.without(["payload"])
        warn_of(dataset.file, "payload is not used, for it looks misread")
    places = tuple(
        table.model_copy(update={key: getattr(fitted, key) for key in _OF_PLACES if hasattr(fitted, key)})
        for table, fitted in zip(usable.readings.tables, baseline.fit.problem.measured.rows.tables, strict=True)
    )
    usable = replace(usable, instrument=baseline.instrument, readings=replace(usable.readings, tables=places))
    own = single(usable, nominal).in_order()  # random draws of rows must not depend on the order of the file
    declared = Readings.of(own, baseline.model.robot).declared
    sigmas = zip(declared, baseline.noise.estimated, baseline.noise.sigma, strict=False)
    kept = (own if own is not None and (shown > own or not estimated) else None for own, estimated, shown in sigmas)
    return Prepared(recorded, own, baseline, tuple(kept))


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


def without_filled_in(dataset: Dataset) -> Dataset:
    """The dataset without constant columns that were probably filled in and not recorded: they count as missing.

    A constant that somebody filled in would exclude the effects of the column wrongly. Constant payloads, forces and sessions,
    and speeds of 0, are usual statements about a measurement, and are kept. Warns: names the columns.
    """
    filled = [
        name
        for name, values in dataset.covariates.items()
        if len(values) > 1 and (values == values[0]).all()
        if _NEVER_CONSTANT.fullmatch(name) or (_SPEED.fullmatch(name) and values[0] != 0.0)
    ]
    if not filled:
        return dataset
    warn_of(dataset.file, f"the same in every row, so taken as not recorded: {', '.join(filled)}")
    return dataset.without(filled)


def without_frozen(dataset: Dataset, priors: Priors = PRIORS) -> Dataset:
    """The dataset without temperatures that are constant to the last digit in a sequence of rows: they count as missing.

    A logger that repeats its last value, begins late or was read at another time gives such a sequence. Readings in coarse
    steps are not judged. Warns: names the columns and the rows.
    """
    order = np.argsort(dataset.covariates["time"], kind="stable") if "time" in dataset.covariates else slice(None)
    frozen = []
    for name in sorted(n for n in dataset.covariates if n.startswith("temp_")):
        values = np.asarray(dataset.covariates[name], dtype=float)[order]
        begins = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
        lengths = np.diff(begins, append=len(values))
        first, length = int(begins[lengths.argmax()]), int(lengths.max())  # the longest sequence of equal values
        others = np.delete(values, np.s_[first : first + length])
        if length < max(priors.fewest_moving, priors.frozen * len(values)) or not len(others):
            continue
        if len(np.unique(others)) < priors.distinct * len(others):
            continue
        frozen.append(name)
        lines = dataset.row[order][first : first + length]
        text = (
            f"{name} is {values[first]:g} in {length} rows one after the other (line {lines[0]} to line {lines[-1]}) and "
            "differs in all others: it was not read there, so that it is not used"
        )
        warn_of(dataset.file, text)
    return dataset.without(frozen) if frozen else dataset


def without_contradictions(dataset: Dataset, priors: Priors = PRIORS) -> Dataset:
    """The dataset without columns that can't be right; they count as missing.

    These are ``approach`` and ``speed`` of an actuator where the two contradict each other: a direction that belongs to other
    rows, or to another drive, makes backlash look like servo lag, and the reverse. And ``session`` where the sessions
    alternate both in the order of time and in that of the rows, or are too many or too short. Warns: names the columns.
    """
    wrong: list[str] = []
    for actuator in range(1, dataset.n_actuators + 1):
        names = (f"approach{actuator}", f"speed{actuator}")
        if any(name not in dataset.covariates for name in names):
            continue
        approach, speed = (np.asarray(dataset.covariates[name], dtype=float) for name in names)
        moving = speed != 0.0
        if moving.sum() < priors.fewest_moving:
            continue
        same = float((np.sign(speed[moving]) == approach[moving]).mean())
        if 1.0 - priors.agree < same < priors.agree:
            wrong += names
            text = f"{' and '.join(names)} contradict each other in {100.0 * (1.0 - same):.0f} % of the rows in motion"
            warn_of(
                dataset.file, f"{text}: one of them belongs to other rows or another drive, so that neither is used"
            )
    text = _too_many(dataset, priors)
    if not text and _interleaved(dataset, priors):
        text = "the column session is in order neither of time nor of the rows, so that it is not used"
    if text:
        wrong.append("session")
        warn_of(dataset.file, text)
    return dataset.without(wrong) if wrong else dataset


def _too_many(dataset: Dataset, priors: Priors) -> str:
    """Why the sessions can't be tested, because they are too many or too short; empty where they can."""
    if "session" not in dataset.covariates:
        return ""
    count, rows = len(set(map(str, dataset.covariates["session"]))), len(dataset)
    hint = "give rows without a new set-up in between the same session, and the time of each row in a column time"
    if count == rows > 1:
        return f"every row has its own session: looks like a time, so that the column session is not used; {hint}"
    if count > min(priors.most_sessions, rows / priors.session_rows):
        most = f"up to {priors.most_sessions} sessions of {priors.session_rows:g} rows or more on average can be tested"
        return f"{count} sessions in {rows} rows: {most}, so that the column session is not used; {hint}"
    return ""


def _interleaved(dataset: Dataset, priors: Priors) -> bool:
    """Whether sessions alternate, both in the order of the file and in the order of time; False without a column ``time``."""
    if "session" not in dataset.covariates or "time" not in dataset.covariates:
        return False
    names, session = np.unique(dataset.covariates["session"].astype(str), return_inverse=True)
    least = max(len(names) - 1, 1)
    orders = (np.argsort(dataset.row, kind="stable"), np.argsort(dataset.covariates["time"], kind="stable"))
    changes = [int((np.diff(session[order]) != 0).sum()) for order in orders]
    return len(names) > 1 and min(changes) > max(priors.interleaved * least, priors.fewest_moving)
