"""Geometry identified while effects of an earlier model are kept: the same machine, with another tool or instrument."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.effects.active import ActiveEffect, lasts, warn_of_extrapolation
from gtpin.effects.operating_points import part_of_turn
from gtpin.errors import ConvergenceError, ModelError, unheard, warn
from gtpin.kinematics.rotations import exp, from_quaternions, to_quaternions
from gtpin.robot.chain import Chain
from gtpin.typing import Floats


def with_kept_effects(
    dataset: Dataset, effects: Sequence[ActiveEffect], robot: Chain, calibrated: Callable[[Dataset], Calibration]
) -> Calibration:
    """Identify the geometry of a machine that has these effects; the result's model has them, with their coefficients.

    The motions of the poses by the effects are subtracted from the measured poses, in the instrument's frame, and the
    geometry is identified from the rest, until the motions no longer change.

    A curve of a turning joint (a sum of periodic deviations, a smooth deviation) is known at the angles of its fit. Where some
    commands have other angles, the calibration is made twice: with the extrapolated curves, and with curves that are zero at
    other angles. The one with the smaller position error is returned.

    ``effects``: fitted effects of a machine of this robot. Drift of the instrument or the target, and their shifts between
    sessions, are left out. ``calibrated``: identifies the geometry from a dataset, without effects.

    Raises `DatasetError` if the dataset has readings of other instruments than one tracker. `ModelError` if an effect's
    site is not one of the robot's, or a covariate is missing that an effect needs. `ConvergenceError` if the motions do not
    converge. Warns: names effects that are left out, that count as zero elsewhere, and that are extrapolated.
    """
    dataset.refuse_readings(
        "effects of a model can be kept for poses of one tracker only",
        "leave the model out, or diagnose these readings",
    )
    kept = tuple(active for active in effects if lasts(active, robot))
    if left_out := ", ".join(active.name for active in effects if active not in kept):
        warn(f"left out: {left_out}, which are not valid on another day")
    for active in kept:
        if active.site not in active.effect.sites(robot):
            what = f"{robot.name} has no {active.site} with a {active.effect.id}"
            raise ModelError(what, hint="keep effects of a model of this robot")
    cautious = tuple(_only_measured(active, robot, dataset.q) for active in kept)
    found = _with_kept(dataset, kept, calibrated)
    if cautious != kept:
        less = _with_kept(dataset, cautious, calibrated)
        if _error(less, dataset) < _error(found, dataset):
            found = less
            cut = ", ".join(active.name for active, old in zip(cautious, kept, strict=True) if active is not old)
            where = "at angles that the earlier fit did not have, where they predict these poses worse"
            warn(f"{cut} count as zero {where}")
    warn_of_extrapolation(found.model.effects, robot, dataset.q, dataset.covariates)
    return found


def _only_measured(active: ActiveEffect, robot: Chain, q: Floats) -> ActiveEffect:
    """A curve of a turning joint that is zero where its fit had no commands, where some commands q (N, n) are there."""
    angles = active.references.angles
    if not active.effect.of_own_command or not len(angles):
        return active
    j = robot.sites.index(active.site)
    if not angles[j].any() or angles[j][part_of_turn(q[:, j])].all():
        return active
    return replace(active, only_measured=True)


def _error(found: Calibration, dataset: Dataset) -> float:
    """Root mean square position error of the calibrated model, m; poses that are set aside do not count."""
    predicted = found.model.predict(dataset.q, dataset.covariates).T
    used = np.isfinite(predicted).all(axis=1) & ~np.isin(dataset.pose, list(found.rejected))
    return float(np.sqrt(((predicted - dataset.position)[used] ** 2).sum(axis=1).mean()))


def _with_kept(
    dataset: Dataset, kept: Sequence[ActiveEffect], calibrated: Callable[[Dataset], Calibration]
) -> Calibration:
    """The calibration of the poses less the motions by these effects, repeated until the motions no longer change."""
    with unheard():  # of a fit that does not take the effects into account yet
        found, before = calibrated(dataset), np.zeros((len(dataset), 6))
    for _ in range(6):  # the motions change with the geometry in second order only: three are usual
        model = replace(found.model, effects=tuple(kept))
        motions = model.predict(dataset.q, dataset.covariates).minus(found.model.predict(dataset.q))
        motions[~np.isfinite(motions).all(axis=1)] = 0.0  # poses out of reach: the calibration leaves them out
        if np.abs(motions - before).max(initial=0.0) < 1e-7:  # m and rad
            return replace(found, model=model)
        orientation = dataset.orientation
        if orientation is not None:
            orientation = to_quaternions(exp(-motions[:, 3:]) @ from_quaternions(orientation))
        less = replace(dataset, position=dataset.position - motions[:, :3], orientation=orientation)
        found, before = calibrated(less), motions
    raise ConvergenceError(
        "the motions by the kept effects do not settle",
        hint="check that the model is of this machine, and has the same units",
    )
