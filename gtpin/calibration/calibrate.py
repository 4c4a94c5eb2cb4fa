"""Identify a robot's geometry from a dataset."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from gtpin.calibration.checks.after_fit import settled_poses, settled_readings
from gtpin.calibration.checks.before_fit import fittable
from gtpin.calibration.checks.suspected import recalled
from gtpin.calibration.fit_state import FitState, unexplained_by
from gtpin.calibration.gauss_newton import Fit
from gtpin.calibration.kept_effects import with_kept_effects
from gtpin.calibration.left_out import left_out
from gtpin.calibration.observability import UNSEEN, remedies
from gtpin.calibration.problem import nominal_residual
from gtpin.calibration.result import Calibration, InstrumentFit, Iteration
from gtpin.calibration.robust_fit import EXPECTED, Progress, RobustFit
from gtpin.calibration.thinning import thinned
from gtpin.data import Dataset
from gtpin.data.files import warn_of
from gtpin.distributions import chi2
from gtpin.effects.active import ActiveEffect
from gtpin.errors import DatasetError, ModelError, check_kind, noted, unheard, warn
from gtpin.instruments.readings import Readings
from gtpin.kinematics.poses import Poses
from gtpin.memory import amount, require
from gtpin.model.fit_conditions import FitConditions
from gtpin.model.measured_robot import robot_of
from gtpin.noise.reading_noise import ReadingNoise
from gtpin.paper.geometry import Per, nominal_geometry
from gtpin.paper.models import MEASURED, model_geometry
from gtpin.read_only import gives_read_only
from gtpin.robot.chain import Chain
from gtpin.robot.command_ranges import check_actuators
from gtpin.robot.geometry import Geometry, check_names
from gtpin.robot.parameters import KINDS, TOLERANCE
from gtpin.threads import in_one_thread
from gtpin.typing import Floats, Indices, Mask

FIXED = 80e6
"""Bytes of memory that a calibration needs for any number of poses: chunks of them, and a part that is fitted first."""
PER_POSE = 1900.0
"""Bytes of memory that it needs for each pose, in addition to the dataset. Measured: 1,870 of a Gantry-Tau, whose
configurations have 22 numbers (docs/speed.md)."""
ANNOUNCED_POSES = 100_000
"""Number of poses from which on the expected memory and time are stated first."""
TRIED, PASSES = 1_000, (2.0, 12.0)
"""Number of poses whose derivatives are computed to see how fast this machine is, and the fewest and most times that a
calibration takes that for each pose. Measured: 2 where the geometry explains the data, 12 where it does not."""


@in_one_thread
@gives_read_only
def calibrate(
    dataset: Dataset,
    robot: Chain | None = None,
    *,
    model: int | None = None,
    orientations: bool = False,
    directions: Per = "actuator",
    scale: Per | None = None,
    without: Iterable[str] = (),
    zeros: bool = False,
    fix: Mapping[str, float] | None = None,
    free: Iterable[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    keep_effects: Iterable[ActiveEffect] = (),
    widen: bool = True,
    poses: int | None = None,
    trust_data: bool = False,
    progress: Progress | None = None,
) -> Calibration:
    """Identify joint offsets, rod lengths and track geometry by Gauss-Newton with manufacturing tolerances as priors.

    Parameters
    ----------
    dataset
        Measured poses or readings.
    robot
        The nominal robot; by default the one that the dataset names.
    model
        One of models 1 to 5 of Dressler et al. 2010 (see :func:`~gtpin.paper.models.model_geometry`), in place of
        the parameters that ``directions``, ``scale``, ``without`` and ``zeros`` choose. These models leave out known causes
        of deviations. Therefore the noise is estimated from their residuals, and declared sigmas are not used.
    orientations
        Whether models 2, 4 and 5 also use the carts' measured rotations along their tracks; not used without ``model``.
    directions, scale, without, zeros
        Choice of parameters: see :func:`~gtpin.paper.geometry.nominal_geometry`. The default for the Gantry-Tau is 48
        parameters: those of rod lengths and joints, and one track direction per cart. ``zeros``: also the zeros of the
        commanded joints, ``zero[JOINT]``, with the tolerance ``zero`` (0.1 m or rad).
    fix
        By name, the values of parameters that are known, m, rad or m/m: they are held there.
    free
        Names of parameters whose tolerance says nothing: the data alone determine them.
    bounds
        By name, the smallest and largest possible value, m, rad or m/m. A parameter that the fit puts outside is held at that
        end, the farthest one first, and the others are fitted again.
    keep_effects
        Effects of an earlier model of the machine (``model.effects``), which stay as they are: the same machine with another
        tool or instrument. See :func:`~gtpin.calibration.kept_effects.with_kept_effects`.
    widen
        Whether tolerances that the data contradict are widened. An effect, of which a calibration has none, can be the reason.
    poses
        Number of poses that are used of a dataset with more: see :func:`~gtpin.calibration.thinning.thinned`. None: all.
    trust_data
        Whether checks for usual mistakes (units, signs, orders of columns) only warn, and never refuse the data.
    progress
        Called with the name of the step, the number of the iteration, and the RMS residual in units of the noise; first, for
        very many poses, with the memory and the time to expect. None: no calls.

    Returns
    -------
    calibration
        Values, sigmas, variance reduction, and the calibrated model.

    Raises
    ------
    DatasetError
        If the dataset does not fit the robot, or is too small.
    ModelError
        If an option has another value, or does not fit the robot or the model; or no parameter has a name.
    ConvergenceError
        If the fit does not converge.

    Warns
    -----
    GtpinWarning
        Names the poses whose rows are rejected as outliers, and mistakes that the data may have. ``warnings`` of the result has
        the texts.

    Examples
    --------
    >>> import gtpin
    >>> calibration = gtpin.calibrate(gtpin.Dataset.read("measured"))
    >>> calibration["length[2a]"].unit, len(calibration.names)
    ('m', 48)
    >>> held = gtpin.calibrate(gtpin.Dataset.read("measured"), fix={"length[2a]": 2.043})
    >>> held["length[2a]"].value, len(held.names)
    (2.043, 47)
    """
    check_kind(dataset, Dataset)
    check_kind(robot, Chain, type(None))
    if orientations and model is not None and model not in MEASURED:
        hint = "use 2, 4 or 5, or leave orientations out"
        raise ModelError(f"model {model} has no measured tracks to turn", hint=hint)
    for option, given in (("fix", fix), ("bounds", bounds)):
        if not isinstance(given, Mapping | None):
            raise ModelError(f"{option}={given!r}", hint="give a dictionary by the names of parameters")
    without, kept, fixed = tuple(without), tuple(keep_effects), dict(fix or {})
    history = list[Iteration]()

    def watched(step: str, number: int, rms: float) -> None:
        if np.isfinite(rms):  # else it announces a long calibration
            history.append(Iteration(step, number, rms))
        if progress is not None:
            progress(step, number, rms)

    with noted() as texts, recalled(texts):
        data = replace(dataset, trusted=True) if trust_data else dataset
        robot = robot_of(dataset) if robot is None else robot
        for kind in (kind for kind in dataset.tolerance if kind not in KINDS):
            hint = f"kinds are {', '.join(TOLERANCE)}"
            raise DatasetError("unknown kind of tolerance", file=dataset.toml, column=f"tolerance.{kind}", hint=hint)
        if model is None:
            nominal = partial(nominal_geometry, robot, directions=directions, scale=scale, without=without, zeros=zeros)
            geometry = nominal(tolerance=dataset.tolerance)
            _warn_of_unused(dataset, nominal)
        else:
            check_actuators(robot, dataset)
            geometry = model_geometry(model, robot, dataset, orientations=orientations)
        freed = {free} if isinstance(free, str) else set(free)
        if both := [name for name in fixed if name in freed]:
            raise ModelError(f"{both[0]} is to be held and freed", hint="name it in fix or in free")
        geometry = geometry.freed(freed).holding(fixed)
        limits = dict(bounds or {})
        check_names(limits, (*geometry.names, *fixed))
        for name, ends in limits.items():
            if np.shape(ends) != (2,) or not ends[0] < ends[1]:
                raise ModelError(f"bounds of {name} are {ends!r}", hint="give the smallest and the largest value")
        if poses is not None:
            data = thinned(data, geometry, poses)

        def calibrated(data: Dataset) -> Calibration:
            data, lacking = data if model is None else without_sigmas(data), model is not None
            fitted = partial(_calibrated, data, doubt=not (lacking or without or fixed), lacking=lacking, widen=widen)
            chosen = geometry
            while limits:
                with unheard():
                    unbounded = fitted(chosen, None)
                if (beyond := _beyond(unbounded, limits)) is None:
                    break
                name, end = beyond
                own = unbounded[name]
                off = abs(own.value - end) / own.sigma
                where = f"the data put it at {own.value:.7g} +- {own.sigma:.2g}, {off:.2g} sigmas outside"
                warn(f"{name} is held at {end:g}, the end of its bounds: {where}")
                chosen = chosen.holding({name: end})
            return fitted(chosen, watched)

        found = with_kept_effects(data, kept, robot, calibrated) if kept else calibrated(data)
        if found.worse:
            warn(found.worse)
        if found.assumed_turn is not None:
            size = f"{found.assumed_turn:.2g} rad, which the residuals show, is used"
            warn(f"orientation_sigma is not declared: {size}, and orientation errors of this size count as noise")
    dataset = dataset if poses is None else replace(data, trusted=dataset.trusted)
    told = dataset.all_warnings(texts)
    return replace(found, dataset=dataset, paper_model=model, warnings=told, history=tuple(history))


@in_one_thread
def calibrate_geometry(
    dataset: Dataset, geometry: Geometry, progress: Progress | None = None, *, lacking: bool = False
) -> Calibration:
    """Identify the parameters of a given nominal geometry. A reduced arm is fitted to positions only.

    ``lacking``: as for :class:`~gtpin.calibration.robust_fit.RobustFit`.
    """
    return _calibrated(dataset, geometry, progress, doubt=False, lacking=lacking)


def _warn_of_unused(dataset: Dataset, nominal: Callable[..., Geometry]) -> None:
    """Warn of tolerances of kinds of which the robot has no parameter; ``nominal``: gives its geometry with a tolerance."""

    def used(kind: str) -> bool:
        one, two = (nominal(tolerance={kind: size}).tolerance for size in (1.0, 2.0))
        return bool((one != two).any())

    if unused := [kind for kind in dataset.tolerance if not used(kind)]:
        kinds = ", ".join(kind for kind in TOLERANCE if used(kind))
        what = f"no parameter of this robot is of the kind {', '.join(unused)} ([tolerance])"
        warn_of(dataset.toml, f"{what}; it has {kinds}")


def _beyond(found: Calibration, bounds: Mapping[str, tuple[float, float]]) -> tuple[str, float] | None:
    """The parameter that is farthest outside its bounds, in sigmas, and the end that it exceeds; None: all are inside."""
    inside = {name: float(np.clip(found[name].value, *ends)) for name, ends in bounds.items() if name in found.names}
    off = {name: abs(found[name].value - end) / found[name].sigma for name, end in inside.items()}
    worst = max(off, key=lambda name: off[name], default="")
    return (worst, inside[worst]) if off.get(worst, 0.0) > 0.0 else None


def _calibrated(
    dataset: Dataset,
    geometry: Geometry,
    progress: Progress | None = None,
    *,
    doubt: bool,
    lacking: bool,
    widen: bool = True,
) -> Calibration:
    """Fit; with ``doubt``, also check the declared noise, frame and tolerances. ``lacking``, ``widen``: as for `RobustFit`."""
    needed = FIXED + PER_POSE * len(dataset)
    require(f"calibrating {len(dataset):,} poses", needed)
    if progress is not None and len(dataset) >= ANNOUNCED_POSES:
        progress(f"{EXPECTED} {amount(needed)} of memory and {_expected(dataset, geometry)}", 0, float("nan"))
    data, whole, usable, kept, near, problem, tracked = fittable(dataset, geometry)
    if not problem.size:
        raise ModelError("there is nothing to identify: no parameter is left", hint="leave out or hold fewer of them")
    target, parameters = data.instrument.target == "free", problem.start.geometry.parameters
    found = np.array([p.is_free or (target and p.kind == "platform") for p in parameters], dtype=bool)
    free = found if found.any() else None
    fit = RobustFit(problem, kept.row, kept.visits, near, progress, lacking, free, widen=widen)
    settled = settled_poses(kept, fit, doubt=doubt) if tracked else settled_readings(data, kept, fit, doubt=doubt)
    if settled.dof < 1.0:  # nothing could be said of its noise or its error
        numbers = len(kept) * problem.measured.components
        what = f"{numbers:g} measured numbers leave {max(settled.dof, 0.0):.2g} degrees of freedom"
        hint = "measure more: a fit needs more numbers than it takes to fit them (of touches of one plane, about 25; a mesh of "
        raise DatasetError(what, file=data.file, hint=f"{hint}7 x 7 is good)")
    return _result(settled, near, whole, usable, tracked=tracked)


def _expected(dataset: Dataset, geometry: Geometry) -> str:
    """The time that a calibration is expected to take on this machine, in words, and what takes less."""
    some = dataset.take(slice(TRIED))
    start = time.process_time()
    with unheard():
        begun = fittable(some, geometry)
    point = begun.problem.point(begun.problem.first, begun.near)
    for rows in begun.problem.chunks():
        begun.problem.jacobian(point, rows)
    least, most = ((time.process_time() - start) / TRIED * len(dataset) * passes / 60.0 for passes in PASSES)
    return f"{least:.2g} to {most:.2g} min for {len(dataset):,} poses (--poses N, poses=N: seconds)"


def without_sigmas(dataset: Dataset) -> Dataset:
    """The dataset without declared noise, for models that leave out known causes: their residuals determine the weights."""
    undeclared = dict.fromkeys(("position_sigma", "orientation_sigma"))
    rows, instrument = dataset.readings, dataset.instrument.model_copy(update=undeclared)
    tables = tuple(t.model_copy(update=undeclared | {"sigma": None}) if any(rows.stations) else t for t in rows.tables)
    return replace(dataset, instrument=instrument, readings=replace(rows, tables=tables))


def _result(settled: FitState, near: Poses, whole: Dataset, usable: Mask, *, tracked: bool) -> Calibration:
    """Make the result from the converged iterations.

    ``near``: (M) poses of the nominal geometry, base frame, at the fitted rows, gross errors included. ``whole``,
    ``usable``: N rows, and (N,) True for the M rows that were fitted. ``tracked``: whether they are a single tracker's.
    """
    final, noise = settled.final, settled.noise.take(settled.used)
    problem, point = final.problem, final.point
    p, geometry, measured = problem.n_geometry, point.model.geometry, problem.measured
    aside = np.ones(len(whole), dtype=bool)
    aside[np.flatnonzero(usable)[settled.used]] = False
    covariance = final.covariance[:p, :p] * np.outer(geometry.tolerance, geometry.tolerance)
    before = nominal_residual(settled.fit.problem, near[settled.used])
    residual = problem.raw_residual(point, point.poses)
    variance, known = _variances(final, noise), noise.known
    unexplained = unexplained_by(settled.fit, residual, variance, known=known, dof=noise.dof)
    unexplained = unexplained.beside(*_beyond_declared(noise, measured))
    floor = _at_most(variance, residual, measured.group, settled.dof / problem.count)
    out, some = left_out(final)
    readings, k, seen = problem.readings(point.x), len(problem.unit), settled.observability
    unseen = seen.directions[:, seen.variance_reduction < UNSEEN]
    model = replace(point.model, covariance=covariance, unexplained=unexplained, doubt=settled.doubt)
    instrument = whole.instrument
    if tracked:
        conditions = FitConditions.of(
            settled.noise, settled.chi2, settled.dof, measured.q, whole.covariates, unexplained
        )
        model = replace(model, fit=conditions)
        used = measured.rows.tables[0].model_dump(include={"position_sigma", "orientation_sigma"})
        instrument = instrument.model_copy(update=used | ({"frame": "free"} if problem.free_frame else {}))
    rows = measured.rows
    return Calibration(
        model=replace(model, instruments=readings.fitted),
        covariance=covariance,
        observability=seen,
        noise=settled.noise,
        sigmas=tuple(zip(readings.group_names, np.where(readings.group_turns, "rad", "m").tolist(), strict=True)),
        sigma_scale=settled.sigma_scale,
        freedom=min([tails.freedom for tails in settled.tails], default=np.inf),
        # The components of one row of a table count once.
        poses=len(rows) if (rows.component < 0).all() else int(rows.row.max()) + 1,
        rejected=whole.names_of(aside),
        rejected_rows=tuple(dict.fromkeys(int(line) for line in whole.row[aside])),
        chi2=settled.chi2,
        dof=settled.dof,
        iterations=settled.steps,
        residual=residual,
        residual_before=before,
        instrument=instrument,
        dataset=whole,
        by_instrument=tuple(_by_instrument(readings, (before, residual, np.sqrt(floor)), out, some)),
        fit=final,
        row_poses=tuple(map(str, whole.pose[~aside])),
        unknowns=readings.unknowns,
        u=readings.u,
        u_covariance=final.covariance[p : p + k, p : p + k] * np.outer(problem.unit, problem.unit),
        remedies=remedies(settled.fit, unseen, geometry.robot.up),
    )


def _variances(fit: Fit, noise: ReadingNoise) -> Floats:
    """(N, c) variance of the noise of each number of a fit's rows, m^2 and rad^2; ``noise``: that of these rows."""
    if noise.repeatability == 0.0 and noise.sight is None:
        return noise.each**2
    problem, c = fit.problem, fit.residual.shape[1]
    each = (noise.take(rows).covariance(problem.by_command(fit.point, rows), c) for rows in problem.chunks())
    return np.diagonal(np.concatenate([*each]), axis1=1, axis2=2)


