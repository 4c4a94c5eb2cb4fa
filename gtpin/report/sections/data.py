"""The data: what was measured, what was set aside, and the ranges of all columns."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from gtpin.calibration.problem import measured_poses
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.data.names import lookalikes
from gtpin.diagnosis.gap import BLOCK_POSES, PREDICTED_POSES
from gtpin.diagnosis.result import Diagnosis, Gap
from gtpin.report.calibration_text import cannot_judge, noise_words, repeatability_words, scatters
from gtpin.report.fit import FitPresentation
from gtpin.report.page import Block, Fold, Heading, Section, Table
from gtpin.report.residuals import columns_of
from gtpin.report.words import counted, covariate_unit, joined, length, number_word, quantity, whole, with_unit

ALIKE = 0.02
"""Largest relative difference of two noise floors that count as equal."""


def data(r: FitPresentation) -> Section:
    """Facts about the data, the poses that were set aside, and ranges; of a diagnosis, how its gap is computed."""
    c, d = r.calibration, r.diagnosis
    why = cannot_judge(c)
    judged = f"it can't judge the fit: {why}" if why else f"1 ± {np.sqrt(2.0 / c.dof):.2f} if it fits"
    fitted = [f"{quantity(one.after, one.unit)} ({one.what})" for one in c.by_instrument]
    fit = (
        f"Chi-square per degree of freedom of geometry alone: {c.chi2_per_dof:.2f} ({judged}); degrees of freedom "
        f"{c.dof:.1f}, iterations {c.iterations}. Errors on the fitted poses, RMS: {joined(fitted)}."
    )
    rows, measured = r.dataset.readings, "Only positions were measured."
    if rows.names:
        counts = [f"{one.name}: {(rows.of == i).sum()} ({one.kind})" for i, one in enumerate(rows.tables)]
        measured = f"Readings by instrument: {joined(counts)}."
    elif r.dataset.orientation is not None:
        measured = "Position and orientation were measured."
    facts = [_counts(r.dataset), measured, _noise(c), scatters(c), fit]
    content: list[Block] = [fact for fact in facts if fact]
    alike = lookalikes(r.dataset.covariates).items()
    content += [f"No effect uses the column {name}: is {known} meant?" for name, known in alike]
    aside = _set_aside(r.dataset, c, c.rejected_rows if d is None else d.set_aside_rows)
    if aside.rows:
        about = "These poses were not used. Off by: distance from the prediction of the calibrated geometry."
        content += [Heading("Set aside"), about, aside]
    else:
        content.append("No pose was set aside.")
    content.append(Fold("Ranges of commands and covariates", [_ranges(r)]))
    if d is not None:
        content.append(f"The gap is computed on poses that were not fitted: {gap_method(d.gap)}.{_two_floors(d)}")
    return Section("data", "Data", content)


def _counts(dataset: Dataset) -> str:
    """Numbers of measurements, poses and repeated visits.

    A row repeats another one with the same commands and, for readings, of the same instrument, station or target.
    """
    visits = len(np.unique(dataset.visits))
    repeats = len(dataset) - len(np.unique(np.column_stack([dataset.readings.read, dataset.visits]), axis=0))
    none = "none visited twice: repeatability can't be distinguished from errors of the geometry"
    more = counted(repeats, "repeated visit") if repeats else none
    return f"{counted(len(dataset), 'measurement')} of {counted(visits, 'pose')}, {more}."


def _noise(c: Calibration) -> str:
    facts, how = noise_words(c), "the residuals" if c.noise.source == "residuals" else "repeated visits"
    if c.noise.repeatability > 0.0:
        facts.append(f"repeatability of each actuator, from {how}: {repeatability_words(c)}")
    if np.isfinite(c.freedom):
        facts.append(f"its tails are heavier than Gaussian ({c.freedom:.0f} degrees of freedom)")
    return f"Noise of the instruments, 1 sigma of a number: {'; '.join(facts)}."


def _set_aside(dataset: Dataset, c: Calibration, aside: Collection[int]) -> Table:
    """The rows that were set aside, by their distance from the calibrated geometry."""
    rows = np.flatnonzero(np.isin(dataset.row, list(aside)))
    if not len(rows):
        return Table((), [])
    some, cells = dataset.take(rows), []
    if some.readings.names:
        for i, pose in enumerate(some.pose):
            file, line = some.readings.place(i)
            cells.append([str(pose), str(line), file.name if file else ""])
        return Table(("pose", "line", "file"), cells, (1, 2))
    off = np.linalg.norm(measured_poses(some).residual_at(c.model.predict(some.q))[:, :3], axis=1)
    for i in np.argsort(-np.nan_to_num(off, nan=np.inf), kind="stable"):
        far = length(off[i]) if np.isfinite(off[i]) else "can't be reached"
        cells.append([str(some.pose[i]), str(some.row[i]), far])
    return Table(("pose", "line", "off by"), cells, (1, 2))


def _ranges(r: FitPresentation) -> Table:
    rows = []
    for name, values in columns_of(r.dataset).items():
        if name == "session":
            sessions = dict.fromkeys(str(v) for v in values)
            rows.append(["session", counted(len(sessions), "session"), ", ".join(sessions)])
        else:
            low, high = whole(f"{values.min():.4g}"), whole(f"{values.max():.4g}")
            label = with_unit(name, covariate_unit(name, r.calibration.model.robot))
            rows.append([label, low, "does not vary" if values.min() == values.max() else high])
    return Table(("column", "from", "to"), rows, (1, 2))


def _two_floors(d: Diagnosis) -> str:
    """A sentence where the noise floor is not that of the calibration: repeated visits differ by less without the causes."""
    calibrated = None if d.gap.by_instrument else d.baseline.to_json()["position_noise_floor"]
    if calibrated is None or abs(calibrated / d.gap.floor - 1.0) < ALIKE:
        return ""
    return (
        f" Noise alone is {length(d.gap.floor)}, as left-out poses show it given the causes; the calibration counts "
        f"{length(calibrated)} as noise."
    )


def gap_method(gap: Gap) -> str:
    """How the gap on left-out poses was computed, in words."""
    left_out = {
        "region": f"{number_word(BLOCK_POSES)} neighbouring poses",
        "session": f"each of {gap.blocks} sessions",
        "time": f"each of {gap.blocks} stretches of time",
        "random": f"{number_word(BLOCK_POSES)} poses drawn at random",
    }
    fitted = "by the uncertainty of what was fitted"
    other = f"what {PREDICTED_POSES} other poses may show, {fitted}"
    if gap.hold_out == "session":
        other = f"what another session may show, {fitted} and how much the {gap.blocks} differ"
    if gap.sessions < 2:
        other += "; the data are of one session, as far as is known, so that the interval ignores changes between days"
    return f"{left_out[gap.hold_out]} left out in turn; interval: {other}"
