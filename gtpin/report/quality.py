"""Quality of the data: what was measured, noise, ranges, rejected poses."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from gtpin.calibration.problem import measured_poses
from gtpin.calibration.result import Calibration, InstrumentFit
from gtpin.data import Dataset
from gtpin.data.names import lookalikes
from gtpin.report.page import Table
from gtpin.report.words import counted, covariate_unit, joined, length, quantity, whole, with_unit

SOURCES = {"declared": "as declared", "repeats": "from repeated visits", "residuals": "from the residuals"}


SCATTERS = 0.5
"""Ratio of repeatability to the instrument's sigma above which it may contain an effect."""


@dataclass(frozen=True)
class Quality:
    """Facts about the data, the ranges of their columns, and the poses that were set aside."""

    facts: tuple[str, ...]
    ranges: Table
    set_aside: Table


def quality(dataset: Dataset, calibration: Calibration, aside: Collection[int] | None = None) -> Quality:
    """The quality of a dataset, from its calibration; ``aside``: line numbers of rejected rows, by default the
    calibration's."""
    visits = len(np.unique(dataset.visits))
    repeats = len(dataset) - _distinct(dataset)
    facts = [
        f"{counted(len(dataset), 'measurement')} of {counted(visits, 'pose')}"
        + (
            f", {counted(repeats, 'repeated visit')}"
            if repeats
            else ", none visited twice: repeatability can't be distinguished from errors of the geometry"
        )
        + ".",
        _what_was_measured(dataset),
        _noise(calibration),
        scatters(calibration),
        _fit(calibration),
        *_misspelt(dataset),
    ]
    return Quality(
        tuple(fact for fact in facts if fact),
        _ranges(dataset),
        _set_aside(dataset, calibration, calibration.rejected_rows if aside is None else aside),
    )


def _distinct(dataset: Dataset) -> int:
    """Number of different rows: a row repeats another one with the same commands and, for readings, of the same instrument,
    station or target."""
    return len(np.unique(np.column_stack([dataset.readings.read, dataset.visits]), axis=0))


def _misspelt(dataset: Dataset) -> list[str]:
    """Columns that no effect uses, with names similar to known ones."""
    return [
        f"No effect uses the column {name}: is {known} meant?" for name, known in lookalikes(dataset.covariates).items()
    ]


def _what_was_measured(dataset: Dataset) -> str:
    rows = dataset.readings
    if rows.names:
        counts = [f"{one.name}: {(rows.of == i).sum()} ({one.kind})" for i, one in enumerate(rows.tables)]
        return f"Readings by instrument: {joined(counts)}."
    if dataset.orientation is not None:
        return "Position and orientation were measured."
    return "Only positions were measured."


def error_of(one: InstrumentFit) -> str:
    """What an error is of, in words: of a tracker's poses where nothing else was measured, else of the instrument."""
    return f"error of {one.name}" if one.name else {"m": "position error", "rad": "orientation error"}[one.unit]


def nominal_words(c: Calibration) -> str:
    """Errors of the nominal geometry, RMS, in words."""
    named = sum(bool(one.name) for one in c.by_instrument) > 1
    errors = [one for one in c.by_instrument if one.name or one.unit == "m"]
    return joined([f"{quantity(b.before, b.unit)}{f' ({b.name})' if named else ''}" for b in errors])


def _measured_by(c: Calibration) -> list[str]:
    """What each of the noise's sigmas is of."""
    several = {name for name, unit in c.sigmas if {unit} != {of for other, of in c.sigmas if other == name}}
    of_pose = {"m": "position", "rad": "orientation"}
    return [
        f"{name} ({of_pose[unit]})" if name in several and name else name or of_pose[unit] for name, unit in c.sigmas
    ]


def noise_words(c: Calibration) -> list[str]:
    """The sigma of each kind of numbers, in words, and where it comes from."""
    sigmas = zip(_measured_by(c), c.noise.sigma, c.sigmas, c.noise.estimated, strict=True)
    return [
        f"{what} {quantity(float(sigma), unit)}, {SOURCES[c.noise.source if estimated else 'declared']}"
        for what, sigma, (_, unit), estimated in sigmas
    ]


