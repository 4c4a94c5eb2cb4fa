"""The path of a calibration from readings of any instruments: which rows can be used, and what is checked around the fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.declared_noise import settled_or_explained, with_credible_noise
from gtpin.calibration.checks.readable_readings import (
    VARIATION,
    Misfit,
    check_fitted,
    check_heights,
    check_readable,
    check_sockets,
    explained,
)
from gtpin.calibration.checks.suspected import MISFIT, STRAYED, far_from_declared, refuse, warn_of_strayed
from gtpin.calibration.checks.usable_rows import check_moved, reach_of
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.observability import UNSEEN
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data import Dataset, check_commands
from gtpin.data.files import warn_of
from gtpin.data.plausible import named_poses
from gtpin.data.sane import sane_rows
from gtpin.distributions import chi2
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.typing import Mask

MOST = 0.5
"""Largest share of gross errors among an instrument's rows; above it, it is not clear which rows are the errors. Assumed."""
SEVERAL = 3
"""Fewest readings of one id for a message that most of them were set aside. Assumed."""
CHANCE = 1e-6
"""Probability, by the tolerances, of a geometry that is at least as far from nominal as a whole, below which something is
declared wrongly. Assumed."""


def usable_readings(given: Dataset, nominal: Model) -> tuple[Dataset, Mask, Dataset, Poses]:
    """The dataset with equally many numbers in each row; (N,) the rows whose commands the robot reaches; these rows, and their
    nominal poses, base frame.

    ``nominal``: with the passive joints measured that encoders read.
    """
    robot = nominal.robot
    check_sockets(given, robot)
    whole = single(given, robot)
    check_commands(given, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
    poses = nominal.kinematics.forward(whole.q)
    usable = sane_rows(whole)
    countable = "for numbers that are too large to count with", "no reading that can be counted with"
    reached = "for the robot can't reach them", "the robot reaches none of these commands"
    for good, (why, what), hint in (
        (whole.readings.countable, countable, "check the tables' units"),
        (poses.reached, reached, "check q1 .. qn"),
    ):
        if (usable & ~good).any():
            warn(f"set aside, {why}: {named_poses(whole, usable & ~good)}")
        usable &= good
        if not usable.any():
            raise DatasetError(what, file=whole.file, hint=hint)
    return whole, usable, whole.take(usable), poses[usable]


def settled_readings(given: Dataset, kept: Dataset, fit: RobustFit) -> FitState:
    """Run the robust fit of the rows that are ``kept`` with its checks.

    Raises `DatasetError` if the readings can't be those of this robot. `ConvergenceError` if the fit does not converge.
    Warns: names poses whose rows are rejected, and warns of residuals and values that are larger than expected.
    """
    readings, near, reach = fit.whole.measured, fit.near, reach_of(fit.whole.start.geometry)

    def misfit(some: Readings, index: int, rough: bool = False) -> Misfit | None:
        tried = replace(fit, whole=replace(fit.whole, measured=some))
        try:
            other = tried.rough() if rough else tried.run().fit
        except ConvergenceError:
            return None
        return Misfit.of(other.problem.readings(other.point.x), other.point.poses, index)

    check_readable(given, readings, near, reach, misfit)
    with explained(readings, near):
        settled = with_credible_noise(fit, settled_or_explained(fit))[1]
    if settled.scale > MISFIT or _as_large_as_heights(settled):
        check_heights(given, readings, near, reach, misfit)
    _check_used(kept, readings, settled.used)
    fitted = settled.fit.problem.readings(settled.fit.point.x)
    before = [Misfit.of(readings, near, i) for i in range(len(readings.instruments))]
    check_fitted(given, fitted, settled.fit.point.poses, reach, before)
    if settled.scale > MISFIT:
        scale = f"residuals are {settled.scale:.0f} times the noise"
        warn(f"{scale}: the geometry does not explain these data, or the declared sigma is too small")
    check_moved(given, settled.fit.point.model.geometry, fit.whole.start.geometry, near, fit.found)
    _warn_of_strayed(settled, fitted)
    return settled


def _as_large_as_heights(settled: FitState) -> bool:
    """Whether errors of touches that are left are of the size by which their heights vary, and the noise was not declared."""
    if not settled.noise.estimated.any():
        return False
    readings = settled.fit.problem.readings(settled.fit.point.x)
    heights = readings.rows.columns.get("height")
    if heights is None:
        return False
    own, left = np.isfinite(np.asarray(heights, dtype=float)), readings.residual_at(settled.fit.point.poses)[:, 0]
    return bool(own.any() and np.std(left[own]) > VARIATION * np.std(heights[own]))


def _check_used(kept: Dataset, readings: Readings, used: Mask) -> None:
    """Refuse an instrument with most of its rows set aside; warn of others, and of a station, plane, socket or target."""
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        share = float((~used[mine]).mean()) if mine.any() else 0.0
        if share > MOST:
            error = DatasetError(
                f"{100.0 * share:.0f} % of the readings of {one.name} do not fit the others",
                file=readings.rows.files[i],
                hint="check its units, its rows' commands, and where it stood",
            )
            refuse(error, kept)
    for i in range(len(readings.instruments)):
        for text in _off_together(readings, used, i):
            warn_of(readings.rows.files[i], text)
    if not used.all():
        warn(f"set aside as gross errors: {named_poses(kept, ~used)}")


def _off_together(readings: Readings, used: Mask, index: int) -> Iterator[str]:
    """Texts for warnings: ids of an instrument of which most readings were set aside."""
    rows = readings.rows
    mine = rows.rows_of(index)
    for column in rows.tables[index].ids:
        if len(rows.known[index].get(column, ())) < 2:
            continue
        ids = rows.columns[column][mine]
        for name in rows.known[index][column]:
            own = np.unique(rows.line[mine[ids == name]])
            lost = np.unique(rows.line[mine[(ids == name) & ~used[mine]]])
            if len(own) >= SEVERAL and len(lost) > MOST * len(own):
                of = f"{rows.tables[index].name} with {column} {name}"
                yield (
                    f"{len(lost)} of {len(own)} readings of {of} do not fit the others: check what dataset.toml declares "
                    "of it, and these rows"
                )


def _warn_of_strayed(settled: FitState, readings: Readings) -> None:
    """Warn of parameters and fitted unknowns that are farther from what is declared than their priors allow."""
    x, seen = settled.fit.point.x[: settled.fit.problem.n_geometry], settled.observability
    # Along a direction with the variance reduction l, the estimate has the variance l, in units of the squared tolerances.
    known = seen.variance_reduction > UNSEEN
    along = seen.directions[:, known].T @ x
    chance = chi2.sf(float((along**2 / seen.variance_reduction[known]).sum()), max(int(known.sum()), 1))
    if not warn_of_strayed(settled) and chance < CHANCE:
        text = f"the geometry as a whole is farther from nominal than its tolerances allow (chance {chance:.1g})"
        hint = "check commands, known distances, and what is declared of the instruments, or give larger tolerances"
        warn(f"{text}: {hint}; an effect that the geometry takes up may do this as well")
    if names := far_from_declared(readings.deviation, [unknown.name for unknown in readings.unknowns]):
        hint = "correct what it declares, or give larger prior sigmas"
        warn(f"unknowns more than {STRAYED:g} prior sigmas from what dataset.toml declares: {names}: {hint}")
