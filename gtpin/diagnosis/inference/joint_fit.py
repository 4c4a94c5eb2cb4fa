"""Geometry and causes fitted together with exact kinematics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gtpin.calibration.problem import Measured, in_frame, measured_poses
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.diagnosis.hypotheses.hypothesis import Candidate
from gtpin.diagnosis.linear.design import Design
from gtpin.effects.active import ActiveEffect, with_effects
from gtpin.effects.situation import Column, References, Situation
from gtpin.errors import ConvergenceError
from gtpin.kinematics.chunks import chunks
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rod_kinematics import RodKinematics
from gtpin.kinematics.rotations import exp
from gtpin.model.model import Frame, Model
from gtpin.noise.noise import Noise
from gtpin.noise.sight import line_of_sight

Floats = npt.NDArray[np.float64]

MAX_STEPS = 12
SETTLED = 1e-3
"""Step, in tolerances and typical sizes, at which the fit has settled."""


@dataclass(frozen=True)
class Observed:
    """The poses that a diagnosis works on.

    Parameters
    ----------
    measured
        Commands and poses, instrument's frame.
    covariates
        By name, (N,) each.
    noise, weight
        What the poses' noise is, and (N,) what each counts.
    temperature
        degC at which the geometry holds.
    free_frame
        Whether the instrument's pose is identified too.
    unusable
        Covariates that were recorded and can't be right.
    """

    measured: Measured
    covariates: Mapping[str, Column]
    noise: Noise
    weight: Floats
    temperature: float
    free_frame: bool
    unusable: frozenset[str] = frozenset()

    @staticmethod
    def of(dataset: Dataset, baseline: Calibration) -> Observed:
        """The poses of a dataset with the noise that a calibration found, repeatability left out."""
        measured, station = measured_poses(dataset), dataset.instrument.station
        noise = _without_repeatability(dataset, baseline)
        if noise.sight is not None and station is not None:
            sight, reach = line_of_sight(measured.T, np.array(station))
            noise = replace(noise, sight=sight, reach=reach)
        return Observed(
            measured=measured,
            covariates=dataset.covariates,
            noise=noise,
            weight=np.ones(len(dataset)),
            temperature=dataset.conditions.reference_temperature,
            free_frame=dataset.instrument.frame == "free",
            unusable=dataset.unusable,
        )

    def take(self, rows: npt.NDArray[np.generic] | slice) -> Observed:
        """Some of the poses."""
        return replace(
            self,
            measured=self.measured.take(rows),
            covariates={name: values[rows] for name, values in self.covariates.items()},
            noise=self.noise.take(rows),
            weight=self.weight[rows],
        )

    def situation(self, model: Model, fixed: References | None = None, poses: Poses | None = None) -> Situation:
        """The poses as a geometry has them: ``poses``, base frame, where they are known."""
        kinematics = model.kinematics
        assert isinstance(kinematics, RodKinematics)
        poses = kinematics.forward(self.measured.q) if poses is None else poses
        q = self.measured.q
        return Situation(kinematics, q, poses, self.covariates, fixed, self.temperature, self.unusable)

    def design(
        self,
        model: Model,
        fixed: References | None = None,
        poses: Poses | None = None,
        pivot: Floats | None = None,
    ) -> Design:
        """The linear problem about a model's geometry; ``pivot`` as for :meth:`Design.of`."""
        at = self.situation(model, fixed, poses)
        return Design.of(at, model, self.measured, self.noise, self.weight, self.free_frame, pivot)


def _without_repeatability(dataset: Dataset, baseline: Calibration) -> Noise:
    """A calibration's noise without repeatability, which is told by visits that causes may have set apart.

    Sigmas that were not declared carry all of the scatter then: what causes do to repeated visits makes the instrument's share
    in it look small.
    """
    noise, instrument, model = baseline.noise, dataset.instrument, baseline.model
    if noise.along_drives > 0.0:
        poses = model.kinematics.forward(dataset.q)
        J = in_frame(model.kinematics.command_jacobian(dataset.q, poses), model.frame)
        own = noise.along_drives**2 * (J**2).sum(axis=2).mean(axis=0)
        if instrument.position_sigma is None:
            noise = replace(noise, position_sigma=float(np.sqrt(noise.position_sigma**2 + own[:3].mean())))
        if instrument.orientation_sigma is None:
            noise = replace(noise, orientation_sigma=float(np.sqrt(noise.orientation_sigma**2 + own[3:].mean())))
    return replace(noise, repeatability=0.0, lack=0.0)


