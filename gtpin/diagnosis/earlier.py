"""An earlier model as the prior of a check: what it predicts of new poses, and how uncertain that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gtpin.calibration.checks.before_fit import known_noise, plausible_rows, prepared, with_positions
from gtpin.calibration.checks.instruments import check_sockets, check_stations
from gtpin.calibration.problem import Measured, rough_frame
from gtpin.data import Dataset
from gtpin.data.plausible import check_extremes, counted_once, sane_rows
from gtpin.diagnosis.design import Design, Observed
from gtpin.diagnosis.hypothesis import Hypothesis
from gtpin.diagnosis.priors import PRIORS, Priors
from gtpin.effects.active import ActiveEffect, lasts, with_effects
from gtpin.effects.operating_points import Column, OperatingPoints
from gtpin.effects.sites import turning_joint
from gtpin.effects.smooth import RIM
from gtpin.errors import ConvergenceError, DatasetError, ModelError, unheard, warn
from gtpin.instruments.readings import VAGUE, Readings, single
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import exp
from gtpin.model.fit_conditions import EXPLAINED, TEMPERATURES, FitConditions, ModelDiscrepancy
from gtpin.model.model import Frame, Model, inverse_root, joined
from gtpin.noise.noise import Noise
from gtpin.noise.reading_noise import SMALLEST, ReadingNoise
from gtpin.robot.command_ranges import check_actuators, check_commands, without_whole_turns
from gtpin.typing import Floats

SINCE = "since the model"
"""Session of all rows of a check: none of the sessions of the model's fit."""


@dataclass(frozen=True)
class Earlier:
    """An earlier model ``model``, as it was identified, as the prior of a check."""

    model: Model

    @cached_property
    def lasting(self) -> Model:
        """The model without the effects that do not last: drift of the instrument or target, and shifts between sessions."""
        robot = self.model.robot
        return self.model.without([active.name for active in self.model.effects if not lasts(active, robot)])

    @property
    def unexplained(self) -> ModelDiscrepancy:
        """What the model left unexplained of its own data: a part of the uncertainty of every prediction."""
        return self.model.unexplained or EXPLAINED

    @cached_property
    def covariance(self) -> Floats:
        """(p + m, p + m) covariance of the p parameters of the geometry and the m coefficients of the lasting effects.

        A nominal geometry has the squares of its tolerances. Where the model has no joint covariance, its effects are
        independent.
        """
        model = self.lasting
        known = np.diag(model.geometry.tolerance**2) if model.covariance is None else model.covariance
        return joined([known, *(active.covariance for active in model.effects)], model.joint_covariance)

    @cached_property
    def root(self) -> Floats:
        """(p + m, k) with root @ root' the covariance: the uncertainty as k standard normal unknowns."""
        values, vectors = np.linalg.eigh(self.covariance)
        kept = values > 1e-14 * max(float(values.max()), 1e-300)
        return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))

    def predicted(self, q: Floats, covariates: Mapping[str, Column], plain: Poses) -> Poses:
        """Poses (N) that the model predicts at commands q (N, n), base frame; ``plain`` are those of its geometry alone.

        Raises `ModelError` if a covariate is missing that an effect needs.
        """
        with unheard():  # sessions of a check are never those of the model
            try:
                return with_effects(
                    self.model.kinematics, q, self._then(covariates, len(q)), self.lasting.effects, plain
                )
            except ModelError as error:
                hint = f"record {error.column or 'it'} in the check too, as at the poses of the model"
                raise ModelError(error.what, column=error.column, hint=hint) from None

    def jacobian(self, q: Floats, covariates: Mapping[str, Column], poses: Poses) -> Floats:
        """(N, 6, p + m) derivative of the poses, base frame, by the geometry and the lasting effects' coefficients."""
        kinematics = self.model.kinematics
        columns = [kinematics.geometry_jacobian(q, poses)]
        then = self._then(covariates, len(q))
        with unheard():
            for active in self.lasting.effects:
                at = OperatingPoints(kinematics, q, poses, then, fixed=active.references)
                columns.append(active.basis(at).displacement(at))
        return np.concatenate(columns, axis=2)

    def _then(self, covariates: Mapping[str, Column], count: int) -> dict[str, Column]:
        """Covariates for the model's effects: a session that is not in its fit, and the middle of the time of its fit."""
        then = dict(covariates) | {"session": np.full(count, SINCE, dtype=object)}
        for active in self.lasting.effects:
            start, span = active.references.time
            then["time"] = np.full(count, start + span / 2.0)
        return then

    def since(
        self, covariates: Mapping[str, Column], reference: float, count: int, warmer: float
    ) -> tuple[dict[str, Column], tuple[str, ...]]:
        """Covariates (N,) by name for effects that describe changes since the model, and the names of assumed temperatures.

        Sessions are left out: a change is the same at all poses of a check. Temperatures are those of the check less the one at
        which the model holds, plus ``reference``, degC. It holds at ``reference`` where it has an effect of this temperature,
        else at the mean over the poses of its fit. Where the change is not known, a rise by ``warmer``, K, is assumed:
        coefficients may have either sign, so that this includes a fall. ``count`` is N.
        """
        since = {name: values for name, values in covariates.items() if name != "session"}
        robot, assumed = self.model.robot, []
        for name in TEMPERATURES:
            has_effect = any(name in one.effect.covariates(robot, one.site) for one in self.lasting.effects)
            then: float | None = reference if has_effect else getattr(self.model.fit, name, None)
            now = np.asarray(covariates[name], dtype=float) if name in covariates else np.zeros(count)
            if then is None or name not in covariates:
                assumed.append(name)
                since[name] = now - now.mean() + reference + warmer
            else:
                since[name] = now - then + reference
        return since, tuple(assumed)


