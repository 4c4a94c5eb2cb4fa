"""What geometry alone leaves of the measurements, and what the causes leave: the numbers behind a diagnosis's plots."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import in_frame, measured_poses
from gtpin.calibration.readings_result import ReadingsCalibration
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.data.names import command_names
from gtpin.effects.situation import Column, References, Situation
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.report.embedded import escaped

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

FINE, FINEST = 401, 1500
"""Points of a line along a column; the latter where a cause has a nonlinear parameter, which may be a short period."""
MOST = 20_000
"""Poses behind the plots; of more an even selection: a mean of neighbouring poses still comes from a thousand."""
AXES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class Residuals:
    """Measured less predicted of N poses that were used, or of an even selection where there are very many.

    Parameters
    ----------
    dataset
        The poses.
    used
        How many there are of which these are a selection.
    baseline, model
        Geometry alone, and with the causes.
    before, after
        (N, c) what each leaves: position, m, and rotation vector, rad, in the instrument's frame.
    sigma
        (c,) the instrument's noise; (N, c) of readings.
    readings
        Of a dataset of several instruments, what was read; None of poses.
    """

    dataset: Dataset
    used: int
    baseline: Model
    model: Model
    before: Floats
    after: Floats
    sigma: Floats
    readings: Readings | None = None

    @staticmethod
    def of(
        dataset: Dataset, baseline: Calibration, model: Model | None = None, aside: Collection[int] | None = None
    ) -> Residuals:
        """Of the rows that were not set aside.

        Parameters
        ----------
        model
            With the causes; the baseline's own where there are none.
        aside
            Lines of the rows that were; the baseline's by default.
        """
        lines = list(baseline.rejected_rows if aside is None else aside)
        if isinstance(baseline, ReadingsCalibration):
            return _of_readings(dataset, baseline, model, lines)
        rows = np.flatnonzero(~np.isin(dataset.row, lines))
        kept = dataset.take(rows[evenly(len(rows), MOST)])
        measured = measured_poses(kept if baseline.residual.shape[1] == 6 else replace(kept, orientation=None))
        before = measured.minus(baseline.model.predict(kept.q))
        after = before if model is None else measured.minus(model.predict(kept.q, kept.covariates))
        noise = baseline.noise
        sigma = np.array([noise.position_sigma] * 3 + [noise.orientation_sigma] * 3)
        return Residuals(
            kept, len(rows), baseline.model, model or baseline.model, before, after, sigma[: measured.components]
        )

    def __len__(self) -> int:
        return len(self.before)

    @cached_property
    def names(self) -> npt.NDArray[np.object_]:
        """(N,) ids of the poses, as plotly takes text."""
        return np.array([escaped(str(pose)) for pose in self.dataset.pose], dtype=object)

    @property
    def components(self) -> int:
        """Numbers a pose."""
        return int(self.before.shape[1])

    @cached_property
    def poses(self) -> Poses:
        """(N) the poses of the model's geometry, base frame."""
        return self.model.kinematics.forward(self.dataset.q)

    @cached_property
    def by_command(self) -> Floats:
        """(N, 6 + k, n) motion of the TCP, base frame, and of k measured joints by the commands."""
        return self.model.kinematics.command_jacobian(self.dataset.q, self.poses)

    @property
    def of_poses(self) -> bool:
        """Whether residuals are of poses, and not of readings of any instruments."""
        return self.readings is None

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the numbers that residuals have: axes of poses, or components of readings.

        Those of several instruments are ``wire``, where an instrument reads one number, or ``cup.x``, where it reads more.
        """
        return AXES[: self.components] if self.readings is None else tuple(self._read)

    @cached_property
    def _read(self) -> dict[str, tuple[Indices, int, str]]:
        """By the name of a component of readings: its rows, its column of the residuals, and its unit."""
        assert self.readings is not None
        instruments, rows = self.readings.instruments, self.readings.rows
        if len(instruments) == 1 and self.components == len(instruments[0].components):
            every = np.arange(len(self))
            return {c.name: (every, k, c.unit) for k, c in enumerate(instruments[0].components)}
        found = {}
        for i, one in enumerate(instruments):
            mine = rows.rows_of(i)
            for k, c in enumerate(one.components):
                split = self.components < len(one.components)
                own = mine[rows.component[mine] == k] if split else mine
                if len(own):
                    name = one.name if len(one.components) == 1 else f"{one.name}.{c.name}"
                    found[name] = (own, 0 if split else k, c.unit)
        return found

    def rows_of(self, name: str) -> Indices:
        """Rows that have a component: of several instruments those of the one that reads it."""
        return self._read[name][0] if self.readings is not None and name in self._read else np.arange(len(self))

    def at(self, q: Floats, covariates: Mapping[str, Column], fixed: References | None = None) -> Situation:
        """Commands and measurement conditions at the model's geometry."""
        kinematics = self.model.kinematics
        temperature = self.dataset.conditions.reference_temperature
        return Situation(kinematics, q, kinematics.forward(q), dict(covariates), fixed, temperature)

    def along(self, residual: Floats, motion: Floats) -> Floats:
        """(N,) how far a motion (N, 6 + k), for one unit of it, base frame, has to go to explain residuals (N, c) best."""
        if self.readings is None:
            u = in_frame(motion[:, :, None], self.model.frame)[:, : self.components, 0] / self.sigma
        else:
            u = self.readings.seen(motion[:, :, None], self.model, self.poses)[:, :, 0] / self.sigma
        power = np.einsum("nc,nc->n", u, u)
        return np.asarray(np.einsum("nc,nc->n", u, residual / self.sigma) / np.maximum(power, 1e-300))

    def component(self, name: str, residual: Floats, by_command: Floats | None = None) -> Floats:
        """(N,) residuals along an axis (``x``, ``rx``) or along the travel of an actuator (``cart2``), m or rad.

        NaN in rows that do not have the component: see :meth:`rows_of`.

        Parameters
        ----------
        by_command
            As the property of this name, of the poses that the residuals are of; by default the dataset's.
        """
        if self.readings is not None and name in self._read:
            rows, k, _ = self._read[name]
            found = np.full(len(residual), np.nan)
            found[rows] = residual[rows, k]
            return found
        if name in self.axes:
            return np.asarray(residual[:, self.axes.index(name)])
        actuator = self.model.robot.sites.index(name)
        return self.along(residual, (self.by_command if by_command is None else by_command)[:, :, actuator])

    @property
    def component_names(self) -> tuple[str, ...]:
        """Components of residuals."""
        return (*self.model.robot.sites, *self.axes)

    @property
    def first_component(self) -> str:
        """The component that is seen where none is chosen and there are no causes."""
        return self.component_names[0] if self.of_poses else self.axes[0]

    def unit(self, name: str) -> str:
        """``m`` or ``rad``: the unit of a component."""
        if self.readings is not None and name in self._read:
            return self._read[name][2]
        if name in AXES:
            return "rad" if name.startswith("r") else "m"
        return "rad" if self.model.robot.actuators[self.model.robot.sites.index(name)].revolute else "m"

    def column(self, name: str) -> Column | None:
        """(N,) a command (``q1``) or covariate; None where there is none."""
        if name[:1] == "q" and name[1:].isdigit():
            return np.asarray(self.dataset.q[:, int(name[1:]) - 1])
        return self.dataset.covariates.get(name)

    def middle(self, given: Mapping[str, Any]) -> tuple[Floats, dict[str, Column]]:
        """Commands and covariates, of which some are given, one of them at least as (m,) values, and the others are as usual.

        Commands at their means, or at home where no command is given; numbers at their medians, the first session.
        """
        data = self.dataset
        count = max(np.size(values) for values in given.values())
        commands = command_names(data.n_actuators)
        usual_q = (
            data.q.mean(axis=0) if set(commands) & set(given) else self.model.robot.home_q
        )  # about which frames turn
        q = np.tile(usual_q, (count, 1))
        for j, name in enumerate(commands):
            q[:, j] = given.get(name, q[:, j])
        known: dict[str, Column] = {}
        for name, values in data.covariates.items():
            usual = values[0] if name == "session" else np.median(values)
            known[name] = np.full(count, given.get(name, usual), dtype=values.dtype)
        return q, known


