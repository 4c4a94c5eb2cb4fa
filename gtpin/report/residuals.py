"""Residuals of geometry alone and of geometry with the causes: the numbers of a diagnosis's plots."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.noise_estimator import noise_at
from gtpin.calibration.result import Calibration
from gtpin.data import Commands, Dataset
from gtpin.data.names import command_names
from gtpin.effects.operating_points import Column, OperatingPoints, References
from gtpin.instruments.readings import Readings, single
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.report.figure import escaped
from gtpin.typing import Floats, Indices

FINE, FINEST = 401, 2500
"""Number of points of a line along a column, and where a cause has a nonlinear parameter, which may be a short period."""
MOST = 20_000
"""Largest number of poses from which plots are made; of more, an even selection is used. A mean of neighbouring poses is then
still over a thousand poses."""


@dataclass(frozen=True)
class Residuals:
    """Measured less predicted of N poses that were used, or of an even selection where there are very many.

    - ``dataset``: the poses.
    - ``used``: number of used poses, of which the dataset may be a selection.
    - ``baseline``, ``model``: geometry alone, and geometry with the causes.
    - ``before``, ``after``: (N, c) residuals of ``baseline`` and of ``model``: position, m, and rotation vector, rad,
      instrument's frame; or readings, m and rad.
    - ``sigma``: (N, c) the instruments' noise, m and rad.
    - ``readings``: what was measured.
    """

    dataset: Dataset
    used: int
    baseline: Model
    model: Model
    before: Floats
    after: Floats
    sigma: Floats
    readings: Readings

    @staticmethod
    def of(
        dataset: Dataset, baseline: Calibration, model: Model | None = None, aside: Collection[int] | None = None
    ) -> Residuals:
        """Residuals of the rows that were not set aside.

        ``model``: geometry with the causes; None: there are no causes. ``aside``: line numbers of the rows that were set
        aside; by default those of the baseline.
        """
        lines = list(baseline.rejected_rows if aside is None else aside)
        robot = baseline.model.robot
        if baseline.residual.shape[1] == 3:  # a reduced arm is fitted to positions alone
            dataset = replace(dataset, orientation=None)
        whole = single(dataset, robot)
        rows = np.flatnonzero(~np.isin(whole.row, lines))
        kept = whole.take(rows[evenly(len(rows), MOST)])
        readings = Readings.of(kept, robot, baseline.u)
        before = readings.residual_at(baseline.model.predict(kept.q))
        after = before
        if model is not None:
            values = {name: value for one in model.instruments for name, value in one.unknowns.items()}
            u = np.array([values[unknown.name] for unknown in readings.unknowns])
            after = readings.at(u).residual_at(model.predict(kept.q, kept.covariates))
        sigma = noise_at(baseline.noise, readings).each
        return Residuals(kept, len(rows), baseline.model, model or baseline.model, before, after, sigma, readings)

    def __len__(self) -> int:
        return len(self.before)

    @cached_property
    def names(self) -> npt.NDArray[np.object_]:
        """(N,) ids of the poses, as plotly takes text."""
        return np.array([escaped(str(pose)) for pose in self.dataset.pose], dtype=object)

    @cached_property
    def poses(self) -> Poses:
        """(N) poses that the model's geometry predicts, base frame, without effects."""
        return self.model.kinematics.forward(self.dataset.q)

    @cached_property
    def by_command(self) -> Floats:
        """(N, 6 + k, n) derivative of the TCP's pose, base frame, and of k measured joints by the commands."""
        return self.model.kinematics.command_jacobian(self.dataset.q, self.poses)

    @cached_property
    def columns(self) -> dict[str, Column]:
        """(N,) the commands (``q1``) and covariates, by name."""
        return columns_of(self.dataset)

    @property
    def of_poses(self) -> bool:
        """Whether residuals are of poses, and not of readings of any instruments."""
        return self.readings.tracked

    @cached_property
    def axes(self) -> dict[str, tuple[Indices, int, str]]:
        """Rows, column of the residuals, and unit of each of their numbers, by name: axes of poses, or components of readings.

        With several instruments: the instrument's name (``wire``), followed by the component if it reads several (``cup.x``).
        """
        instruments, rows, count = self.readings.instruments, self.readings.rows, self.before.shape[1]
        if len(instruments) == 1 and count == len(instruments[0].components):
            every = np.arange(len(self))
            return {c.name: (every, k, c.unit) for k, c in enumerate(instruments[0].components)}
        found = {}
        for i, one in enumerate(instruments):
            mine, split = rows.rows_of(i), count < len(one.components)
            for k, c in enumerate(one.components):
                own = mine[rows.component[mine] == k] if split else mine
                if len(own):
                    found[one.label(c)] = (own, 0 if split else k, c.unit)
        return found

    def rows_of(self, name: str) -> Indices:
        """Indices of the rows that have a component: with several instruments, those of the instrument that reads it."""
        return self.axes[name][0] if name in self.axes else np.arange(len(self))

    def at(self, q: Floats, covariates: Mapping[str, Column], fixed: References | None = None) -> OperatingPoints:
        """The situation at commands q (N, n) and covariates, with the model's geometry."""
        kinematics = self.model.kinematics
        temperature = self.dataset.conditions.reference_temperature
        return OperatingPoints(kinematics, q, kinematics.forward(q), dict(covariates), fixed, temperature)

    def along(self, residual: Floats, motion: Floats) -> Floats:
        """(N,) size of a motion that explains residuals (N, c) best, by weighted least squares in each row.

        ``motion`` (N, 6 + k): motion of the TCP, base frame, and of k measured joints, for size 1.
        """
        sigma = self.sigma[0] if self.of_poses else self.sigma  # of poses, those of all rows are equal
        u = self.readings.change_by(motion[:, :, None], self.model, self.poses)[:, :, 0] / sigma
        power = np.einsum("nc,nc->n", u, u)
        return np.asarray(np.einsum("nc,nc->n", u, residual / sigma) / np.maximum(power, 1e-300))

    def component(self, name: str, residual: Floats, by_command: Floats | None = None) -> Floats:
        """(N,) residuals along an axis (``x``, ``rx``) or along the travel of an actuator (``cart2``), m or rad.

        NaN in rows that do not have the component: see :meth:`rows_of`.

        ``by_command``: as the property of this name, for the poses of the residuals; by default those of the dataset.
        """
        if name in self.axes:
            rows, k, _ = self.axes[name]
            if self.of_poses:  # at other poses too
                return np.asarray(residual[:, k])
            found = np.full(len(residual), np.nan)
            found[rows] = residual[rows, k]
            return found
        actuator = self.model.robot.sites.index(name)
        return self.along(residual, (self.by_command if by_command is None else by_command)[:, :, actuator])

    @property
    def component_names(self) -> tuple[str, ...]:
        """Names of all components of residuals: travels of actuators, and axes of poses or components of readings."""
        return (*self.model.robot.sites, *self.axes)

    @property
    def first_component(self) -> str:
        """The component that is shown where none is chosen and there are no causes."""
        return self.component_names[0] if self.of_poses else next(iter(self.axes))

    def unit(self, name: str) -> str:
        """The unit of a component: ``m``, ``rad``, or that of a reading."""
        if name in self.axes:
            return self.axes[name][2]
        return "rad" if self.model.robot.actuators[self.model.robot.sites.index(name)].revolute else "m"

    def middle(self, given: Mapping[str, Any]) -> tuple[Floats, dict[str, Column]]:
        """Commands (m, n) and covariates (m,): those in ``given``, at least one of them with m values, and usual values of the
        others.

        Usual values: means of the commands, or home where no command is given; medians of the covariates; the first session.
        """
        data = self.dataset
        count = max(np.size(values) for values in given.values())
        commands = command_names(data.n_actuators)
        # Effects of rotating frames are shown at home.
        usual_q = data.q.mean(axis=0) if set(commands) & set(given) else self.model.robot.home_q
        q = np.tile(usual_q, (count, 1))
        for j, name in enumerate(commands):
            q[:, j] = given.get(name, q[:, j])
        known: dict[str, Column] = {}
        for name, values in data.covariates.items():
            usual = values[0] if name == "session" else np.median(values)
            known[name] = np.full(count, given.get(name, usual), dtype=values.dtype)
        return q, known


def columns_of(rows: Dataset | Commands) -> dict[str, Column]:
    """(N,) the commands (``q1``) and covariates, by name."""
    return {**dict(zip(command_names(rows.n_actuators), rows.q.T, strict=True)), **rows.covariates}


def evenly(count: int, most: int) -> npt.NDArray[np.intp]:
    """Indices of at most ``most`` of ``count`` rows, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def fine(values: Floats, short: bool) -> Floats:
    """(m,) values over the range of a column; ``short``: a finer grid, for short periods."""
    return np.linspace(values.min(), values.max(), FINEST if short else FINE)