def _posterior(design: Design, changes: Floats) -> tuple[Floats, Floats, Floats]:
    """The Gaussian posterior of all k unknowns of a check, in units of their prior standard deviations.

    These are the model's unknowns, then the instrument's pose, then the coefficients of changes with the whitened displacements
    ``changes`` (N c, m). Returns their mean (k,) and covariance (k, k), and the derivative (N c, k) of y by them.
    """
    J, prior = design.beside(changes)
    root = inverse_root(J.T @ J + np.diag(prior))
    covariance = root @ root.T
    return covariance @ (J.T @ design.y), covariance, J


def pose_chi2(design: Design, changes: Floats) -> Floats:
    """(N,) chi-square of each pose given all other poses, with c degrees of freedom, the number of components of a pose.

    It is r' Q^-1 r with r the pose's rows of K^-1 y, Q the pose's block of K^-1, and K the covariance of y.
    """
    mean, covariance, J = _posterior(design, changes)
    c = design.components
    left, half = (design.y - J @ mean).reshape(-1, c), J.reshape(-1, c, J.shape[1])
    Q = np.eye(c) - half @ covariance @ half.swapaxes(1, 2)
    return np.asarray(np.einsum("ni,ni->n", left, np.linalg.solve(Q, left[..., None])[..., 0]))


def updated(
    earlier: Earlier, design: Design, causes: Sequence[Hypothesis], scale: Sequence[float], columns: Floats
) -> tuple[Model, tuple[ActiveEffect, ...]]:
    """The earlier model with the changes added, fitted again with the check's poses; and the changes with their coefficients.

    ``scale``: of each change. ``columns``: (N c, m) whitened displacements of all changes at these scales.
    """
    mean, unknown, _ = _posterior(design, columns)
    at, (n, k), after = design.operating_points, earlier.root.shape, design.B.shape[1]
    sizes = [cause.basis(at).sigma * s for cause, s in zip(causes, scale, strict=True)]
    whole = np.zeros((n + sum(map(len, sizes)), len(mean)))
    whole[:n, :k] = earlier.root
    whole[n:, after:] = np.diag(np.concatenate([np.zeros(0), *sizes]))
    moved, covariance = whole @ mean, whole @ unknown @ whole.T
    geometry, p = earlier.model.geometry, len(earlier.model.geometry.parameters)
    new = [
        ActiveEffect(cause.effect, cause.site, None, np.zeros(len(size)), np.zeros(0), at.references)
        for cause, size in zip(causes, sizes, strict=True)
    ]
    effects, place = list[ActiveEffect](), p
    for active in (*earlier.lasting.effects, *new):
        own = slice(place, place + len(active.coefficients))
        place = own.stop
        coefficients = active.coefficients + moved[own]
        effects.append(replace(active, coefficients=coefficients, covariance=covariance[own, own]))
    readings = design.measured
    unknowns = mean[k : design.n_prior] * np.where(np.isfinite(readings.sigma), readings.sigma, VAGUE)
    model = replace(
        earlier.model,
        geometry=geometry.with_values(geometry.values + moved[:p]),
        frame=_frame(design, mean[design.n_prior : after]),
        effects=tuple(effects),
        covariance=covariance[:p, :p],
        instruments=readings.at(unknowns).fitted or earlier.model.instruments,
        joint_covariance=covariance if effects else None,
    )
    return model, model.effects[len(effects) - len(new) :]


