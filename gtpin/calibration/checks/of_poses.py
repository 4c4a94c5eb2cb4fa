"""The path of a calibration from poses that one tracker measured: which rows can be used, and the checks around the fit."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gtpin.calibration.checks.convention import check_convention
from gtpin.calibration.checks.declared_noise import settled_or_explained, with_credible_noise
from gtpin.calibration.checks.moved_rows import check_instrument_steps, check_stretch, nominal_problem, stretch
from gtpin.calibration.checks.moved_sessions import check_sessions_linear
from gtpin.calibration.checks.prior_conflict import relieved, strain
from gtpin.calibration.checks.suspected import BEYOND, MISFIT, STRAYED, refuse, warn_of_strayed, zeros_off
from gtpin.calibration.checks.usable_rows import check_moved, check_other_readings, plausible_rows, reach_of
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.problem import Measured, rough_frame
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data import Dataset
from gtpin.data.duplicates import command_steps, with_rounding
from gtpin.data.plausible import named_poses
from gtpin.data.sane import sane_rows
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Model
from gtpin.noise import weights
from gtpin.noise.reading_noise import SMALLEST
from gtpin.typing import Mask

WHOLE = 1e-3
"""Median error, m, of rows that were set aside, from which they belong to another measurement. Assumed: an effect that acts
in some rows only is smaller."""
MOST = 0.25
"""Largest share of the rows that can be gross errors: with more, it is not clear which rows are wrong. Assumed."""
FAR = 0.01
"""Median position error after a fit, m, that no calibrated robot shows. Assumed."""
POOR = 1e-3
"""Position error, m, that no effect of the catalogue leaves after a calibration. Assumed."""
ROUNDED = 0.1, 1.5
"""Error of the commands over the step: at least in the median, at most in nine tenths of the rows. Assumed:
rounding makes up to a half, truncation up to one, and the geometry's own errors come on top."""


def usable_poses(given: Dataset, nominal: Model) -> tuple[Dataset, Mask, Dataset, Poses]:
    """The dataset with the noise that rounding adds; (N,) the rows that the robot can have reached; these rows, and their
    nominal poses, base frame."""
    whole = with_rounding(given)
    usable = sane_rows(whole)
    poses = nominal.kinematics.forward(whole.q[usable])
    plausible = plausible_rows(whole.take(usable), nominal, poses)
    usable[usable] = plausible
    kept = whole.take(usable)
    return whole, usable, replace(kept, orientation=None) if nominal.geometry.positions_only else kept, poses[plausible]


def settled_poses(kept: Dataset, fit: RobustFit, *, doubt: bool) -> FitState:
    """Run the robust fit with its checks; with ``doubt``, also of the declared noise, frame and tolerances.

    Raises `DatasetError` if the data can't be this robot's, or the fit does not describe them. `ConvergenceError` if it
    does not converge for another reason. Warns: names the poses that are rejected, and what was assumed wrongly.
    """
    measured, seen = fit.whole.poses, fit.whole.start.in_instrument_frame(fit.near)
    far = np.asarray(np.linalg.norm(measured.T - seen.T, axis=1) > reach_of(fit.whole.start.geometry))
    check_stretch(kept, measured, seen, far, bumps=False)
    coarse = None
    with _explained(kept, fit, measured, far):
        try:
            settled = settled_or_explained(fit) if doubt else fit.run()
        except ConvergenceError:
            if doubt:
                problem, noise = nominal_problem(fit.whole)
                check_instrument_steps(kept, problem, problem.point(problem.first, fit.near), noise)
            raise
        check_convention(kept, settled.fit, settled.noise.sigma)
        if doubt:
            used, noise = kept.take(settled.used), settled.noise.take(settled.used)
            check_instrument_steps(used, settled.fit.problem, settled.fit.point, noise)
        residual = settled.fit.problem.raw_residual(settled.fit.point, settled.fit.point.poses)[:, :3]
        if np.sqrt((residual**2).sum(axis=1).mean()) > POOR:
            check_sessions_linear(kept, fit.whole, fit.near)
            if coarse := _coarse_commands(fit.whole.start, measured, fit.near):
                warn(f"{coarse}; give commands with more digits")
        if not settled.used.all():
            _check_set_aside(kept, measured, settled)
            counted = f"{np.count_nonzero(~settled.used):,} of {len(kept):,} rows, of "
            several = len(set(kept.pose)) < len(kept)
            warn(f"set aside as gross errors: {counted if several else ''}{named_poses(kept, ~settled.used)}")
        _check_fit(kept, settled, seen)
        found = _unstrained(*with_credible_noise(fit, settled)) if doubt else settled
        if doubt and coarse is None:
            check_moved(kept, found.fit.point.model.geometry, fit.whole.start.geometry, fit.near, fit.found)
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
        check_stretch(dataset, measured, fit.whole.start.in_instrument_frame(fit.near), far)
        check_sessions_linear(dataset, fit.whole, fit.near)
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
    check_stretch(kept, measured, predicted, aside)
    off = np.linalg.norm(measured.T - predicted.T, axis=1)
    if np.nanmedian(off[aside]) < WHOLE:
        return
    found = stretch(aside)
    if found is None and aside.mean() < MOST:
        return
    lines = kept.row[aside if found is None else found]
    where = f"{aside.sum()} of {len(aside)} rows" if found is None else f"rows {lines.min()} to {lines.max()}"
    left = float(np.nanmedian(off[aside]))
    error = DatasetError(
        f"{where} do not fit the others, by {1e3 * left:.3g} mm in the median",
        file=kept.file,
        row=int(lines.min()),
        hint="commands or readings of other rows, signs or units of a part of the table; correct them, or leave them out",
    )
    if left > BEYOND[0]:
        refuse(error, kept)
    else:
        warn(str(error))


