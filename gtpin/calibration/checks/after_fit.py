"""The fit of a calibration with the checks around it: errors and warnings where it shows a mistake in the data."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.calibration.checks import instruments, limits, moved, suspected
from gtpin.calibration.checks.before_fit import check_moved, check_other_readings, reach_of
from gtpin.calibration.checks.declared_noise import settled_or_explained, with_credible_noise
from gtpin.calibration.checks.payload import check_payload
from gtpin.calibration.checks.prior_conflict import without_prior_conflict
from gtpin.calibration.checks.readings import either, misread, rotation_readings
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.observability import UNSEEN
from gtpin.calibration.problem import Measured, Point
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data import Dataset
from gtpin.data.files import warn_of
from gtpin.data.names import ORIENTATION
from gtpin.data.plausible import command_steps
from gtpin.distributions import chi2
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.rotations import log
from gtpin.model.model import Model
from gtpin.noise import weights
from gtpin.noise.reading_noise import SMALLEST
from gtpin.typing import Floats, Mask


def settled_poses(kept: Dataset, fit: RobustFit, *, doubt: bool) -> FitState:
    """Run the robust fit of the rows that are ``kept`` of the poses that one tracker measured, with its checks.

    ``doubt``: whether the declared noise, frame and tolerances are checked too; the noise of readings always is.

    Raises `DatasetError` if the data can't be this robot's, or the fit does not describe them. `ConvergenceError` if it
    does not converge for another reason. Warns: names the poses that are rejected, and what was assumed wrongly.
    """
    measured, seen = fit.whole.poses, fit.whole.start.in_instrument_frame(fit.near)
    far = np.asarray(np.linalg.norm(measured.T - seen.T, axis=1) > reach_of(fit.whole.start.geometry))
    moved.check_stretch(kept, measured, seen, far, bumps=False)
    with _explained(kept, fit, measured, far):
        try:
            settled = settled_or_explained(fit) if doubt else fit.run()
        except ConvergenceError:
            if doubt:
                point = fit.whole.point(fit.whole.first, fit.near)
                moved.check_instrument_steps(kept, fit.whole, point, moved.initial_noise(fit.whole.measured))
            raise
        check_convention(kept, settled.fit, settled.noise.sigma)
        if doubt:
            used, noise = kept.take(settled.used), settled.noise.take(settled.used)
            moved.check_instrument_steps(used, settled.fit.problem, settled.fit.point, noise)
        residual = settled.fit.problem.raw_residual(settled.fit.point, settled.fit.point.poses)[:, :3]
        if np.sqrt((residual**2).sum(axis=1).mean()) > limits.POOR:
            # A smaller motion is left to a diagnosis: a drive's zero or a tool that grows can look like it.
            moved.check_sessions_linear(kept, fit.whole, fit.near, limits.SESSION_FAR)
        if not settled.used.all():
            _check_set_aside(kept, measured, settled)
            warn(suspected.gross_errors(kept, ~settled.used))
        coarse, found = _check_fit(kept, settled, seen), settled
        if doubt:
            found = without_prior_conflict(*with_credible_noise(fit, settled))
        else:
            suspected.warn_of_far_parameters(settled, settled.geometry.tolerance)
        if doubt and coarse is None and not found.doubt:
            check_moved(kept, found.fit.point.model.geometry, fit.whole.start.geometry, fit.near, fit.found)
    check_payload(kept.take(found.used), found.fit)
    return found


@contextlib.contextmanager
def _explained(dataset: Dataset, fit: RobustFit, measured: Measured, far: Mask) -> Iterator[None]:
    """Context of a fit: if it fails because of another mistake of the user, the error names this mistake."""
    try:
        yield
    except (ConvergenceError, DatasetError) as error:
        if error.row is not None or error.column is not None:  # it names what is wrong already
            raise
        check_other_readings(dataset, fit.whole.start, fit.near, failed=True)
        moved.check_stretch(dataset, measured, fit.whole.start.in_instrument_frame(fit.near), far)
        moved.check_sessions_linear(dataset, fit.whole, fit.near, 1e-3)
        coarse = _coarse_commands(fit.whole.start, measured, fit.near)
        if coarse is None:
            raise
        hint = f"give commands with more digits; if they are exact: {error.what}"
        columns = f"q1 .. q{measured.q.shape[1]}"
        raise DatasetError(coarse, file=dataset.file, column=columns, hint=hint) from None


def _check_set_aside(kept: Dataset, measured: Measured, settled: FitState) -> None:
    """Refuse a fit that set aside a sequence of rows, or a large part of them; a warning where an effect can explain these."""
    aside = ~settled.used
    predicted = settled.fit.point.model.predict(kept.q)
    moved.check_stretch(kept, measured, predicted, aside)
    off = np.linalg.norm(measured.T - predicted.T, axis=1)
    if np.nanmedian(off[aside]) < limits.POOR:
        return
    found = moved.stretch(aside)
    if found is None and aside.mean() < limits.MOST_GROSS:
        return
    lines = kept.row[aside if found is None else found]
    where = f"{aside.sum()} of {len(aside)} rows" if found is None else f"rows {lines.min()} to {lines.max()}"
    left = float(np.nanmedian(off[aside]))
    what = f"{where} do not fit the others, by {1e3 * left:.3g} mm in the median"
    hint = "commands or readings of other rows, signs or units of a part of the table; correct them, or leave them out"
    error = DatasetError(what, file=kept.file, row=int(lines.min()), hint=hint)
    suspected.refuse(error, kept, sure=left > limits.NO_EFFECT[0])


def _check_fit(kept: Dataset, settled: FitState, nominal: Poses) -> str | None:
    """Raise `DatasetError` if even the calibrated robot is far from the data; warn if residuals are much larger than noise.

    Returns what :func:`_coarse_commands` says of the residuals where they are larger than noise.
    """
    point, measured = settled.fit.point, settled.fit.problem.poses
    model = point.model
    errors, errors_before = (
        np.linalg.norm(measured.T - predicted.T, axis=1)
        for predicted in (model.in_instrument_frame(point.poses), nominal[settled.used])
    )
    left, before = float(np.median(errors)), float(np.median(errors_before))
    worst = float(np.quantile(errors, 1.0 - limits.MOST_GROSS))
    what = None
    if left > limits.NO_EFFECT[0] and left > 0.25 * before:
        what = f"calibration leaves {left * 1e3:.3g} mm of {before * 1e3:.3g} mm: these can't be the robot's poses"
    elif worst > reach_of(model.geometry):
        share = f"{limits.MOST_GROSS:.0%} of the poses"
        what = f"calibration leaves {worst * 1e3:.3g} mm and more at {share}: these can't be the robot's poses"
    if what:
        hint = "check the order, signs and zeros of columns"
        if kept.instrument.frame != "free":
            hint += ', and whether the instrument stood elsewhere (frame = "free")'
        lines = kept.row[settled.used]
        found = moved.stretch(errors > max(10.0 * float(np.quantile(errors, 0.25)), limits.POOR))
        row = None
        if found is not None:  # the others fit: these rows are the reason
            row = int(lines[found].min())
            what = f"rows {row} to {int(lines[found].max())} do not fit the others; {what}"
        suspected.refuse(DatasetError(what, file=kept.file, row=row, hint=hint), kept)
    if left < SMALLEST and kept.instrument.position_sigma is None:
        warn(
            f"the positions agree with the calibrated kinematics to {left * 1e6:.2g} um in the median, and no instrument "
            "measures so well: were they computed (targets of a controller, a simulation without noise), and not measured?"
        )
    size, coarse = weights.robust_scale(settled.fit.residual), None
    if size > limits.MISFIT or settled.sigma_scale > 1.0:
        coarse = _coarse_commands(model, measured, point.poses)
        why = f"{coarse}; give them with more digits" if coarse else suspected.UNEXPLAINED
        if coarse or size > limits.MISFIT:
            times = max(size, settled.sigma_scale)
            warn(f"residuals are {times:{'.0f' if times > limits.MISFIT else '.1f'}} times the noise: {why}")
    return coarse


def _coarse_commands(model: Model, measured: Measured, poses: Poses) -> str | None:
    """A message, if commands that were rounded or truncated explain the residuals from ``poses`` (N), base frame; else None."""
    steps = command_steps(measured.q, model.robot.revolute)
    if steps is None:
        return None
    some = np.linspace(0, len(poses) - 1, min(len(poses), 300)).astype(int)
    q, near, frame = measured.q[some], poses[some], model.frame
    off = measured.T[some] - near.moved(frame.T, frame.R).T
    J = model.kinematics.command_jacobian(q, near)[:, :3]
    wrong = np.abs(np.einsum("nij,nj->ni", np.linalg.pinv(J), off @ frame.R) / steps.size).max(axis=1)
    # Rounding makes up to a half of a step, truncation up to one, and the geometry's own errors come on top.
    if not np.median(wrong) >= 0.1 or np.quantile(wrong, 0.9) > 1.5:
        return None
    size = 1e3 * np.median(np.linalg.norm(off, axis=1))
    return f"all commands are multiples of {steps.words}, and poses are off by {size:.2g} mm, as such a step makes them"


def settled_readings(given: Dataset, kept: Dataset, fit: RobustFit, *, doubt: bool) -> FitState:
    """As :func:`settled_poses`, for readings of any instruments."""
    readings, near, reach = fit.whole.measured, fit.near, reach_of(fit.whole.start.geometry)

    def misfit(some: Readings, index: int, rough: bool = False) -> instruments.Misfit | None:
        tried = replace(fit, whole=replace(fit.whole, measured=some))
        try:
            other = tried.rough() if rough else tried.run().fit
        except ConvergenceError:
            return None
        return instruments.Misfit.of(other.problem.readings(other.point.x), other.point.poses, index)

    instruments.check_readable(given, readings, fit.whole.start, near, reach, misfit)
    with instruments.explained(readings, near):
        credible, settled = with_credible_noise(fit, settled_or_explained(fit))
    fitted = settled.fit.problem.readings(settled.fit.point.x)
    left, heights = (
        fitted.residual_at(settled.fit.point.poses)[:, 0],
        np.asarray(fitted.rows.columns.get("height", np.nan), dtype=float),
    )
    own = np.isfinite(heights)
    # Errors of touches of the size by which their heights vary would be taken for noise that was not declared.
    vary = own.any() and settled.noise.estimated.any() and np.std(left[own]) > limits.VARIATION * np.std(heights[own])
    if settled.scale > limits.MISFIT or vary:
        instruments.check_heights(given, readings, near, reach, misfit)
    _check_used(kept, readings, settled.used)
    before = [instruments.Misfit.of(readings, near, i) for i in range(len(readings.instruments))]
    instruments.check_fitted(given, fitted, settled.fit.point.poses, reach, before)
    if settled.scale > limits.MISFIT:
        scale = f"residuals are {settled.scale:.0f} times the noise"
        warn(f"{scale}: {suspected.UNEXPLAINED}, or the declared sigma is too small")
    found = settled
    if doubt:
        found = without_prior_conflict(credible, settled)
    else:
        suspected.warn_of_far_parameters(settled, settled.geometry.tolerance)
    if not found.doubt:
        check_moved(given, found.fit.point.model.geometry, fit.whole.start.geometry, near, fit.found)
    _warn_of_deviations(found)
    return found


def _check_used(kept: Dataset, readings: Readings, used: Mask) -> None:
    """Refuse an instrument with most of its rows set aside; warn of others, and of a station, plane, socket or target."""
    for i, one in enumerate(readings.instruments):
        mine = readings.rows.of == i
        share = float((~used[mine]).mean()) if mine.any() else 0.0
        if share > limits.MOST_GROSS_READINGS:
            what = f"{100.0 * share:.0f} % of the readings of {one.name} do not fit the others"
            hint = "check its units, its rows' commands, and where it stood"
            suspected.refuse(DatasetError(what, file=readings.rows.files[i], hint=hint), kept)
    rows = readings.rows
    for i, table in enumerate(rows.tables):
        mine = rows.rows_of(i)
        for column, names in rows.known[i].items():
            for name in names if len(names) > 1 else ():
                own = mine[rows.columns[column][mine] == name]
                count, lost = (len(np.unique(rows.line[some])) for some in (own, own[~used[own]]))
                if count >= 3 and lost > limits.MOST_GROSS_READINGS * count:
                    what = f"{lost} of {count} readings of {table.name} with {column} {name} do not fit the others"
                    warn_of(rows.files[i], f"{what}: check what dataset.toml declares of it, and these rows")
    if not used.all():
        warn(suspected.gross_errors(kept, ~used))


def _warn_of_deviations(settled: FitState) -> None:
    """Warn of a geometry as a whole, and of fitted unknowns, that are farther from what is declared than their priors allow."""
    readings = settled.fit.problem.readings(settled.fit.point.x)
    x, seen = settled.fit.point.x[: settled.fit.problem.n_geometry], settled.observability
    # Along a direction with the variance reduction l, the estimate has the variance l, in units of the squared tolerances.
    known = seen.variance_reduction > UNSEEN
    along = seen.directions[:, known].T @ x
    chance = chi2.sf(float((along**2 / seen.variance_reduction[known]).sum()), max(int(known.sum()), 1))
    far = suspected.far_from_declared(settled.deviation, settled.geometry.names, "tolerances")
    if not far and chance < 1e-6:
        text = f"the geometry as a whole is farther from nominal than its tolerances allow (chance {chance:.1g})"
        hint = "check commands, known distances, and what is declared of the instruments, or give larger tolerances"
        warn(f"{text}: {hint}; an effect that the geometry absorbs can be the reason too")
    if names := suspected.far_from_declared(readings.deviation, [one.name for one in readings.unknowns], "sigmas"):
        hint = "correct what it declares, or give larger prior sigmas"
        far = f"unknowns more than {limits.FAR_FROM_PRIOR:g} prior sigmas from what dataset.toml declares"
        warn(f"{far}: {names}: {hint}")


def check_convention(dataset: Dataset, fit: Fit, sigmas: Floats) -> None:
    """Suspect orientations that fit far better when they are read by another convention of rotations.

    ``dataset``: the rows of the fit, used or not. ``sigmas`` (2,): the noise of the fit, m and rad.

    For small angles two conventions give nearly the same rotation: the difference grows with the square of the angle, and a fit
    absorbs a part of it. Therefore the residuals of a convention are those after a linearised fit to the orientations read by
    it: r - J dx, with dx from the normal equations with the tolerances as priors.
    """
    measured = fit.problem.poses
    # About one axis conventions differ only in how they scale noise about other axes.
    if measured.R is None or len(measured.T) < 20 or measured.q.shape[1] == 1:
        return
    rows = np.linspace(0, len(measured.T) - 1, min(len(measured.T), limits.ENOUGH_ROWS)).astype(int)
    some = measured.take(rows)
    assert some.R is not None
    point = fit.point
    predicted = point.model.in_instrument_frame(point.poses[rows])
    problem = fit.problem.take(rows, fit.problem.whitening[rows])
    J = problem.jacobian(Point(point.x, point.model, point.poses[rows]), slice(None))
    weight = np.repeat(np.sqrt(fit.weight[rows]), 6)
    A = J.reshape(-1, J.shape[2]) * weight[:, None]
    solve = np.linalg.solve(A.T @ A + np.diag(problem.prior), A.T)

    rotation = Rotation.from_matrix(some.R)
    as_is, *other_axes = rotation_readings(rotation, turned=True)
    readings = [as_is, *misread(rotation), *other_axes]
    vectors = log(np.stack([R for _, R in readings]) @ np.swapaxes(predicted.R, 1, 2))
    both = np.concatenate([np.broadcast_to(some.T - predicted.T, vectors.shape), vectors], axis=2)
    r = np.einsum("nij,knj->kni", problem.whitening, both, optimize=True).reshape(len(readings), -1) * weight
    # (k, 2) sums of squares of the position and orientation residuals that each of k readings leaves after the fit.
    sums = ((r - (r @ solve.T) @ A.T).reshape(len(readings), -1, 2, 3) ** 2).sum(axis=(1, 3))
    now, *others = sums[:, 1]
    least = min(others)
    if not (least < limits.CONVENTION_LEFT * now and least < now - limits.CONVENTION_GAIN):
        return
    tried = zip(others, readings[1:], strict=True)
    found = [reading for value, (reading, _) in tried if value <= limits.AS_GOOD * least]
    looks, hints = either(found)
    of_each = (sigmas * np.sqrt(sums / (3.0 * fit.weight[rows].sum()))).tolist()
    before, after = (tuple(of_each[i]) for i in (0, 1 + others.index(least)))
    error = DatasetError(looks, file=dataset.file, column=" ".join(ORIENTATION), hint=hints)
    if least <= limits.CONVENTION_CERTAIN * now:
        return suspected.refuse(error, dataset)
    suspected.suspect(error, dataset, before, after, exact=True)