def _frame(design: Design, change: Floats) -> Frame:
    """The instrument's pose with a change of shift, m, and turn, rad, about the middle of the poses."""
    frame = design.model.frame
    if not change.size:
        return frame
    pivot = design.model.in_instrument_frame(design.operating_points.poses).T.mean(axis=0)
    turn = exp(change[3:])
    return Frame(pivot + change[:3] + turn @ (frame.T - pivot), turn @ frame.R)


FEWEST_POSES = 3
"""Fewest poses of a check: two measured positions have six numbers, as many as an instrument's pose has unknowns."""


@dataclass(frozen=True)
class Usable:
    """The usable rows of a check, and how they were measured.

    ``noise_known``: whether the noise was declared, or repeated visits showed it. Otherwise it is as small as noise can be, and
    what was left of the earlier fit counts as unexplained.
    """

    dataset: Dataset
    observed: Observed
    noise_known: bool

    def without(self, row: int) -> Usable:
        """The same without the row with the index ``row``; of a reading with several components, without all of them."""
        every = places(self.dataset)
        kept = np.any(every != every[row], axis=1)
        return replace(self, dataset=self.dataset.take(kept), observed=self.observed.take(kept))


def places(dataset: Dataset) -> npt.NDArray[np.int64]:
    """(N, 2) index of the instrument and line in its table of each row of a dataset."""
    return np.column_stack([dataset.readings.of, dataset.readings.line])


def usable(dataset: Dataset, model: Model, priors: Priors = PRIORS) -> Usable:
    """The rows of a dataset that a check of a model can use: rows with impossible values are left out.

    Noise is the declared one, else that of the model's fit; that of the actuators is :func:`drives_of`. All sigmas are
    multiplied by the fit's ratio of residuals to noise, ``misfit``. What the model left unexplained is not in it; noise that is
    known from nowhere but the residuals of the earlier fit is none.

    Raises `DatasetError` if the dataset does not match the model, or has too few poses, and `ModelError` if the model was
    measured in another frame.
    """
    check_actuators(model.robot, dataset)
    known = True
    if not dataset.readings.tracked:
        kept, measured = _usable_readings(dataset, model)
        declared = np.array([np.nan if sigma is None else sigma for sigma in measured.declared])
        unknown = np.zeros(len(declared), dtype=bool)
        noise = ReadingNoise(declared, measured.group, measured.row_sigma, unknown, drives_of(model, priors))
        if model.fit is not None:
            noise = noise.scaled(model.fit.misfit)
    else:
        kept, measured = _usable_poses(dataset, model)
        own = _noise(dataset, model, priors)
        lacking = [
            name for name in ("position_sigma", "orientation_sigma") if getattr(dataset.instrument, name) is None
        ]
        known = (model.unexplained or EXPLAINED).noise_known or not lacking
        if not known:
            none: dict[str, Any] = dict.fromkeys(lacking, SMALLEST)
            own = replace(own, **none)
        noise = own.rows(len(kept), measured.components)
    weight, temperature = np.ones(len(kept)), dataset.conditions.reference_temperature
    free = dataset.instrument.frame == "free"
    return Usable(kept, Observed(measured, kept.covariates, noise, weight, temperature, free), known)


