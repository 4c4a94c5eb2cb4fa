"""What geometry alone leaves of the measurements, and what the causes leave: the numbers behind a diagnosis's plots."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import in_frame, measured_poses
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.data.names import command_names
from gtpin.effects.situation import Column, References, Situation
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model

Floats = npt.NDArray[np.float64]

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
        (c,) the instrument's noise.
    """

    dataset: Dataset
    used: int
    baseline: Model
    model: Model
    before: Floats
    after: Floats
    sigma: Floats

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
        rows = np.flatnonzero(~np.isin(dataset.row, list(baseline.rejected_rows if aside is None else aside)))
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
        """(N, 6, n) motion of the TCP, base frame, by the commands."""
        return self.model.kinematics.command_jacobian(self.dataset.q, self.poses)

    def at(self, q: Floats, covariates: Mapping[str, Column], fixed: References | None = None) -> Situation:
        """Commands and measurement conditions at the model's geometry."""
        kinematics = self.model.kinematics
        temperature = self.dataset.conditions.reference_temperature
        return Situation(kinematics, q, kinematics.forward(q), dict(covariates), fixed, temperature)

    def along(self, residual: Floats, motion: Floats) -> Floats:
        """(N,) how far a motion (N, 6), for one unit of it, base frame, has to go to explain residuals (N, c) best."""
        u = in_frame(motion[:, :, None], self.model.frame)[:, : self.components, 0] / self.sigma
        power = np.einsum("nc,nc->n", u, u)
        return np.asarray(np.einsum("nc,nc->n", u, residual / self.sigma) / np.maximum(power, 1e-300))

    def component(self, name: str, residual: Floats, by_command: Floats | None = None) -> Floats:
        """(N,) residuals along an axis (``x``, ``rx``) or along the travel of an actuator (``cart2``), m or rad.

        Parameters
        ----------
        by_command
            As the property of this name, of the poses that the residuals are of; by default the dataset's.
        """
        if name in AXES:
            return np.asarray(residual[:, AXES.index(name)])
        actuator = self.model.robot.sites.index(name)
        return self.along(residual, (self.by_command if by_command is None else by_command)[:, :, actuator])

    @property
    def component_names(self) -> tuple[str, ...]:
        """Components of residuals."""
        return (*self.model.robot.sites, *AXES[: self.components])

    def unit(self, name: str) -> str:
        """``m`` or ``rad``: the unit of a component."""
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


def evenly(count: int, most: int) -> npt.NDArray[np.intp]:
    """Indices of at most ``most`` of ``count`` rows, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def fine(values: Floats, short: bool) -> Floats:
    """(m,) values over the range of a column; ``short``: a finer grid, for short periods."""
    return np.linspace(values.min(), values.max(), FINEST if short else FINE)