def _noise(c: Calibration) -> str:
    noise = c.noise
    text = f"Noise of the instruments, 1 sigma of a number: {'; '.join(noise_words(c))}"
    if noise.repeatability > 0.0:
        how = "from the residuals" if noise.source == "residuals" else "from repeated visits"
        text += f"; repeatability of each actuator, {how}: {length(noise.repeatability)}"
    if noise.lack > 0.0:
        text += f"; model error along single drives, correlated between neighbouring poses: {length(noise.lack)}"
    if np.isfinite(c.freedom):
        text += f"; its tails are heavier than Gaussian ({c.freedom:.0f} degrees of freedom)"
    return text + "."


def scatters(c: Calibration) -> str:
    """Warning that a large scatter of the drives may come from effects in part; empty if the scatter is small."""
    if c.noise.repeatability <= SCATTERS * c.noise.position_sigma:
        return ""
    return (
        f"Repeated visits scatter by {length(c.noise.repeatability)} at each actuator, which calibration counts as noise: "
        "backlash and other effects that vary between visits of one pose may be part of it. Diagnosis can test this if "
        "directions of approach and speeds were recorded."
    )


def cannot_judge(c: Calibration) -> str:
    """Why chi-square can't judge the fit of the geometry; empty if it can."""
    if c.dof < 1.0:
        return "there are too few measurements to judge the fit"
    if c.noise_known:
        return ""
    if not c.noise.estimated.all():
        taken, others = (
            joined([what for what, e in zip(_measured_by(c), c.noise.estimated, strict=True) if e == estimated])
            for estimated in (True, False)
        )
        return (
            f"the noise of {taken} was taken from these residuals, that of {others} was declared: above 1, residuals are "
            "larger than the declared noise"
        )
    if np.isfinite(c.freedom):
        return "the noise was taken from these residuals, and outliers have full weight here: this can't judge the fit"
    return "1 by construction: the noise was taken from these residuals, so this can't judge the fit"


def _fit(c: Calibration) -> str:
    meaning = cannot_judge(c) or f"1 ± {np.sqrt(2.0 / c.dof):.2f} if it fits"
    return f"Chi-square per degree of freedom of geometry alone: {c.chi2_per_dof:.2f} ({meaning})."


def _ranges(dataset: Dataset) -> Table:
    rows = []
    for j in range(dataset.n_actuators):
        rows.append(_range(f"q{j + 1}", dataset.q[:, j]))
    for name, values in dataset.covariates.items():
        if name == "session":
            sessions = dict.fromkeys(str(v) for v in values)
            rows.append(["session", counted(len(sessions), "session"), ", ".join(sessions)])
        else:
            rows.append(_range(name, np.asarray(values, dtype=float)))
    return Table(("column", "from", "to"), rows)


def _range(name: str, values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[str]:
    low, high = float(values.min()), float(values.max())
    label = with_unit(name, covariate_unit(name))
    return [label, whole(f"{low:.4g}"), "does not vary" if low == high else whole(f"{high:.4g}")]


def _set_aside(dataset: Dataset, c: Calibration, aside: Collection[int]) -> Table:
    """The rows that were set aside, by their distance from the calibrated geometry."""
    rows = np.flatnonzero(np.isin(dataset.row, list(aside)))
    head = ("pose", "line", "off by")
    if not len(rows):
        return Table(head, [])
    some = dataset.take(rows)
    if some.readings.names:
        places = [some.readings.place(i) for i in range(len(rows))]
        return Table(
            ("pose", "line", "file"),
            [[str(some.pose[i]), str(line), file.name if file else ""] for i, (file, line) in enumerate(places)],
        )
    off = np.linalg.norm(measured_poses(some).minus(c.model.predict(some.q))[:, :3], axis=1)
    order = np.argsort(-np.nan_to_num(off, nan=np.inf), kind="stable")
    return Table(
        head,
        [
            [str(some.pose[i]), str(some.row[i]), length(off[i]) if np.isfinite(off[i]) else "can't be reached"]
            for i in order
        ],
    )
