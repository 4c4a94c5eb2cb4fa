"""The path of a calibration from readings of any instruments: which rows can be used, and what is checked around the fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtpin.calibration.checks.declared_noise import settled_or_explained, with_credible_noise
from gtpin.calibration.checks.readable_readings import (
    Misfit,
    check_distances,
    check_fitted,
    check_readable,
    check_sockets,
    explained,
)
from gtpin.calibration.checks.suspected import refuse
from gtpin.calibration.checks.usable_rows import reach_of
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.observability import UNSEEN, Observability
from gtpin.calibration.problem import Problem, with_unknowns
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data import Dataset, check_commands
from gtpin.data.files import warn_of
from gtpin.data.sane import sane_rows
from gtpin.distributions import chi2
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.typing import Floats, Mask

MISFIT = 10.0
"""Size of the residuals, in units of the noise, from which there is a warning."""
MOST = 0.5
"""Largest share of gross errors among an instrument's rows; above it, it is not clear which rows are the errors. Assumed."""
SEVERAL = 3
"""Fewest readings of one id for a message that most of them were set aside. Assumed."""
SHOWN = 10
"""Largest number of poses that a warning names."""
STRAYED = 6.0
"""Deviation of a parameter from nominal, in units of the tolerances, and of an unknown from what is declared, in prior
sigmas, that is worth a warning. Assumed."""
CHANCE = 1e-6
"""Probability, by the tolerances, of a geometry that is at least as far from nominal as a whole, below which something is
declared wrongly. Assumed."""
NAMED = 5
"""Largest number of parameters that a warning names."""


@dataclass(frozen=True)
class ReadingChecks:
    """The checks of readings of any instruments; ``nominal``: with the passive joints measured that encoders read."""

    given: Dataset
    nominal: Model

    @cached_property
    def whole(self) -> Dataset:
        """The dataset with equally many numbers in each row."""
        robot = self.nominal.robot
        check_sockets(self.given, robot)
        return single(self.given, robot)

    @cached_property
    def rows(self) -> tuple[Mask, Dataset, Poses]:
        """(N,) the rows whose commands the robot reaches, these rows, and their nominal poses, base frame."""
        whole, robot = self.whole, self.nominal.robot
        check_commands(self.given, names=robot.sites, lower=robot.lower, upper=robot.upper, revolute=robot.revolute)
        poses = self.nominal.kinematics.forward(whole.q)
        usable = sane_rows(whole)
        for good, why, what, hint in (
            (whole.readings.countable, "for numbers that are too large to count with", *_UNCOUNTABLE),
            (poses.reached, "for the robot can't reach them", *_UNREACHED),
        ):
            if (usable & ~good).any():
                warn(f"set aside, {why}: {_poses_of(whole, usable & ~good)}")
            usable &= good
            if not usable.any():
                raise DatasetError(what, file=whole.file, hint=hint)
        return usable, whole.take(usable), poses[usable]

    @property
    def problem(self) -> Problem:
        """The problem about the nominal machine, with the unknowns' values that fit it best."""
        _, kept, near = self.rows
        readings = Readings.of(kept, self.nominal.robot)
        readings, c = readings.at(readings.start(near)), readings.components
        free = int((~np.isfinite(readings.sigma)).sum())
        if len(kept) * c <= free:
            what = f"{len(kept) * c} readings for {free} unknowns of the instruments alone"
            raise DatasetError(what, file=self.given.file, hint="measure more")
        check_distances(self.given, readings, near, reach_of(self.nominal.geometry))
        whitening = np.broadcast_to(np.eye(c), (len(kept), c, c))
        return Problem(self.nominal, with_unknowns(readings, near), whitening)

    def settled(self, fit: RobustFit) -> FitState:
        """Run the robust fit with its checks.

        Raises `DatasetError` if the readings can't be those of this robot. `ConvergenceError` if the fit does not converge.
        Warns: names poses whose rows are rejected, and warns of residuals and values that are larger than expected.
        """
        (_, kept, near), reach = self.rows, reach_of(self.nominal.geometry)
        readings = fit.whole.measured

        def misfit(some: Readings, index: int, rough: bool = False) -> Misfit | None:
            tried = replace(fit, whole=replace(fit.whole, measured=some))
            try:
                other = tried.rough() if rough else tried.run().fit
            except ConvergenceError:
                return None
            return Misfit.of(other.problem.readings(other.point.x), other.point.poses, index)

        check_readable(self.given, readings, near, reach, misfit)
        with explained(readings, near):
            settled = with_credible_noise(fit, settled_or_explained(fit))[1]
        _check_used(kept, readings, settled.used)
        fitted = settled.fit.problem.readings(settled.fit.point.x)
        check_fitted(self.given, fitted, settled.fit.point.poses, reach)
        if settled.scale > MISFIT:
            scale = f"residuals are {settled.scale:.0f} times the noise"
            warn(f"{scale}: the geometry does not explain these data, or the declared sigma is too small")
        _warn_of_strayed(settled, fitted)
        return settled


_UNCOUNTABLE = ("no reading that can be counted with", "check the tables' units")
_UNREACHED = ("the robot reaches none of these commands", "check q1 .. qn")


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
        warn(f"set aside as gross errors: {_poses_of(kept, ~used)}")


def _poses_of(dataset: Dataset, rows: Mask) -> str:
    """Text for a message with the names of the first poses."""
    names = dataset.names_of(rows)
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"poses {', '.join(names[:SHOWN])}{more}"


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
    x, geometry, seen = settled.fit.point.x[: settled.fit.problem.n_geometry], settled.geometry, settled.observability
    if names := _far(x, geometry.names):
        warn(f"parameters more than {STRAYED:g} tolerances from nominal: {names}")
    elif (chance := _whole_chance(x, seen)) < CHANCE:
        text = f"the geometry as a whole is farther from nominal than its tolerances allow (chance {chance:.1g})"
        hint = "check commands, known distances, and what is declared of the instruments, or give larger tolerances"
        warn(f"{text}: {hint}; an effect that the geometry takes up may do this as well")
    names = _far(readings.deviation, [unknown.name for unknown in readings.unknowns])
    if names:
        hint = "correct what it declares, or give larger prior sigmas"
        warn(f"unknowns more than {STRAYED:g} prior sigmas from what dataset.toml declares: {names}: {hint}")


def _whole_chance(x: Floats, seen: Observability) -> float:
    """Probability, by chi-square, of deviations from nominal at least as large as x (p,), in units of the tolerances."""
    # Along a direction with the variance reduction l, the estimate has the variance l, in units of the squared tolerances.
    told = seen.variance_reduction > UNSEEN
    along = seen.directions[:, told].T @ x
    return float(chi2.sf(float((along**2 / seen.variance_reduction[told]).sum()), max(int(told.sum()), 1)))


def _far(values: Floats, names: list[str] | tuple[str, ...]) -> str:
    """Names and values of those that are far from 0, the farthest first."""
    far = np.flatnonzero(np.abs(values) > STRAYED)
    order = far[np.argsort(-np.abs(values[far]))]
    more = f" and {len(order) - NAMED} more" if len(order) > NAMED else ""
    return ", ".join(f"{names[i]} ({values[i]:+.0f})" for i in order[:NAMED]) + more
