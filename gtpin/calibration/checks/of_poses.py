"""The path of a calibration from measured poses: which rows can be used, and what is checked before and after the fit."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gtpin.calibration.checks.convention import other_convention
from gtpin.calibration.checks.declared_noise import settled_or_explained, with_credible_noise
from gtpin.calibration.checks.moved_rows import (
    check_instrument_steps,
    check_stretch,
    far_from_nominal,
    nominal_problem,
    stretch,
)
from gtpin.calibration.checks.moved_sessions import check_sessions_linear
from gtpin.calibration.checks.prior_conflict import relieved, strain
from gtpin.calibration.checks.recognise import either
from gtpin.calibration.checks.suspected import BEYOND, refuse, suspect
from gtpin.calibration.checks.usable_rows import check_size, plausible_rows, reach_of
from gtpin.calibration.fit_state import FitState
from gtpin.calibration.problem import Measured, Problem, measured_poses, rough_frame
from gtpin.calibration.robust_fit import RobustFit
from gtpin.data import Dataset
from gtpin.data.duplicates import POSITION_STEPS, coarsest_step, with_rounding
from gtpin.data.names import ORIENTATION
from gtpin.data.sane import sane_rows
from gtpin.errors import ConvergenceError, DatasetError, warn
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.model.model import Frame, Model
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
MISFIT = 10.0
"""Size of the residuals, in units of the noise, from which there is a warning. Assumed."""
STRAYED = 6.0
"""Deviation of a parameter from nominal, in units of its tolerance, from which there is a warning. Assumed."""
POOR = 1e-3
"""Position error, m, that no effect of the catalogue leaves after a calibration. Assumed."""
COARSE = (0.1, 0.05, *POSITION_STEPS)
"""Steps that commands are rounded to, m or rad, the coarsest first."""
ROUNDED = 0.1, 1.5
"""Error of the commands over the step: at least in the median, at most in nine tenths of the rows. Assumed:
rounding makes up to a half, truncation up to one, and the geometry's own errors come on top."""
NINE_TENTHS = 0.9


@dataclass(frozen=True)
class PoseChecks:
    """The checks of poses that one tracker measured; with ``doubt``, also of the declared noise, frame and tolerances."""

    given: Dataset
    nominal: Model
    doubt: bool

    @cached_property
    def whole(self) -> Dataset:
        """The dataset with the noise that rounding adds."""
        return with_rounding(self.given)

    @cached_property
    def rows(self) -> tuple[Mask, Dataset, Poses]:
        """(N,) the rows that the robot can have reached, these rows, and their nominal poses, base frame."""
        usable = sane_rows(self.whole)
        poses = self.nominal.kinematics.forward(self.whole.q[usable])
        plausible = plausible_rows(self.whole.take(usable), self.nominal, poses)
        usable[usable] = plausible
        kept = self.whole.take(usable)
        if self.nominal.geometry.reduced:
            kept = replace(kept, orientation=None)
        return usable, kept, poses[plausible]

    @property
    def problem(self) -> Problem:
        """The problem about the nominal machine."""
        _, kept, near = self.rows
        measured, free = measured_poses(kept), self.whole.instrument.frame == "free"
        check_size(self.whole, measured, 6 if free else 0)
        start = replace(self.nominal, frame=rough_frame(near, measured) if free else Frame())
        c = measured.components
        return Problem(start, Readings.of(kept, start.robot), np.broadcast_to(np.eye(c), (len(kept), c, c)), free)

    def settled(self, fit: RobustFit) -> FitState:
        """Run the robust fit with its checks.

        Raises `DatasetError` if the data can't be this robot's, or the fit does not describe them. `ConvergenceError` if it
        does not converge for another reason. Warns: names the poses that are rejected, and what was assumed wrongly.
        """
        _, kept, near = self.rows
        measured, seen = fit.whole.poses, fit.whole.start.in_instrument_frame(near)
        far = far_from_nominal(measured, seen, reach_of(self.nominal.geometry))
        check_stretch(kept, measured, seen, far, bumps=False)
        with _explained(kept, fit, measured, far):
            if self.doubt:
                settled = _settled_in_doubt(kept, fit)
            else:
                settled = fit.run()
                _check_convention(kept, settled)
            residual = settled.fit.problem.raw_residual(settled.fit.point, settled.fit.point.poses)[:, :3]
            if np.sqrt((residual**2).sum(axis=1).mean()) > POOR:
                check_sessions_linear(kept, fit.whole, near)
                if coarse := _coarse_commands(fit.whole.start, measured, near):
                    warn(f"{coarse}; give commands with more digits")
            _check_used(kept, measured, settled)
            if not settled.used.all():
                warn(f"set aside as gross errors: poses {', '.join(kept.names_of(~settled.used))}")
            _check_fit(kept, settled, seen)
            return _unstrained(*with_credible_noise(fit, settled)) if self.doubt else settled


