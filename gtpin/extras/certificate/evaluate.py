"""The numbers of a certificate, from rows compared with the models of the uncorrected and the corrected machine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from gtpin.data import Dataset
from gtpin.diagnosis.result import Gap
from gtpin.extras.certificate.budget import mean_trace, unexplained
from gtpin.extras.certificate.held_against import HeldAgainst, ModelPosterior, approaches, by_commands
from gtpin.extras.certificate.pose_accuracy import (
    Scatter,
    accuracy,
    left_out_accuracy,
    means_of_visits,
    pooled_repeatability,
    standard_accuracy,
    standard_repeatability,
)
from gtpin.extras.certificate.positioning import mean_reversal, positioning
from gtpin.extras.certificate.quantity import Missing, Quantity, blank
from gtpin.typing import Floats

Groups = npt.NDArray[np.intp]
ORDER = (("AP_p", "m", slice(0, 3)), ("AP_o", "rad", slice(3, 6)))
"""Symbol, unit and columns of the errors, for the accuracies of position and of orientation."""


@dataclass(frozen=True)
class Evaluation:
    """The measured rows of a certificate, compared with the models of the uncorrected and the corrected machine.

    - ``rows``: the rows.
    - ``nominal``: the rows compared with the nominal geometry. Where the target's position on the platform is unknown, they
      are compared with the identified geometry, and only differences between visits are used.
    - ``nominal_known``: True: ``nominal`` has the nominal geometry. False: the identified one.
    - ``corrected``: the rows compared with the model of the corrected machine.
    - ``posterior``: uncertainty of the model of ``corrected``.
    - ``gap``: errors on left-out poses, where a diagnosis of these rows made the model; None where the model was given.
    - ``fitted``: whether the given model was fitted to these rows.
    - ``unknown``: whether the diagnosis found something unknown. The scatter of visits may then be an error of the machine too:
      of it, the declared noise alone counts as noise.
    """

    rows: Dataset
    nominal: HeldAgainst
    nominal_known: bool
    corrected: HeldAgainst
    posterior: ModelPosterior
    gap: Gap | None
    fitted: bool
    unknown: bool = False

    @cached_property
    def approach(self) -> Floats | None:
        """(N, n) directions of approach, +1 or -1; None where they were not recorded."""
        return approaches(self.rows.covariates, self.rows.n_actuators)

    @cached_property
    def _one_way(self) -> tuple[Groups, bool]:
        """(N,) group of each row, and whether visits of a group have the same directions of approach.

        Groups are the visits of a pose with the same directions of approach where these have enough repeats; else the visits of
        a pose.
        """
        if self.approach is not None:
            key = np.column_stack([self.rows.visits, self.approach])
            groups = np.unique(key, axis=0, return_inverse=True)[1].ravel()
            if Scatter.of(groups, self.nominal.errors) is not None:
                return groups, True
        return self.rows.visits, False

    @property
    def one_way(self) -> bool:
        """Whether a repeatability compares only visits with the same directions of approach."""
        return self._one_way[1]

    @cached_property
    def _scatter(self) -> Scatter | None:
        return None if self.unknown else Scatter.of(self.rows.visits, self.corrected.errors)

    def scatter(self, held: HeldAgainst, part: slice) -> Scatter:
        """Scatter of single visits to a pose, from any direction: from repeated visits, else the declared noise, else none.

        ``held``: the errors to take. ``part``: their columns, of the position or the orientation.
        """
        noise, pooled, declared = self.corrected.noise, Scatter.of(self.rows.visits, held.errors), self.rows.instrument
        position = part.start == 0
        if pooled is not None and not (self.unknown and held is self.corrected):
            return pooled.part(part).with_noise(declared.position_sigma if position else declared.orientation_sigma)
        sigma = noise.position_sigma if position else noise.orientation_sigma
        return Scatter((0.0 if self.noise_known == "no" else sigma**2) * np.eye(3), np.inf)

    def quantities(self) -> tuple[Quantity, ...]:
        """All quantities of the certificate."""
        groups, nominal = self._one_way[0], self.nominal
        pooled = pooled_repeatability(groups, nominal.errors, self.corrected.noise.position_sigma)
        return (
            *self._accuracy(),
            standard_repeatability(groups, nominal.measured.T),
            *pooled,
            *self._positioning(),
        )

    @property
    def noise_known(self) -> Literal["declared", "visits", "no"]:
        """The source of the noise of a visit: see :class:`~gtpin.extras.certificate.result.Certificate`."""
        if self.rows.instrument.position_sigma is not None:
            return "declared"
        return "no" if self._scatter is None else "visits"

    def spreads(self) -> tuple[float | Missing, tuple[float, float]]:
        """Contributions that are not in the model's posterior: repeatability of each actuator, m or rad, or why it is unknown;
        and per axis the unexplained errors, of position, m, and of orientation, rad.

        What repeats is not what is right: unexplained errors are those between poses, beyond the scatter of visits and the
        model's uncertainty. Repeatability is that of repeated visits; where these are few, it is limited to what all errors
        show.
        """
        held = self.corrected
        J = by_commands(held.model, held.at)
        covariance, instrument_noise = self.posterior.poses(held.at), self._noise()
        gain = [mean_trace((J @ np.swapaxes(J, 1, 2))[:, part, part]) for _, _, part in ORDER]
        declared = self.noise_known == "declared"
        r = held.repeatability(self.rows.visits) if declared else None
        left = [0.0, 0.0]
        for kind, (_, _, part) in enumerate(ORDER[: held.errors.shape[1] // 3]):
            observed, share = self._between[kind]
            if kind == 0 and r is not None:
                most = max(observed - share * instrument_noise[0], 0.0) / share
                r = min(r, float(np.sqrt(most / gain[0])))
            noise = share * (instrument_noise[kind] + (r or 0.0) ** 2 * gain[kind])
            power = unexplained(observed, noise, mean_trace(covariance[:, part, part]), self._freedom)
            left[kind] = float(np.sqrt(max(power, 0.0) / 3.0))
        why: Missing = "few_visits" if declared else "not_declared"
        return why if r is None else r, (left[0], left[1])

    @cached_property
    def _left_out(self) -> tuple[Floats, float]:
        """(N, c) errors at poses that are left out of the fit of the model to these rows, and its number of parameters."""
        return self.corrected.left_out(self.posterior, self.rows.visits)

    @property
    def _freedom(self) -> float:
        poses = len(np.unique(self.rows.visits))
        effective_parameters = self._left_out[1] if self.fitted or self.gap is not None else 0.0
        return float(max(3.0 * (poses - effective_parameters / self.corrected.errors.shape[1]), 1.0))

    @cached_property
    def _between(self) -> list[tuple[float, float]]:
        """For positions and orientations, the mean square error of poses that were not fitted, m^2 or rad^2, and the share of
        the scatter of a visit in it.

        It is that of the means of the visits, or of single visits where a diagnosis predicted left-out poses.
        """
        errors = self._left_out[0] if self.fitted else self.corrected.errors
        found = []
        for kind, (_, _, part) in enumerate(ORDER[: errors.shape[1] // 3]):
            if self.gap is not None:
                found.append((self._after(kind) ** 2, 1.0))
                continue
            means, counts = means_of_visits(self.rows.visits, errors[:, part])
            found.append((float((means**2).sum(axis=1).mean()), float((1.0 / counts).mean())))
        return found

    def _noise(self) -> tuple[float, float]:
        """Mean square length of the noise of position, m^2, and orientation, rad^2, as far as it is known."""
        noise = self.corrected.noise
        if self.noise_known == "declared":
            return 3.0 * noise.position_sigma**2, 3.0 * noise.orientation_sigma**2
        if self._scatter is None:
            return 0.0, 0.0
        return self._scatter.part(slice(3)).trace, self._scatter.part(slice(3, 6)).trace

    def _after(self, kind: int) -> float:
        """Root mean square error of single visits of left-out poses, m (kind 0) or rad (1), if a diagnosis made the model."""
        assert self.gap is not None
        part = self.gap if kind == 0 or self.gap.turns is None else self.gap.turns
        return part.after

    def _accuracy(self) -> list[Quantity]:
        visits, found = self.rows.visits, []
        measured = self.nominal.errors.shape[1] // 3
        if self.nominal_known:
            found.append(standard_accuracy(visits, self.nominal.errors))
        else:
            found.append(blank("AP_p", "m", "free_target"))
        for kind, (symbol, unit, part) in enumerate(ORDER):
            names = [f"{symbol}_{machine}_{which}" for machine in ("nominal", "corrected") for which in ("rms", "max")]
            if kind >= measured:
                found += [blank(name, unit, "no_orientation") for name in names]
                continue
            if self.nominal_known:
                scatter = self.scatter(self.nominal, part)
                found += accuracy(f"{symbol}_nominal", unit, visits, self.nominal.errors[:, part], scatter)
            else:
                found += [blank(name, unit, "free_target") for name in names[:2]]
            scatter = self.scatter(self.corrected, part)
            if self.gap is not None:
                poses = len(np.unique(visits))
                left = self._after(kind)
                found.append(
                    left_out_accuracy(f"{symbol}_corrected", unit, left, scatter, poses, len(visits), self._freedom)
                    if kind == 0 or self.gap.turns is not None
                    else blank(names[2], unit, "known_in_mean")
                )
                found.append(blank(names[3], unit, "known_in_mean"))
            elif self.fitted:
                found += [blank(name, unit, "fitted_poses") for name in names[2:]]
            else:
                found += accuracy(f"{symbol}_corrected", unit, visits, self.corrected.errors[:, part], scatter)
        return found

    def _positioning(self) -> list[Quantity]:
        robot, held = self.rows, self.corrected
        sites = held.model.robot.sites
        units = tuple("rad" if turns else "m" for turns in held.model.robot.revolute)
        travel = self.nominal.travel(self.nominal.errors) if self.nominal_known else None
        reversals = [
            active.name
            for active in held.model.effects
            if any(name.startswith("approach") for name in active.effect.covariates(held.model.robot, active.site))
        ]
        without = held.model.without(reversals).predict(robot.q, robot.covariates)
        residual = held.errors if not reversals else held.measured.residual_at(without)
        return [
            *positioning(robot.q, travel, self.approach, sites, units),
            *mean_reversal(held.travel(residual), self.approach, sites, units),
        ]