def _unstrained(fit: RobustFit, settled: FitState) -> FitState:
    """The result of the fit; if the priors contradict the data, repeated with a wider tolerance or a free frame."""
    found = strain(settled)
    strayed = np.abs(settled.deviation).max(initial=0.0) > STRAYED
    # Where no parameter deviates so far, the priors may be contradicted by another cause, such as a ball out of round.
    if settled.widened == 1.0 and (found is None or (found.what != "frame" and not strayed)):
        return settled
    if settled.widened > 1.0 and (found is None or found.what == "tolerances"):
        warn(
            f"the nominal model is not this machine: its parameters are off by {settled.widened:.2g} times their "
            "tolerances; tolerances are widened to admit it"
        )
        return settled
    assert found is not None
    if found.what == "frame":
        start = replace(fit.whole.start, frame=rough_frame(fit.near, fit.whole.poses))
        freed = replace(fit, whole=replace(fit.whole, start=start, free_frame=True))
        warn(
            f"the instrument's frame looks {found.size * 1e3:.2g} mm and {found.turn * 1e3:.2g} mrad off the robot's: it is "
            'fitted as free; write frame = "free"'
        )
        return freed.run()
    relaxed = fit.with_geometry(relieved(settled, found)).run()
    if zeros := zeros_off(relaxed):
        deviation = zeros
    elif found.what in ("part", "zero"):
        named = found.site if found.what == "part" else f"the zero of {found.site}"
        deviation = f"{named} looks off by more than the tolerances allow"
    else:
        deviation = f"its parameters are off by {found.size:g} times their tolerances"
    warn(f"the nominal model is not this machine: {deviation}; tolerances are widened to admit it")
    return relaxed


def _check_fit(kept: Dataset, settled: FitState, nominal: Poses) -> None:
    """Raise `DatasetError` if even the calibrated robot is far from the data; warn if residuals are much larger than noise."""
    point, measured = settled.fit.point, settled.fit.problem.poses
    model = point.model
    errors, errors_before = (
        np.linalg.norm(measured.T - predicted.T, axis=1)
        for predicted in (model.in_instrument_frame(point.poses), nominal[settled.used])
    )
    left, before = float(np.median(errors)), float(np.median(errors_before))
    worst = float(np.quantile(errors, 1.0 - MOST))
    what = None
    if left > FAR and left > 0.25 * before:
        what = f"calibration leaves {left * 1e3:.3g} mm of {before * 1e3:.3g} mm: these can't be the robot's poses"
    elif worst > reach_of(model.geometry):
        share = f"{MOST:.0%} of the poses"
        what = f"calibration leaves {worst * 1e3:.3g} mm and more at {share}: these can't be the robot's poses"
    if what:
        hint = "check the order, signs and zeros of columns"
        if kept.instrument.frame != "free":
            hint += ', and whether the instrument stood elsewhere (frame = "free")'
        lines = kept.row[settled.used]
        found = stretch(errors > max(10.0 * float(np.quantile(errors, 0.25)), WHOLE))
        row = None
        if found is not None:  # the others fit: these rows are the reason
            row = int(lines[found].min())
            what = f"rows {row} to {int(lines[found].max())} do not fit the others; {what}"
        refuse(DatasetError(what, file=kept.file, row=row, hint=hint), kept)
    if left < SMALLEST and kept.instrument.position_sigma is None:
        warn(
            f"the positions agree with the calibrated kinematics to {left * 1e6:.2g} um in the median, and no instrument "
            "measures so well: were they computed (targets of a controller, a simulation without noise), and not measured?"
        )
    size = weights.robust_scale(settled.fit.residual)
    if size > MISFIT or settled.sigma_scale > 1.0:
        coarse = _coarse_commands(model, measured, point.poses)
        why = f"{coarse}; give them with more digits" if coarse else "the geometry does not explain these data"
        if coarse or size > MISFIT:
            times = max(size, settled.sigma_scale)
            warn(f"residuals are {times:{'.0f' if times > MISFIT else '.1f'}} times the noise: {why}")
    # The rotation of a measured track about itself depends on where targets were on carts: it is no error of the machine.
    rolled = np.array([p.kind == "track_direction" and p.component == 2 for p in model.geometry.parameters])
    warn_of_strayed(settled, rolled)


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
    if not ROUNDED[0] <= np.median(wrong) or np.quantile(wrong, 0.9) > ROUNDED[1]:
        return None
    size = 1e3 * np.median(np.linalg.norm(off, axis=1))
    return f"all commands are multiples of {steps.words}, and poses are off by {size:.2g} mm, as such a step makes them"