def _usable_poses(dataset: Dataset, model: Model) -> tuple[Dataset, Readings]:
    if dataset.instrument.frame != "free" and not model.frame.is_base:
        raise ModelError(
            'the model was measured in a frame of the instrument, and the check in the base frame (frame = "robot")',
            file=dataset.file,
            column="instrument.frame",
            hint='set frame = "free" under [instrument]',
        )
    geometry = Model(model.geometry)
    recorded = prepared(dataset, geometry)
    kept = recorded.take(sane_rows(recorded))
    _check_count(kept, len(kept))
    kept = kept.take(plausible_rows(kept, geometry, geometry.kinematics.forward(kept.q))).in_order()
    _check_count(kept, len(kept))
    return kept, Readings.of(replace(kept, orientation=None) if model.geometry.positions_only else kept, model.robot)


def _usable_readings(dataset: Dataset, model: Model) -> tuple[Dataset, Readings]:
    """As :func:`usable`, one row for each reading. Their noise must be declared: a check has too few to estimate it."""
    robot = model.robot
    check_extremes(dataset)
    dataset = without_whole_turns(dataset, robot)
    dataset = counted_once(with_positions(dataset, robot))
    check_sockets(dataset, robot)
    check_stations(dataset)
    whole = single(dataset, robot)
    check_commands(dataset, robot)
    kept = whole.take(sane_rows(whole) & whole.readings.countable)
    reached = model.kinematics.forward(kept.q).reached
    if not reached.all():
        warn(
            f"set aside, because the robot can't reach them: {', '.join(map(str, dict.fromkeys(kept.pose[~reached])))}"
        )
    kept = kept.take(reached).in_order()
    readings = Readings.of(kept, robot)
    declared = np.array([sigma is not None for sigma in readings.declared])
    lacking = ~declared[readings.group] & ~np.isfinite(readings.row_sigma)
    if lacking.any():
        name = readings.rows.tables[int(readings.rows.of[lacking.any(axis=1)][0])].name
        raise DatasetError(
            f"the noise of {name} is not declared, and a check has too few readings to estimate it",
            file=dataset.file,
            hint=f"give the sigma of {name} in dataset.toml",
        )
    _check_count(kept, len(np.unique(kept.visits)))
    return kept, readings


def _check_count(dataset: Dataset, poses: int) -> None:
    if poses < FEWEST_POSES:
        raise DatasetError(
            f"{poses} usable poses", file=dataset.file, hint=f"a check needs {FEWEST_POSES}, and better ten"
        )


def _noise(dataset: Dataset, model: Model, priors: Priors) -> Noise:
    """The noise of measured poses for :func:`usable`, also where it is known from residuals alone."""
    own = dataset.instrument
    if model.fit is not None:
        return noise_of_fit(model, model.fit, own.position_sigma, own.orientation_sigma, priors)
    noise = known_noise(dataset, own.position_sigma, own.orientation_sigma, drives_of(model, priors))
    warn("the model states no noise of a fit: the smallest repeatability of the drives is assumed; calibrate the robot")
    return noise


def noise_of_fit(
    model: Model, fit: FitConditions, position: float | None = None, turns: float | None = None, priors: Priors = PRIORS
) -> Noise:
    """The noise that a check expects from that of the model's fit; ``position``, ``turns``: declared sigmas in their place."""
    position = fit.position_sigma if position is None else position
    turns = fit.orientation_sigma if turns is None else turns
    return Noise(position, turns, drives_of(model, priors)).scaled(fit.misfit)


def drives_of(model: Model, priors: Priors) -> float:
    """Scatter of each actuator, m or rad, that a check expects: that of the model's fit, but at least the smallest one."""
    least = priors.least_scatter
    if any(turning_joint(model.robot, site) for site in model.robot.sites):
        least /= RIM
    return least if model.fit is None else max(model.fit.drives, least)


INSTRUMENT_STEPS = 20
"""Most Gauss-Newton steps of the instruments' unknowns. Measured: a station that was declared half a metre off takes four."""
INSTRUMENT_CONVERGED = 1e-3
"""Change of the unknowns, in standard deviations of their priors, that ends the steps; less than the check's other errors."""