def fit_together(
    observed: Observed, start: Model, candidates: Sequence[Candidate], scale: Sequence[float], references: References
) -> Model:
    """Gauss-Newton on geometry, instrument's pose and coefficients, from a calibrated model.

    Parameters
    ----------
    candidates, scale
        The causes, and their scales over the typical size: with it the priors of their coefficients.

    Raises
    ------
    ConvergenceError
        If it does not settle.
    """
    model = replace(start, effects=())
    p = len(model.geometry.parameters)
    c = np.zeros(0)
    for _ in range(MAX_STEPS):
        now = _linear(observed, model, candidates, scale, references)
        causes = len(now.gradient) - sum(now.widths)
        if not c.size:
            c = np.zeros(sum(now.widths))
        x = model.geometry.deviation / model.geometry.tolerance
        prior = np.concatenate([np.ones(p), np.zeros(causes - p), np.ones(len(c))])
        A = now.information + np.diag(prior)
        step = np.linalg.solve(A, now.gradient - prior * np.concatenate([x, np.zeros(causes - p), c]))
        joint: Floats = np.asarray(np.linalg.inv(A), dtype=np.float64)
        tolerance = model.geometry.tolerance
        c = c + step[causes:]
        geometry = model.geometry.with_values(model.geometry.values + tolerance * step[:p])
        frame = _moved(model.frame, step[p:causes], now.pivot)
        active = _active(candidates, now.sizes, now.widths, c, joint[causes:, causes:], references)
        model = Model(geometry, frame, active, joint[:p, :p] * np.outer(tolerance, tolerance))
        if np.abs(step).max(initial=0.0) <= SETTLED:
            return model
    raise ConvergenceError("geometry and causes have not settled together", hint="exclude the causes one by one")


@dataclass(frozen=True)
class _Linear:
    """J'J and J'r about a model (columns: geometry, instrument's pose, causes), and what the columns were made with.

    ``sizes`` are those of each cause's coefficients, ``widths`` how many it has; ``pivot`` (3,) is what a free instrument
    turns about, in its frame, m.
    """

    information: Floats
    gradient: Floats
    sizes: list[Floats]
    widths: list[int]
    pivot: Floats


def _linear(
    observed: Observed, model: Model, candidates: Sequence[Candidate], scale: Sequence[float], references: References
) -> _Linear:
    """Sum up chunks of poses: all their derivatives at once would take kilobytes a pose."""
    kinematics, q = model.kinematics, observed.measured.q
    assert isinstance(kinematics, RodKinematics)
    poses = kinematics.forward(q)
    pivot = model.seen(poses).T.mean(axis=0)
    information: Floats | float = 0.0
    gradient: Floats | float = 0.0
    for rows in chunks(len(q)):
        part = observed.take(rows)
        design = part.design(model, references, poses[rows], pivot)
        bases = [k.effect.basis(design.situation, k.site, k.setting) for k in candidates]
        blocks = [design.columns(b) * s for b, s in zip(bases, scale, strict=True)]
        predicted = model.seen(with_effects(kinematics, q[rows], part.covariates, model.effects, poses[rows]))
        # y is against the geometry alone; the exact effects replace their linear part, which is put back.
        left = np.einsum("nij,nj->ni", design.whitening, part.measured.minus(predicted)).ravel()
        J = np.hstack([design.B, *blocks])
        information, gradient = information + J.T @ J, gradient + J.T @ left
    sizes = [basis.sigma * s for basis, s in zip(bases, scale, strict=True)]
    return _Linear(np.asarray(information), np.asarray(gradient), sizes, [len(basis) for basis in bases], pivot)


def _active(
    candidates: Sequence[Candidate],
    sizes: Sequence[Floats],
    widths: Sequence[int],
    c: Floats,
    covariance: Floats,
    references: References,
) -> tuple[ActiveEffect, ...]:
    found, place = [], 0
    for candidate, size, width in zip(candidates, sizes, widths, strict=True):
        own = slice(place, place + width)
        place += width
        found.append(
            ActiveEffect(
                candidate.effect,
                candidate.site,
                candidate.setting,
                c[own] * size,
                covariance[own, own] * np.outer(size, size),
                references,
            )
        )
    return tuple(found)


def _moved(frame: Frame, step: Floats, pivot: Floats) -> Frame:
    """A free instrument's frame after a step: shifts, m, and turns, rad, about the middle of the poses."""
    if not step.size:
        return frame
    turn = exp(step[3:])
    return Frame(pivot + step[:3] + turn @ (frame.T - pivot), turn @ frame.R)