@contextlib.contextmanager
def _explained(dataset: Dataset, fit: RobustFit, measured: Measured, far: Mask) -> Iterator[None]:
    """Context of a fit: if it fails because of moved sessions, coarse commands or shifted rows, the error says so."""
    try:
        yield
    except (ConvergenceError, DatasetError) as error:
        if error.row is not None:  # it names what is wrong already
            raise
        check_stretch(dataset, measured, fit.whole.start.in_instrument_frame(fit.near), far)
        check_sessions_linear(dataset, fit.whole, fit.near)
        coarse = _coarse_commands(fit.whole.start, measured, fit.near)
        if coarse is None:
            raise
        hint = f"give commands with more digits; if they are exact: {error.what}"
        columns = f"q1 .. q{measured.q.shape[1]}"
        raise DatasetError(coarse, file=dataset.file, column=columns, hint=hint) from None


def _settled_in_doubt(dataset: Dataset, fit: RobustFit) -> FitState:
    """Calibrate; an error says if the instrument moved, or if a declared sigma keeps the fit from converging."""
    try:
        settled = settled_or_explained(fit)
    except ConvergenceError:
        problem, noise = nominal_problem(fit.whole)
        check_instrument_steps(dataset, problem, problem.point(problem.first, fit.near), noise)
        raise
    _check_convention(dataset, settled)
    check_instrument_steps(
        dataset.take(settled.used), settled.fit.problem, settled.fit.point, settled.noise.take(settled.used)
    )
    return settled


def _check_used(kept: Dataset, measured: Measured, settled: FitState) -> None:
    """Refuse a fit that set aside a sequence of rows, or a large part of them; a warning where an effect can explain these."""
    if settled.used.all():
        return
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
    if found.what == "zero":
        deviation = f"the zero of {found.site} looks {found.size * 1e3:.3g} mm or mrad off"
    elif found.what == "part":
        deviation = f"{found.site} looks {abs(found.size):.2g} tolerances off"
    else:
        deviation = f"its parameters are off by {found.size:g} times their tolerances"
    warn(f"the nominal model is not this machine: {deviation}; tolerances are widened to admit it")
    return fit.with_geometry(relieved(settled, found)).run()


def _check_convention(dataset: Dataset, settled: FitState) -> None:
    """Suspect orientations that fit far better when they are read by another convention."""
    found, before, after = other_convention(settled.fit, settled.noise.sigma)
    if found:
        looks, hints = (either(words) for words in zip(*((r.looks, r.hint) for r in found), strict=True))
        error = DatasetError(looks, file=dataset.file, column=" ".join(ORIENTATION), hint=hints)
        suspect(error, dataset, before, after, exact=True)


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
        hint = 'check the order and signs of columns, and whether the instrument stood elsewhere (frame = "free")'
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
    if size > MISFIT:
        coarse = _coarse_commands(model, measured, point.poses)
        why = f"{coarse}; give them with more digits" if coarse else "the geometry does not explain these data"
        warn(f"residuals are {size:.0f} times the noise: {why}")
    x = settled.deviation
    # The rotation of a measured track about itself depends on where targets were on carts: it is no error of the machine.
    rolled = np.array([p.kind == "direction" and p.component == 2 for p in model.geometry.parameters])
    far = np.flatnonzero((np.abs(x) > STRAYED) & ~rolled)
    strayed = [f"{model.geometry.names[i]} ({x[i]:+.0f})" for i in far[np.argsort(-np.abs(x[far]))]]
    if strayed:
        warn(f"parameters more than {STRAYED:g} tolerances from nominal: {', '.join(strayed[:5])}")


def _coarse_commands(model: Model, measured: Measured, poses: Poses) -> str | None:
    """A message, if commands that were rounded or truncated explain the residuals from ``poses`` (N), base frame; else None."""
    step = coarsest_step(measured.q, COARSE)
    if step is None:
        return None
    some = np.linspace(0, len(poses) - 1, min(len(poses), 300)).astype(int)
    q, near, frame = measured.q[some], poses[some], model.frame
    off = measured.T[some] - near.moved(frame.T, frame.R).T
    J = model.kinematics.command_jacobian(q, near)[:, :3]
    wrong = np.abs(np.einsum("nij,nj->ni", np.linalg.pinv(J), off @ frame.R)).max(axis=1)
    if not ROUNDED[0] * step <= np.median(wrong) or np.quantile(wrong, NINE_TENTHS) > ROUNDED[1] * step:
        return None
    turning = [actuator.revolute for actuator in model.robot.actuators]
    unit = "rad" if all(turning) else "m or rad" if any(turning) else "m"
    size = 1e3 * np.median(np.linalg.norm(off, axis=1))
    return (
        f"all commands are multiples of {step:g} {unit}, and poses are off by {size:.2g} mm, as such a step makes them"
    )