def _beyond_declared(noise: ReadingNoise, measured: Readings) -> tuple[float, float]:
    """The scatter between visits, m, root mean square over all lengths: beyond what the declared sigmas contain, and at most.

    Where no sigma is declared, anything from none to all of it can be the machine's.
    """
    lengths = ~np.isfinite(noise.row_sigma) & (measured.counted > 0.0) & ~measured.group_turns[measured.group]
    if noise.source != "repeats" or not lengths.any():
        return 0.0, 0.0
    sigmas = [(s if own is None else own, own or 0.0) for own, s in zip(measured.declared, noise.sigma, strict=True)]
    beyond = np.maximum(noise.sigma[:, None] ** 2 - np.square(sigmas), 0.0) * noise.estimated[:, None]
    some, most = np.sqrt(beyond[measured.group[lengths]].mean(axis=0)).tolist()
    return some, most


def _at_most(variance: Floats, residual: Floats, group: Indices, free: float) -> Floats:
    """(N, c) variance of the noise, at most what residuals show of each group: the end of their 95 % chi-square interval.

    ``residual``, ``group``: (N, c) residuals, m and rad, and index of the sigma of each number. ``free``: degrees of freedom
    of a number.
    """
    found = variance.copy()
    for one in np.unique(group):
        own = group == one
        most = (residual[own] ** 2).sum() / chi2.ppf(0.025, max(free * np.count_nonzero(own), 1.0))
        found[own] *= min(1.0, float(most / variance[own].mean()))
    return found


def _by_instrument(readings: Readings, errors: Iterable[Floats], out: Floats, some: Mask) -> Iterator[InstrumentFit]:
    """Errors (N, c) of each instrument: before, after, and of noise alone; and ``out`` those left out, of the rows ``some``."""
    part = readings.take(some)
    for i, one in enumerate(readings.instruments):
        count = max(len(np.unique(readings.rows.line[readings.rows.of == i])), 1)
        for unit in dict.fromkeys(c.unit for c in one.components if c.shown):
            before, after, noise = (readings.rms(i, values, unit) for values in errors)
            yield InstrumentFit(one.name, one.kind, count, before, after, noise, unit, part.rms(i, out, unit))