def with_unexplained(noise: ReadingNoise, measured: Readings, left: ModelDiscrepancy) -> ReadingNoise:
    """Noise and unexplained errors together, as if these were independent from pose to pose."""
    if left.none:
        return noise
    more = np.where(measured.group_turns, left.orientation, left.position)
    return replace(noise, sigma=np.hypot(noise.sigma, more), row_sigma=np.hypot(noise.row_sigma, more[noise.group]))


def expectation(earlier: Earlier, observed: Observed, since: Mapping[str, Column]) -> Design:
    """The linear problem about an earlier model: y ~ N(0, I + B B') where nothing has changed.

    y is the whitened difference of the measured poses and those that the model predicts. B is the whitened derivative by the
    model's unknowns, scaled by the root of their posterior covariance, and by the pose of the instrument where that is unknown,
    or by the unknowns of the instruments, scaled by the sigmas of their priors. ``since``: the covariates on
    which changes depend: see :meth:`Earlier.since`.

    Raises `ModelError` if a covariate is missing that an effect of the model needs.
    """
    measured, q = observed.measured, observed.measured.q
    at = replace(observed, covariates=since).operating_points(earlier.model)
    model, plain = earlier.model, at.poses
    poses = earlier.predicted(q, observed.covariates, plain)
    c, noise = measured.components, with_unexplained(observed.noise, measured, earlier.unexplained)
    if observed.free_frame:
        model = replace(model, frame=rough_frame(poses, Measured(q, *measured.poses)))
    else:
        measured = with_unknowns(measured, noise, at.command_jacobian, poses)
    W = noise.whitening(measured.change_by(at.command_jacobian, model, poses), c)
    by_model = measured.change_by(earlier.jacobian(q, observed.covariates, plain) @ earlier.root, model, poses)
    unknowns, free = measured.unknown_columns(model, poses, observed.free_frame, None)
    B = np.asarray((W @ np.concatenate([by_model, unknowns], axis=2)).reshape(len(q) * c, -1))
    known = len(measured.deviation)
    y = np.einsum("nij,nj->ni", W, measured.residual(model, poses)).ravel()
    y = y + B[:, B.shape[1] - free - known : B.shape[1] - free] @ measured.deviation
    return Design(at, W, model, y, B, B.shape[1] - free, measured.free_unknowns(observed.free_frame), measured)


def with_unknowns(readings: Readings, noise: ReadingNoise, J: Floats, poses: Poses) -> Readings:
    """The readings with the values of the instruments' unknowns that fit them best where the robot is at ``poses``, base frame.

    The linear problem of a check is about these values, because the unknown place of an instrument may be off by decimetres.
    ``J``: (N, 6 + k, n) derivative of the poses by the commands.

    Raises `ConvergenceError` if they have not converged.
    """
    found = readings.at(readings.start(poses))
    if not len(found.sigma):
        return found
    sigma = np.where(np.isfinite(found.sigma), found.sigma, VAGUE)
    prior = np.isfinite(found.sigma).astype(float)
    for _ in range(INSTRUMENT_STEPS):
        W = noise.whitening(np.asarray(found.by_motion(poses) @ J), found.components)
        columns = (W @ found.by_unknown(poses)).reshape(-1, len(sigma)) * sigma
        residual = np.einsum("nij,nj->ni", W, found.residual_at(poses)).ravel()
        right = columns.T @ residual - prior * found.deviation
        step = np.linalg.lstsq(columns.T @ columns + np.diag(prior), right, rcond=None)[0]
        found = found.at(found.u + sigma * step)
        if np.abs(step).max() < INSTRUMENT_CONVERGED:
            return found
    raise ConvergenceError(
        "the unknowns of the instruments have not converged",
        hint="check their stations, planes, sockets and targets in dataset.toml",
    )


def share_unexplained(design: Design, own: ReadingNoise, left: ModelDiscrepancy) -> float:
    """Share of unexplained errors in the mean variance of the whitened residuals; the rest is noise."""
    if left.none:
        return 0.0
    measured, at = design.measured, design.operating_points
    noise = own.covariance(measured.change_by(at.command_jacobian, design.model, at.poses), design.components)
    W = design.whitening
    return float(np.clip(1.0 - np.einsum("nij,njk,nik->ni", W, noise, W).mean(), 0.0, 1.0))