def _of_readings(dataset: Dataset, baseline: ReadingsCalibration, model: Model | None, lines: list[int]) -> Residuals:
    """Residuals of readings of several instruments."""
    robot = baseline.model.robot
    whole = single(dataset, robot)
    rows = np.flatnonzero(~np.isin(whole.row, lines))
    kept = whole.take(rows[evenly(len(rows), MOST)])
    readings = Readings.of(kept, robot, baseline.u)
    before = readings.minus(baseline.model.predict(kept.q))
    after = before
    if model is not None:
        values = {name: value for one in model.instruments for name, value in one.unknowns.items()}
        u = np.array([values[unknown.name] for unknown in readings.unknowns])
        after = readings.at(u).minus(model.predict(kept.q, kept.covariates))
    noise = replace(baseline.noise, group=readings.group, row_sigma=readings.row_sigma)
    return Residuals(kept, len(rows), baseline.model, model or baseline.model, before, after, noise.each, readings)


def evenly(count: int, most: int) -> npt.NDArray[np.intp]:
    """Indices of at most ``most`` of ``count`` rows, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def fine(values: Floats, short: bool) -> Floats:
    """(m,) values over the range of a column; ``short``: a finer grid, for short periods."""
    return np.linspace(values.min(), values.max(), FINEST if short else FINE)
